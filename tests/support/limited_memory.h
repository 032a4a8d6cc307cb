#pragma once
// Runs what must not need much memory in a process that has no more.

#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <string>

namespace etendue {

#if defined(__has_feature)
#define ETENDUE_HAS_FEATURE(x) __has_feature(x)
#else
#define ETENDUE_HAS_FEATURE(x) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) ||                               \
    ETENDUE_HAS_FEATURE(address_sanitizer) || ETENDUE_HAS_FEATURE(thread_sanitizer)
/// Sanitizers reserve address space for their own use, so that it cannot be limited.
constexpr bool kCanLimitMemory = false;
#else
constexpr bool kCanLimitMemory = true;
#endif
#undef ETENDUE_HAS_FEATURE

/// Limits the memory of this process to what it has and so many bytes more, where that is possible. What is free in the heap
/// would come on top, and is taken away.
inline void limit_address_space(uint64_t more) {
    if (!kCanLimitMemory) return;
    std::ifstream statm("/proc/self/statm");
    uint64_t pages = 0;
    statm >> pages;
    const uint64_t now = pages * uint64_t(sysconf(_SC_PAGESIZE));
    rlimit limit{now, now + more};
    setrlimit(RLIMIT_AS, &limit);
    void* volatile taken = nullptr;
    for (size_t size = size_t(1) << 30; size >= size_t(1) << 16; size /= 2) {
        do {
            taken = std::malloc(size);
        } while (taken);
    }
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_AS, &limit);
}

/// Runs `action` in a child process with `more` bytes of memory and a minute of time. Returns "" if it returned, what() of
/// an exception that it threw, or how the process ended.
template <class Action>
std::string in_limited_memory(uint64_t more, const Action& action) {
    int ends[2];
    if (pipe(ends) != 0) return "no pipe";
    const pid_t child = fork();
    if (child == 0) {
        limit_address_space(more);
        alarm(60);
        std::string text;
        try {
            action();
        } catch (const std::exception& e) {
            text = std::string(e.what()).substr(0, 4000);
        }
        const ssize_t written = ::write(ends[1], text.data(), text.size());
        _exit(written == ssize_t(text.size()) ? 0 : 1);
    }
    ::close(ends[1]);
    std::string text;
    char buffer[4096];
    for (ssize_t n = 0; (n = ::read(ends[0], buffer, sizeof buffer)) > 0;)
        text.append(buffer, size_t(n));
    ::close(ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status)) return "ended by signal " + std::to_string(WTERMSIG(status));
    if (WEXITSTATUS(status) != 0) return "ended with code " + std::to_string(WEXITSTATUS(status));
    return text;
}

}  // namespace etendue
