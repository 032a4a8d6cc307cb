// A library to be preloaded, which fails system calls that concern files in a folder named "faulty", and others. What it does
// is said by environment variables:
// ETENDUE_FAULT=fail:N    the N-th call that changes a file fails
// ETENDUE_FAULT=kill:N    the process is killed in its place
// ETENDUE_FAULT_CALL=NAME only calls of this function count, such as fsync
// ETENDUE_FAULT_MARK=FILE is made when that happens, or when a thread cannot be made
// ETENDUE_SLOW_WRITE=MS   each write takes so many milliseconds longer
// ETENDUE_NO_THREADS=1    std::thread finds no further thread
// ETENDUE_NO_THREADS=memory  or no memory for its state
// ETENDUE_CLOCK=N         the monotonic clock is N times as fast

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>

namespace {

template <class Function>
Function* next(const char* name) {
    return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

long number(const char* variable) {
    const char* const text = std::getenv(variable);
    return text ? std::atol(text) : 0;
}

struct Fault {
    bool kills = false;
    long at = 0;
    const char* call = std::getenv("ETENDUE_FAULT_CALL");
    Fault() {
        const char* const text = std::getenv("ETENDUE_FAULT");
        if (!text || std::strlen(text) < 6) return;
        kills = std::strncmp(text, "kill:", 5) == 0;
        at = std::atol(text + 5);
    }
};

bool is_concerned(const char* path) {
    return std::strstr(path, "/faulty/") != nullptr;
}
bool is_concerned(int file) {
    char link[64], path[PATH_MAX];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    const ssize_t n = ::readlink(link, path, sizeof path - 1);
    if (n <= 0) return false;
    path[n] = 0;
    const char* const kFolder = "/faulty";
    const size_t end = std::strlen(kFolder);
    return is_concerned(path) || (size_t(n) >= end && std::strcmp(path + n - end, kFolder) == 0);
}

void leave_mark() {
    const char* const mark = std::getenv("ETENDUE_FAULT_MARK");
    if (!mark) return;
    const int file = next<int(const char*, int, ...)>("open")(mark, O_WRONLY | O_CREAT, 0600);
    if (file >= 0) next<int(int)>("close")(file);
}

/// Whether the call is to fail.
template <class What>
bool fails(const char* call, What what) {
    static const Fault fault;
    static std::atomic<long> calls{0};
    if (fault.at == 0 || (fault.call && std::strcmp(call, fault.call) != 0)) return false;
    if (!is_concerned(what) || ++calls != fault.at) return false;
    leave_mark();
    if (fault.kills) ::raise(SIGKILL);
    errno = ENOSPC;
    return true;
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* data, size_t size) {
    if (fails("write", file)) return -1;
    static const long milliseconds = number("ETENDUE_SLOW_WRITE");
    if (milliseconds > 0 && is_concerned(file)) ::usleep(useconds_t(1000 * milliseconds));
    return next<ssize_t(int, const void*, size_t)>("write")(file, data, size);
}
off_t lseek(int file, off_t offset, int whence) noexcept {
    // Files that are only read do not change.
    if ((::fcntl(file, F_GETFL) & O_ACCMODE) != O_RDONLY && fails("lseek", file)) return -1;
    return next<off_t(int, off_t, int)>("lseek")(file, offset, whence);
}
off64_t lseek64(int file, off64_t offset, int whence) noexcept {
    return lseek(file, offset, whence);
}
int fsync(int file) {
    if (fails("fsync", file)) return -1;
    return next<int(int)>("fsync")(file);
}
/// Where a server has the file, it may only say now that there is no room. The descriptor is closed nevertheless.
int close(int file) {
    const bool is_to_fail = fails("close", file);
    const int result = next<int(int)>("close")(file);
    if (!is_to_fail) return result;
    errno = EDQUOT;
    return -1;
}
int rename(const char* from, const char* to) noexcept {
    if (fails("rename", to)) return -1;
    return next<int(const char*, const char*)>("rename")(from, to);
}
int open(const char* path, int flags, ...) {
    mode_t mode = 0;
    if (flags & (O_CREAT | O_TMPFILE)) {
        va_list more;
        va_start(more, flags);
        mode = va_arg(more, mode_t);
        va_end(more);
    }
    if ((flags & O_CREAT) && fails("open", path)) return -1;
    return next<int(const char*, int, ...)>("open")(path, flags, mode);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*),
                   void* argument) noexcept {
    Dl_info starter{};
    // Other libraries, such as TBB, do not survive it.
    if (std::getenv("ETENDUE_NO_THREADS") && ::dladdr(reinterpret_cast<void*>(start), &starter) &&
        std::strstr(starter.dli_fname, "libstdc++")) {
        leave_mark();
        return EAGAIN;
    }
    using Function = int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
    return next<Function>("pthread_create")(thread, attributes, start, argument);
}

/// std::thread::_M_start_thread(_State_ptr, void (*)()), after the state was allocated.
void start_thread(void* thread, void* state, void (*depend)()) __asm__(
    "_ZNSt6thread15_M_start_threadESt10unique_ptrINS_6_StateESt14default_deleteIS1_EEPFvvE");
void start_thread(void* thread, void* state, void (*depend)()) {
    const char* const fault = std::getenv("ETENDUE_NO_THREADS");
    if (fault && std::strcmp(fault, "memory") == 0) {
        leave_mark();
        throw std::bad_alloc();
    }
    next<void(void*, void*, void (*)())>(
        "_ZNSt6thread15_M_start_threadESt10unique_ptrINS_6_StateESt14default_deleteIS1_EEPFvvE")(
        thread, state, depend);
}

int clock_gettime(clockid_t clock, timespec* time) noexcept {
    static const auto original = next<int(clockid_t, timespec*)>("clock_gettime");
    static const long factor = number("ETENDUE_CLOCK");
    const int result = original(clock, time);
    if (factor == 0 || result != 0 || clock != CLOCK_MONOTONIC) return result;
    constexpr long kSecond = 1'000'000'000;
    static const timespec begin = *time;
    const long elapsed =
        factor * ((time->tv_sec - begin.tv_sec) * kSecond + (time->tv_nsec - begin.tv_nsec));
    const long nanoseconds = begin.tv_nsec + elapsed;
    time->tv_sec = begin.tv_sec + nanoseconds / kSecond;
    time->tv_nsec = nanoseconds % kSecond;
    return 0;
}
}
