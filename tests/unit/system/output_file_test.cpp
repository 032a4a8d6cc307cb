// Output files: complete or not there, whatever fails; devices, pipes and links.

#include "system/output_file.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "error_of.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

std::string text_of(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

class OutputFiles : public testing::Test {
protected:
    std::string file(const std::string& name) const { return (folder_ / name).string(); }
    void put(const std::string& name, const std::string& text) const {
        std::ofstream(file(name)) << text;
    }
    mode_t mode(const std::string& name) const {
        struct stat s;
        EXPECT_EQ(::stat(file(name).c_str(), &s), 0);
        return s.st_mode & 07777;
    }
    /// The names in the folder, sorted.
    std::vector<std::string> names() const {
        std::vector<std::string> all;
        for (const auto& entry : fs::directory_iterator(folder_))
            all.push_back(entry.path().filename().string());
        std::sort(all.begin(), all.end());
        return all;
    }
    using Names = std::vector<std::string>;

    const TemporaryFolder temporary_;
    const fs::path folder_ = temporary_.path();
};

TEST_F(OutputFiles, AppearWhenTheyAreComplete) {
    put("a", "old");
    {
        OutputFile out(file("a"));
        out.write("new");
        EXPECT_EQ(text_of(file("a")), "old");
        out.commit();
        EXPECT_EQ(text_of(file("a")), "new");
    }
    EXPECT_EQ(names(), Names{"a"});
    EXPECT_EQ(text_of(file("a")), "new");
    {
        OutputFile out(file("a"));
        out.write("abandoned");
        EXPECT_EQ(names().size(), 2u);
    }
    EXPECT_EQ(text_of(file("a")), "new");
    EXPECT_EQ(names(), Names{"a"});
}

TEST_F(OutputFiles, AreWrittenAtAnyPosition) {
    for (const std::string& name : {file("a"), std::string("/dev/null")}) {
        OutputFile out(name);
        out.write("....end");
        EXPECT_EQ(out.position(), 7u);
        out.seek(1);
        out.write("xy");
        EXPECT_EQ(out.position(), 3u);
        out.seek(9);
        out.write("z");
        out.commit();
    }
    EXPECT_EQ(text_of(file("a")), std::string(".xy.end\0\0z", 10));
}

TEST_F(OutputFiles, TwoWithOneNameDoNotMix) {
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            for (int i = 0; i < 20; ++i) write_file(file("a"), std::string(50000, char('a' + t)));
        });
    for (std::thread& t : threads) t.join();
    const std::string text = text_of(file("a"));
    EXPECT_EQ(text, std::string(50000, text[0]));
    EXPECT_EQ(names(), Names{"a"});
}

TEST_F(OutputFiles, KeepPermissionsOfTheOldOne) {
    put("a", "old");
    fs::permissions(file("a"), fs::perms(0640));
    write_file(file("a"), "new");
    EXPECT_EQ(mode("a"), 0640u);
    const mode_t mask = ::umask(027);
    write_file(file("b"), "new");
    ::umask(mask);
    EXPECT_EQ(mode("b"), 0640u);
    const mode_t open = ::umask(0);
    write_file(file("c"), "new");
    ::umask(open);
    EXPECT_EQ(mode("c"), 0666u);
}

