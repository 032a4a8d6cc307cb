// A library to be preloaded: with ETENDUE_FAULT=fail:N, the N-th system call that changes a file in a folder named "faulty"
// fails; with kill:N, the process is killed in its place.

#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

struct Fault {
    bool kills = false;
    long at = 0;
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

/// Whether the call is to fail.
template <class What>
bool fails(What what) {
    static const Fault fault;
    static std::atomic<long> calls{0};
    if (fault.at == 0 || !is_concerned(what) || ++calls != fault.at) return false;
    if (fault.kills) ::raise(SIGKILL);
    errno = ENOSPC;
    return true;
}

template <class Function>
Function* next(const char* name) {
    return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* data, size_t size) {
    if (fails(file)) return -1;
    return next<ssize_t(int, const void*, size_t)>("write")(file, data, size);
}
int fsync(int file) {
    if (fails(file)) return -1;
    return next<int(int)>("fsync")(file);
}
int rename(const char* from, const char* to) noexcept {
    if (fails(to)) return -1;
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
    if ((flags & O_CREAT) && fails(path)) return -1;
    return next<int(const char*, int, ...)>("open")(path, flags, mode);
}
}
