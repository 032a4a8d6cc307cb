#pragma once
// Runs a program and captures its output.

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

namespace etendue::test {

struct ProgramResult {
    int status = -1;  ///< Exit status; -1 if it did not exit by itself.
    int signal = 0;   ///< The signal that ended it.
    std::string output, errors;
};

inline std::string read_text(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// A process with its output in files of `folder`.
class Program {
public:
    Program(const std::string& program, const std::vector<std::string>& arguments,
            const std::filesystem::path& folder)
        : out_(folder / "stdout.txt"), err_(folder / "stderr.txt") {
        std::vector<std::string> words{program};
        words.insert(words.end(), arguments.begin(), arguments.end());
        std::vector<char*> argv;
        for (std::string& w : words) argv.push_back(w.data());
        argv.push_back(nullptr);
        pid_ = fork();
        if (pid_ != 0) return;
        constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
        dup2(open(out_.c_str(), kFlags, 0600), STDOUT_FILENO);
        dup2(open(err_.c_str(), kFlags, 0600), STDERR_FILENO);
        ::signal(SIGPIPE, SIG_DFL);
        execv(argv[0], argv.data());
        _exit(127);
    }
    void interrupt() const { kill(pid_, SIGINT); }
    void send(int signal) const { kill(pid_, signal); }
    /// Whether it has a handler of SIGINT by now.
    bool handles_interrupts() const { return has_signal("SigCgt:\t", SIGINT); }
    /// Whether it finishes its work after SIGINT by now, as commands that render do, which also ignore closed pipes.
    bool catches_interrupts() const {
        return handles_interrupts() && has_signal("SigIgn:\t", SIGPIPE);
    }
    /// Number of its file descriptors.
    int open_files() const {
        const std::filesystem::directory_iterator all("/proc/" + std::to_string(pid_) + "/fd");
        return int(std::distance(begin(all), end(all)));
    }
    /// Number of its threads; 0 after its end.
    int threads() const {
        const std::string status = read_text("/proc/" + std::to_string(pid_) + "/status");
        const size_t at = status.find("Threads:");
        return at == std::string::npos || status.find("State:\tZ") != std::string::npos
                   ? 0
                   : std::stoi(status.substr(at + sizeof("Threads:")));
    }
    /// Its output on standard error so far.
    std::string errors() const { return read_text(err_); }

    ProgramResult wait() const {
        int status = 0;
        waitpid(pid_, &status, 0);
        ProgramResult r;
        if (WIFEXITED(status)) r.status = WEXITSTATUS(status);
        if (WIFSIGNALED(status)) r.signal = WTERMSIG(status);
        r.output = read_text(out_);
        r.errors = read_text(err_);
        return r;
    }

private:
    /// Whether a set of signals in /proc/PID/status has this one.
    bool has_signal(const std::string& set, int signal) const {
        const std::string status = read_text("/proc/" + std::to_string(pid_) + "/status");
        const size_t at = status.find(set);
        return at != std::string::npos &&
               (std::stoull(status.substr(at + set.size(), 16), nullptr, 16) >> (signal - 1) & 1);
    }

    pid_t pid_;
    std::filesystem::path out_, err_;
};

/// A folder that is deleted with the object.
class TemporaryFolder {
public:
    TemporaryFolder() {
        std::string name =
            (std::filesystem::temp_directory_path() / "etendue-test-XXXXXX").string();
        path_ = mkdtemp(name.data());
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

}  // namespace etendue::test