TEST_F(OutputFiles, DevicesStayDevices) {
    write_file("/dev/null", "text");
    OutputFile::check("/dev/null");
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
    const std::string message = error_of([] { write_file("/dev/full", "text"); });
    EXPECT_NE(message.find("cannot write \"/dev/full\": No space left"), std::string::npos)
        << message;
    EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(OutputFiles, NamedPipesAreWrittenOnce) {
    ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
    OutputFile::check(file("pipe"));  // opens nothing, so that it does not wait for a reader
    std::string read;
    std::thread reader([&] { read = text_of(file("pipe")); });
    {
        OutputFile out(file("pipe"));
        out.write("ab");
        out.seek(0);
        out.write("c");
        out.commit();
    }
    reader.join();
    EXPECT_EQ(read, "cb");
    EXPECT_EQ(names(), Names{"pipe"});
}

TEST_F(OutputFiles, OpenDescriptorsAreWrittenAtTheirPosition) {
    const int out = ::open(file("a").c_str(), O_WRONLY | O_CREAT, 0600);
    ASSERT_EQ(::write(out, "before ", 7), 7);
    write_file("/proc/self/fd/" + std::to_string(out), "text ");
    write_file("/dev/fd/" + std::to_string(out), "more ");
    // As /dev/stdout: a link to such a name.
    fs::create_symlink("/proc/self/fd/" + std::to_string(out), file("link"));
    write_file(file("link"), "link ");
    ASSERT_EQ(::write(out, "after", 5), 5);
    ::close(out);
    EXPECT_EQ(text_of(file("a")), "before text more link after");
    EXPECT_EQ(names(), (Names{"a", "link"}));
}

TEST_F(OutputFiles, LinksAreWrittenThroughOrReplaced) {
    fs::create_directories(folder_ / "there");
    put("there/target", "old");
    fs::create_symlink("there/target", file("near"));
    fs::create_symlink("near", file("far"));
    fs::create_symlink("there/new", file("dangling"));
    write_file(file("far"), "new");
    EXPECT_EQ(text_of(file("there/target")), "new");
    write_file(file("dangling"), "made");
    EXPECT_EQ(text_of(file("there/new")), "made");
    for (const char* link : {"near", "far", "dangling"}) EXPECT_TRUE(fs::is_symlink(file(link)));

    write_file(file("far"), "own", Links::Replace);
    EXPECT_FALSE(fs::is_symlink(file("far")));
    EXPECT_EQ(text_of(file("far")), "own");
    EXPECT_EQ(text_of(file("there/target")), "new");
    fs::create_symlink("/dev/null", file("null"));
    write_file(file("null"), "own", Links::Replace);
    EXPECT_EQ(text_of(file("null")), "own");

    fs::create_symlink("loop", file("loop"));
    EXPECT_NE(error_of([&] { write_file(file("loop"), "x"); }).find("loop\": Too many"),
              std::string::npos);
}

TEST_F(OutputFiles, AreOneFileIfOneReplacesTheOther) {
    fs::create_directories(folder_ / "there");
    put("a", "old");
    fs::create_symlink("a", file("link"));
    fs::create_symlink("there/new", file("dangling"));
    fs::create_symlink("there", file("folder"));
    fs::create_symlink("loop", file("loop"));
    fs::create_hard_link(file("a"), file("hard"));
    ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
    const int descriptor = ::open(file("a").c_str(), O_WRONLY);
    const std::string open = "/proc/self/fd/" + std::to_string(descriptor);
    for (const auto& [one, other] :
         {std::pair{file("a"), file("a")},
          {file("a"), file("./there/../a")},
          {file("a"), file("link")},
          {file("new"), file("./new")},
          {file("dangling"), file("folder/new")},
          {file("dangling"), file("there/new")},
          {file("missing/new"), file("missing/./new")},
          // What is written to the old file is lost when the new one replaces it.
          {file("a"), open}}) {
        EXPECT_TRUE(are_one_file(one, other)) << one << ", " << other;
        EXPECT_TRUE(are_one_file(other, one)) << one << ", " << other;
    }
    for (const auto& [one, other] : {std::pair{file("a"), file("b")},
                                     {file("a"), file("there/a")},
                                     {file("dangling"), file("new")},
                                     {file("loop"), file("a")},
                                     // The other name keeps the old file.
                                     {file("a"), file("hard")},
                                     // These are written one after the other.
                                     {open, open},
                                     {open, "/dev/fd/" + std::to_string(descriptor)},
                                     {file("pipe"), file("pipe")},
                                     {"/dev/null", "/dev/null"},
                                     {"/dev/null", file("a")},
                                     {"/dev/stdout", "/dev/stdout"},
                                     {"/dev/stdout", file("a")}}) {
        EXPECT_FALSE(are_one_file(one, other)) << one << ", " << other;
        EXPECT_FALSE(are_one_file(other, one)) << one << ", " << other;
    }
    ::close(descriptor);
}

TEST_F(OutputFiles, FullDisksDamageNothing) {
    put("a", "old");
    // A limit on the size of files stands for a disk that is full.
    rlimit limit;
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &limit), 0);
    const rlimit small = {4096, limit.rlim_max};
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const std::string message = error_of([&] {
        OutputFile out(file("a"));
        EXPECT_FALSE(out.write(std::string(10000, 'x')));
        EXPECT_FALSE(out.write("more"));
        EXPECT_FALSE(out.is_good());
        out.commit();
    });
    setrlimit(RLIMIT_FSIZE, &limit);
    std::signal(SIGXFSZ, handler);
    EXPECT_EQ(message, "cannot write \"" + file("a") + "\": File too large");
    EXPECT_EQ(text_of(file("a")), "old");
    EXPECT_EQ(names(), Names{"a"});
}

