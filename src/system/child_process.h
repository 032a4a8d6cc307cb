#pragma once
// Programs that this one runs and waits for.

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

namespace etendue {

/// Keeps signals that end the program from this thread while it lives, so that what they would leave behind is removed
/// first: run_child() ends early for them, and they arrive when the object is destroyed.
class HeldSignals {
public:
    HeldSignals();
    ~HeldSignals();
    HeldSignals(const HeldSignals&) = delete;
    HeldSignals& operator=(const HeldSignals&) = delete;
    /// Whether one of them has arrived.
    static bool has_one();
    /// For handlers, which run in threads that do not hold the signal: sends it to the thread that does. False if there is
    /// none.
    static bool pass_on(int signal) noexcept;

private:
    sigset_t before_;
    bool is_first_ =
        false;  ///< Of those that live at the same time; its thread receives what is passed on.
};

/// A new folder of this user alone among the temporary files of the system, which is deleted with the object.
class TemporaryFolder {
public:
    /// Throws std::runtime_error where it cannot be made.
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

/// The file of the program `name` that a shell would run; empty if there is none.
std::string find_program(const std::string& name);

/// Runs the program of the file words[0] with the other words as its arguments, and waits for its end. It reads nothing,
/// what it prints goes to the file `log`, and it ends with this process. Returns its exit status, or 128 plus the signal
/// that ended it. Throws std::runtime_error where it cannot be started, and where a signal that is held ended the wait.
int run_child(std::vector<std::string> words, const std::string& log);

}  // namespace etendue
