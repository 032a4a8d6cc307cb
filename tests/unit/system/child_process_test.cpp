#include "system/child_process.h"

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

#include "system/file_state.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

TEST(ChildProcess, HasItsArgumentsAndStatus) {
    const TemporaryFolder folder;
    const std::string log = folder.path() / "log", shell = find_program("sh");
    const std::string strange = "a b'\"$HOME;\n*";
    EXPECT_EQ(
        run_child({shell, "-c", "printf %s \"$1\"; read x; echo $x >&2; exit 3", "x", strange},
                  log),
        3);
    EXPECT_EQ(text_of(log), strange + "\n");
    EXPECT_EQ(run_child({shell, "-c", "kill -9 $$"}, log), 128 + 9);
    EXPECT_THROW(run_child({folder.path() / "none"}, log), std::runtime_error);
    EXPECT_EQ(find_program("a program that is not there"), "");
}

/// The log would have the number of the closed stream.
TEST(ChildProcess, KeepsItsLogWhereStandardInputIsClosed) {
    const TemporaryFolder folder;
    const std::string log = folder.path() / "log", shell = find_program("sh");
    const int kept = ::dup(STDIN_FILENO);
    ::close(STDIN_FILENO);
    const int status = run_child({shell, "-c", "echo one; echo two >&2"}, log);
    if (kept >= 0) {
        ::dup2(kept, STDIN_FILENO);
        ::close(kept);
    }
    EXPECT_EQ(status, 0);
    EXPECT_EQ(text_of(log), "one\ntwo\n");
}

TEST(ChildProcess, EndsWithASignalThatIsHeld) {
    const TemporaryFolder folder;
    const auto old = std::signal(SIGTERM, SIG_IGN);
    static volatile std::sig_atomic_t arrived = 0;
    std::signal(SIGTERM, [](int) { arrived = 1; });
    {
        const HeldSignals held;
        const pthread_t self = pthread_self();
        std::thread sends([&] {
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
            pthread_kill(self, SIGTERM);
        });
        EXPECT_THROW(run_child({find_program("sleep"), "60"}, folder.path() / "log"),
                     std::runtime_error);
        sends.join();
        EXPECT_TRUE(HeldSignals::has_one());
        EXPECT_EQ(arrived, 0);
    }
    EXPECT_EQ(arrived, 1);
    std::signal(SIGTERM, old);
}

void count_child(int) {}

TEST(ChildProcess, LeavesTheHandlerOfItsHost) {
    const TemporaryFolder folder;
    const auto old = std::signal(SIGCHLD, count_child);
    EXPECT_EQ(run_child({find_program("true")}, folder.path() / "log"), 0);
    EXPECT_EQ(std::signal(SIGCHLD, SIG_IGN), count_child);
    EXPECT_EQ(run_child({find_program("false")}, folder.path() / "log"), 1);
    std::signal(SIGCHLD, old);
}

// As in a program whose other threads do not hold it.
TEST(ChildProcess, EndsWithASignalThatAnotherThreadPassesOn) {
    const TemporaryFolder folder;
    static std::atomic<int> arrived{0};
    const auto old = std::signal(SIGTERM, [](int signal) {
        if (!HeldSignals::pass_on(signal)) ++arrived;
    });
    std::raise(SIGTERM);
    EXPECT_EQ(arrived, 1);
    std::atomic<bool> has_begun{false}, has_passed{false};
    std::thread other([&] {
        while (!has_begun) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        std::raise(SIGTERM);
        EXPECT_EQ(arrived, 1);
        has_passed = true;
    });
    {
        const HeldSignals held;
        has_begun = true;
        EXPECT_THROW(run_child({find_program("sleep"), "60"}, folder.path() / "log"),
                     std::runtime_error);
        while (!has_passed) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        EXPECT_EQ(arrived, 1);
    }
    EXPECT_EQ(arrived, 2);
    other.join();
    std::signal(SIGTERM, old);
}

TEST(TemporaryFolder, IsDeletedWithItsFiles) {
    fs::path path;
    {
        const TemporaryFolder folder;
        path = folder.path();
        fs::create_directory(path / "inner");
        std::ofstream(path / "inner/file") << "text";
    }
    EXPECT_FALSE(fs::exists(path));
}

TEST(FileState, TellsFilesThatHaveChanged) {
    const TemporaryFolder folder;
    const std::string file = folder.path() / "file";
    EXPECT_FALSE(file_state(file).is_settled);
    std::ofstream(file) << "one";
    const FileState fresh = file_state(file);
    EXPECT_FALSE(fresh.is_settled);
    EXPECT_FALSE(file_state(file).has_kept(fresh));  // it may be written again at the same time
    FileState settled = fresh;
    settled.is_settled = true;
    EXPECT_TRUE(file_state(file).has_kept(settled));
    std::ofstream(file) << "three";
    EXPECT_FALSE(file_state(file).has_kept(settled));
}

}  // namespace
}  // namespace etendue