TEST_F(OutputFiles, ReasonsAreSaid) {
    fs::create_directories(folder_ / "folder");
    put("plain", "");
    for (const auto& [name, why] : std::vector<std::pair<std::string, std::string>>{
             {file("folder"), "there is a folder of that name"},
             {file("folder/"), "folder"},
             {file("new/"), "the name is that of a folder"},
             {file("new/."), "the name is that of a folder"},
             {file("new/.."), "the name is that of a folder"},
             {file("plain/a"), "Not a directory"},
             {"/proc/a", "No such file"},
             {"", "the name is empty"},
             {file(std::string(300, 'x')), "File name too long"}}) {
        for (const bool check : {false, true}) {
            const std::string message = error_of(
                [&, name = name] { check ? OutputFile::check(name) : write_file(name, "x"); });
            EXPECT_TRUE(message.starts_with("cannot write \"" + name + "\": ")) << message;
            EXPECT_NE(message.find(why), std::string::npos) << message;
        }
    }
    // The longest name that a folder may hold.
    write_file(file(std::string(255, 'x')), "text");
    EXPECT_EQ(names(), (Names{"folder", "plain", std::string(255, 'x')}));
}

/// Runs `body` in a process of its own, without the rights of root. Its result is the exit status.
int in_child(bool as_nobody, const std::function<int()>& body) {
    const pid_t child = ::fork();
    if (child == 0) {
        if (as_nobody && ::geteuid() == 0 && (::setegid(65534) != 0 || ::seteuid(65534) != 0))
            ::_exit(99);
        ::_exit(body());
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

TEST_F(OutputFiles, ProtectedFoldersAndFilesStay) {
    fs::create_directories(folder_ / "folder");
    put("folder/a", "old");
    put("protected", "old");
    fs::permissions(folder_, fs::perms(0777));
    fs::permissions(folder_ / "folder", fs::perms(0555));
    fs::permissions(folder_ / "folder/a", fs::perms(0666));
    fs::permissions(file("protected"), fs::perms(0444));
    EXPECT_EQ(in_child(true,
                       [&] {
                           const std::string a =
                               error_of([&] { write_file(file("folder/a"), "x"); });
                           if (a.find("in its folder: Permission denied") == a.npos) return 1;
                           const std::string b =
                               error_of([&] { OutputFile::check(file("protected")); });
                           if (b.find("Permission denied") == b.npos) return 2;
                           return 0;
                       }),
              0);
    EXPECT_EQ(text_of(file("folder/a")), "old");
    EXPECT_EQ(text_of(file("protected")), "old");
    fs::permissions(folder_ / "folder", fs::perms(0755));
}

/// In a folder such as /tmp, files of others can be written but not replaced.
TEST_F(OutputFiles, FilesThatCannotBeReplacedAreOverwritten) {
    put("a", "a longer text");
    fs::permissions(folder_, fs::perms(01777));
    fs::permissions(file("a"), fs::perms(0666));
    struct stat before, after;
    ASSERT_EQ(::stat(file("a").c_str(), &before), 0);
    EXPECT_EQ(
        in_child(true,
                 [&] { return int(!error_of([&] { write_file(file("a"), "new"); }).empty()); }),
        0);
    ASSERT_EQ(::stat(file("a").c_str(), &after), 0);
    EXPECT_EQ(text_of(file("a")), "new");
    EXPECT_EQ(before.st_uid, after.st_uid);
    EXPECT_EQ(names(), Names{"a"});
    // The temporary file has what does not fit.
    EXPECT_EQ(in_child(true,
                       [&] {
                           const std::string text(10000, 'x');
                           OutputFile out(file("a"));
                           out.write(text);
                           std::signal(SIGXFSZ, SIG_IGN);
                           const rlimit small = {4096, 4096};
                           if (setrlimit(RLIMIT_FSIZE, &small) != 0) return 1;
                           const std::string why = error_of([&] { out.commit(); });
                           if (::geteuid() != before.st_uid) {
                               if (why.find("File too large; its contents are in") == why.npos)
                                   return 2;
                               const size_t at = why.find(folder_.string() + "/.etendue-");
                               if (text_of(why.substr(at, why.rfind('"') - at)) != text) return 3;
                           }
                           return 0;
                       }),
              0);
}

/// The temporary file is then the only complete copy.
TEST_F(OutputFiles, AnInterruptWhileAFileIsOverwrittenKeepsItsContents) {
    if (::geteuid() != 0) GTEST_SKIP() << "only root can have files of several users";
    put("a", "old");
    fs::permissions(folder_, fs::perms(01777));
    fs::permissions(file("a"), fs::perms(0666));
    const std::string text(10000, 'x');
    EXPECT_EQ(in_child(true,
                       [&] {
                           OutputFile out(file("a"));
                           out.write(text);
                           // The signal comes when a part of the file is overwritten.
                           std::signal(SIGXFSZ, [](int) {
                               remove_temporary_files();
                               ::_exit(7);
                           });
                           const rlimit small = {4096, 4096};
                           if (setrlimit(RLIMIT_FSIZE, &small) != 0) return 1;
                           out.commit();
                           return 0;
                       }),
              7);
    EXPECT_EQ(text_of(file("a")), text.substr(0, 4096));
    const Names left = names();
    ASSERT_EQ(left.size(), 2u);
    EXPECT_EQ(text_of(file(left[0])), text);
}

/// A file of another owner or group, which only root can give to them.
TEST_F(OutputFiles, RightsOfAGroupAreNotGivenToAnother) {
    put("a", "old");
    fs::permissions(folder_, fs::perms(0777));
    fs::permissions(file("a"), fs::perms(06676));
    EXPECT_EQ(
        in_child(true,
                 [&] { return int(!error_of([&] { write_file(file("a"), "new"); }).empty()); }),
        0);
    EXPECT_EQ(text_of(file("a")), "new");
    EXPECT_EQ(mode("a"), ::geteuid() == 0 ? 0666u : 06676u);
}

TEST_F(OutputFiles, PipesThatDoNotWaitAreWrittenWhole) {
    int ends[2];
    ASSERT_EQ(::pipe2(ends, O_NONBLOCK | O_CLOEXEC), 0);
    std::string read;
    std::thread reader([&] {
        char buffer[4096];
        for (ssize_t n; (n = ::read(ends[0], buffer, sizeof buffer)) != 0;) {
            if (n > 0)
                read.append(buffer, size_t(n));
            else
                std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    });
    const std::string text(1 << 20, 'x');
    EXPECT_EQ(error_of([&] { write_file("/proc/self/fd/" + std::to_string(ends[1]), text); }), "");
    ::close(ends[1]);
    reader.join();
    ::close(ends[0]);
    EXPECT_EQ(read.size(), text.size());
}

TEST_F(OutputFiles, KilledWritersDoNoHarm) {
    put("a", "old");
    EXPECT_EQ(in_child(false,
                       [&] {
                           OutputFile out(file("a"));
                           out.write("half");
                           ::raise(SIGKILL);
                           return 0;
                       }),
              1000 + SIGKILL);
    EXPECT_EQ(text_of(file("a")), "old");
    EXPECT_EQ(names().size(), 2u);
    write_file(file("a"), "new");
    EXPECT_EQ(text_of(file("a")), "new");
}

TEST_F(OutputFiles, HandlersOfSignalsRemoveTemporaryFiles) {
    put("a", "old");
    EXPECT_EQ(in_child(false,
                       [&] {
                           OutputFile one(file("a")), two(file("b"));
                           one.write("half");
                           std::signal(SIGTERM, [](int) {
                               remove_temporary_files();
                               ::_exit(7);
                           });
                           ::raise(SIGTERM);
                           return 0;
                       }),
              7);
    EXPECT_EQ(names(), Names{"a"});
    EXPECT_EQ(text_of(file("a")), "old");
    // Nothing is left in the table: more files than it has places.
    for (int i = 0; i < 100; ++i) write_file(file("a"), "new");
    const OutputFile open(file("c"));
    EXPECT_EQ(names().size(), 2u);
    remove_temporary_files();
    EXPECT_EQ(names(), Names{"a"});
}

TEST_F(OutputFiles, TemporaryNamesCannotBePredicted) {
    Names seen;
    for (int i = 0; i < 3; ++i) {
        const OutputFile out(file("a"));
        ASSERT_EQ(names().size(), 1u);
        const std::string name = names()[0];
        EXPECT_TRUE(name.starts_with(".")) << "hidden";
        EXPECT_EQ(std::count(seen.begin(), seen.end(), name), 0);
        seen.push_back(name);
    }
}

}  // namespace
}  // namespace etendue::test
