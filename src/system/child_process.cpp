#include "system/child_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <thread>

#include <fmt/format.h>

#include "system/descriptor.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

constexpr int kEnding[] = {SIGINT, SIGTERM, SIGHUP};

/// The thread of a HeldSignals. A global, since handlers have no argument through which to reach it.
class Holder {
public:
    /// False if there is one already.
    bool take() {
        pid_t none = 0;
        return thread_.compare_exchange_strong(none, ::gettid());
    }
    void give_up() { thread_ = 0; }
    /// Fails where the thread has given up or is this one, which does not hold signals that it handles.
    bool send(int signal) const noexcept {
        const pid_t thread = thread_;
        return thread != 0 && thread != ::gettid() && ::tgkill(::getpid(), thread, signal) == 0;
    }

private:
    std::atomic<pid_t> thread_{0};
};
Holder holder;
/// Of a child whose program could not be started, beside the number of the error in a pipe.
constexpr int kNotStarted = 127;

std::string error_text(int error) {
    return std::generic_category().message(error);
}

/// As after nohup.
bool is_ignored(int signal) {
    struct sigaction action {};
    return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

/// In the child, between fork() and exec(), where only functions are allowed that signal handlers may call.
[[noreturn]] void become(char* const* argv, int log, int failure, pid_t parent) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(kNotStarted);  // it has ended before
    for (const int signal : kEnding)
        if (!is_ignored(signal)) ::signal(signal, SIG_DFL);
    ::signal(SIGPIPE, SIG_DFL);
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    // Where the parent has closed a standard stream, `log` or `failure` may have its number.
    constexpr int kFirstOther = STDERR_FILENO + 1;
    log = ::fcntl(log, F_DUPFD_CLOEXEC, kFirstOther);
    failure = ::fcntl(failure, F_DUPFD_CLOEXEC, kFirstOther);
    const int input = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    ::dup2(input, STDIN_FILENO);
    ::dup2(log, STDOUT_FILENO);
    ::dup2(log, STDERR_FILENO);
    ::execv(argv[0], argv);
    const int error = errno;
    [[maybe_unused]] const ssize_t ignored = ::write(failure, &error, sizeof error);
    ::_exit(kNotStarted);
}

/// The status of waitpid().
int wait_for(pid_t child) {
    int status = 0;
    bool is_ended = false;
    while (true) {
        const pid_t done = ::waitpid(child, &status, is_ended ? 0 : WNOHANG);
        if (done == child) break;
        if (done < 0 && errno != EINTR) throw std::runtime_error("waitpid: " + error_text(errno));
        if (is_ended) continue;
        if (HeldSignals::has_one()) {
            ::kill(child, SIGKILL);
            is_ended = true;
        } else {
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        }
    }
    if (is_ended) throw std::runtime_error("interrupted");
    return status;
}

}  // namespace

HeldSignals::HeldSignals() {
    sigset_t held;
    ::sigemptyset(&held);
    for (const int signal : kEnding)
        if (!is_ignored(signal)) ::sigaddset(&held, signal);
    ::pthread_sigmask(SIG_BLOCK, &held, &before_);
    is_first_ = holder.take();
}

HeldSignals::~HeldSignals() {
    if (is_first_) holder.give_up();
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

bool HeldSignals::pass_on(int signal) noexcept {
    return holder.send(signal);
}

bool HeldSignals::has_one() {
    sigset_t pending;
    ::sigemptyset(&pending);
    ::sigpending(&pending);
    for (const int signal : kEnding)
        if (::sigismember(&pending, signal) == 1) return true;
    return false;
}

TemporaryFolder::TemporaryFolder() {
    std::error_code error;
    const fs::path parent = fs::temp_directory_path(error);
    if (error) throw std::runtime_error("no folder for temporary files: " + error.message());
    std::string name = (parent / "etendue-XXXXXX").string();
    if (!::mkdtemp(name.data()))
        throw std::runtime_error(
            fmt::format("cannot make a folder in {}: {}", parent.string(), error_text(errno)));
    path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

std::string find_program(const std::string& name) {
    const char* const path = std::getenv("PATH");
    std::istringstream folders(path ? path : "/usr/local/bin:/usr/bin:/bin");
    for (std::string folder; std::getline(folders, folder, ':');) {
        const std::string file = (fs::path(folder.empty() ? "." : folder) / name).string();
        std::error_code ignored;
        if (fs::is_regular_file(file, ignored) && ::access(file.c_str(), X_OK) == 0) return file;
    }
    return "";
}

int run_child(std::vector<std::string> words, const std::string& log) {
    std::vector<char*> argv;
    for (std::string& w : words) argv.push_back(w.data());
    argv.push_back(nullptr);
    const Descriptor output(
        ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0600));
    if (!output.is_open()) throw std::runtime_error(fmt::format("{}: {}", log, error_text(errno)));
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("pipe: " + error_text(errno));
    const Descriptor reading(ends[0]);
    pid_t child = 0;
    {
        const Descriptor writing(ends[1]);
        const pid_t self = ::getpid();
        // Where it is ignored, as by what started the program, there would be nothing to wait for. A handler is the host's.
        if (is_ignored(SIGCHLD)) ::signal(SIGCHLD, SIG_DFL);
        child = ::fork();
        if (child == 0) become(argv.data(), output.get(), writing.get(), self);
        if (child < 0)
            throw std::runtime_error(
                fmt::format("cannot start {}: {}", words[0], error_text(errno)));
    }
    const int status = wait_for(child);
    int error = 0;
    if (::read(reading.get(), &error, sizeof error) == ssize_t(sizeof error))
        throw std::runtime_error(fmt::format("cannot start {}: {}", words[0], error_text(error)));
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace etendue
