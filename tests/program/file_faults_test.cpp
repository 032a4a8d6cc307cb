// Files that cannot be written, or become durable, or only slowly: checkpoints and images.

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>

#include "checkpoint_test.h"
#include "wait_for.h"

namespace etendue::test {
namespace {

class FileFaults : public CheckpointTest {
protected:
    /// In the test's folder, with a preloaded library: see io_faults.cpp for the variables.
    Program start_with(const std::string& variables, const Arguments& arguments) const {
        Arguments shell = {
            "-c",
            fmt::format("cd '{}'; LD_PRELOAD='{}' ETENDUE_FAULT_MARK='{}' {} exec \"$0\" \"$@\"",
                        folder.path().string(), ETENDUE_IO_FAULTS, path("mark"), variables),
            ETENDUE_PROGRAM};
        shell.insert(shell.end(), arguments.begin(), arguments.end());
        return Program("/bin/bash", shell, folder.path());
    }
    /// Whether the fault has happened; forgets it.
    bool was_faulty() const { return fs::remove(path("mark")); }
    int hidden_files(const std::string& of) const {
        int count = 0;
        for (const auto& e : fs::directory_iterator(path(of)))
            count += e.path().filename().string().starts_with(".");
        return count;
    }
};

TEST_F(FileFaults, AFullDiskLeavesTheOldCheckpointAndTheRenderingGoesOn) {
    const std::string a = path("a.etd");
    expect_run(render("a.exr", {"-i", "bdpt", "--spp", "1", "--checkpoint", a}));
    const std::string before = read_text(a);
    Arguments all = {"-c", "ulimit -f 40; exec \"$0\" \"$@\"", ETENDUE_PROGRAM};
    const Arguments more =
        render("a.pfm", {"-i", "bdpt", "--spp", "6", "--resume", a, "--checkpoint-every", "1e-6"});
    all.insert(all.end(), more.begin(), more.end());
    const ProgramResult r = Program("/bin/bash", all, folder.path()).wait();
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("warning: cannot write \"" + a), std::string::npos) << r.errors;
    EXPECT_EQ(read_text(a), before);
    EXPECT_EQ(pixels("a.pfm").size(), 48u * 36 * 3);
}

/// Where a system call fails, or the machine does: the file is the old one or the new one.
TEST_F(FileFaults, ACheckpointIsWholeWhateverCallFails) {
    const auto arguments = [&](const std::string& name, const std::string& spp) {
        return render(name + ".exr",
                      {"-i", "path", "--spp", spp, "--checkpoint", path("faulty/" + name + ".etd"),
                       "--checkpoint-every", "0", "--resume", "auto"});
    };
    expect_run(arguments("one", "1"));
    expect_run(arguments("whole", "3"));
    const std::string expected = bits("faulty/whole.etd");
    for (const char* fault : {"fail", "kill"}) {
        int n = 0, old_ones = 0, images = 0;
        for (bool is_reached = true; is_reached;) {
            SCOPED_TRACE(fmt::format("{}:{}", fault, ++n));
            ASSERT_LT(n, 100);
            fs::copy_file(path("faulty/one.etd"), path("faulty/a.etd"),
                          fs::copy_options::overwrite_existing);
            fs::remove(path("a.exr"));
            const ProgramResult r =
                start_with(fmt::format("ETENDUE_FAULT={}:{}", fault, n), arguments("a", "3"))
                    .wait();
            const uint64_t passes = info("faulty/a.etd")["spp"];
            EXPECT_TRUE(passes == 1 || passes == 3) << passes;
            old_ones += passes == 1;
            is_reached = was_faulty();
            if (r.signal != SIGKILL) {
                EXPECT_EQ(r.status, passes == 3 ? 0 : 1) << r.errors;
                const bool is_told =
                    r.errors.find("cannot write \"" + path("faulty/a.etd")) != std::string::npos;
                EXPECT_EQ(is_told, r.status == 1) << r.errors;
            }
            if (fs::exists(path("a.exr"))) {
                EXPECT_EQ(pixels("a.exr"), pixels("whole.exr"));
                ++images;
            }
            expect_run(arguments("a", "3"));
            EXPECT_EQ(bits("faulty/a.etd"), expected);
        }
        EXPECT_GT(old_ones, 8);
        // All but that where the file cannot be made, which is found before the first pass.
        if (std::string(fault) == "fail") {
            EXPECT_EQ(images, n - 1);
        }
    }
}

/// Servers of files may say only in the end that there is no room.
TEST_F(FileFaults, AFileThatCannotBeClosedOrMovedInIsNotTaken) {
    const auto arguments = [&](const char* spp) {
        return render("a.exr", {"-i", "path", "--spp", spp, "--checkpoint", path("faulty/a.etd"),
                                "--checkpoint-every", "0", "--resume", "auto"});
    };
    expect_run(arguments("1"));
    const std::string before = read_text(path("faulty/a.etd"));
    // The first file that is closed is that of the check before the first pass.
    for (const auto& [variables, why] :
         {std::pair{"ETENDUE_FAULT=fail:2 ETENDUE_FAULT_CALL=close", "Disk quota exceeded"},
          std::pair{"ETENDUE_FAULT=fail:1 ETENDUE_FAULT_CALL=lseek", "No space left on device"}}) {
        SCOPED_TRACE(variables);
        const ProgramResult r = start_with(variables, arguments("3")).wait();
        EXPECT_TRUE(was_faulty());
        EXPECT_EQ(r.status, 1);
        EXPECT_NE(r.errors.find(why), std::string::npos) << r.errors;
        EXPECT_TRUE(read_text(path("faulty/a.etd")) == before);
        EXPECT_EQ(hidden_files("faulty"), 0);
    }
}

/// The disk has room again a moment later.
TEST_F(FileFaults, AfterAFailureTheNextCheckpointIsTriedInTime) {
    // So many passes that there are several checkpoints, however long the first one takes.
    const Arguments how = {"-i",   "path",        "--spp", "60", "--checkpoint-every",
                           "1e-6", "--checkpoint"};
    Arguments whole = how, faulty = how;
    fs::create_directory(path("faulty"));
    whole.push_back(path("whole.etd"));
    faulty.push_back(path("faulty/a.etd"));
    expect_run(render("whole.exr", whole));
    int warned = 0;
    // The first two calls are those of the check before the first pass; the next ones belong to the first checkpoint.
    for (int n = 3; n <= 6; ++n) {
        SCOPED_TRACE(n);
        fs::remove(path("faulty/a.etd"));
        const ProgramResult r =
            start_with(fmt::format("ETENDUE_FAULT=fail:{}", n), render("a.exr", faulty)).wait();
        EXPECT_EQ(r.status, 0) << r.errors;
        warned += r.errors.find("warning: cannot write") != std::string::npos;
        EXPECT_EQ(bits("faulty/a.etd"), bits("whole.etd"));
        EXPECT_EQ(pixels("a.exr"), pixels("whole.exr"));
    }
    EXPECT_EQ(warned, 4);
}

/// A checkpoint becomes durable in a thread of its own, or at once.
TEST_F(FileFaults, ACheckpointIsWrittenWhereThereIsNoFurtherThread) {
    const auto arguments = [&](const std::string& name) {
        return render(name + ".exr",
                      {"-i", "path", "--spp", "6", "--checkpoint", path(name + ".etd"),
                       "--checkpoint-every", "1e-6", "--stats", path("stats.json")});
    };
    expect_run(arguments("whole"));
    for (const std::string lack : {"1", "memory"}) {
        SCOPED_TRACE(lack);
        fs::remove(path("a.etd"));
        const ProgramResult r = start_with("ETENDUE_NO_THREADS=" + lack, arguments("a")).wait();
        EXPECT_TRUE(was_faulty());
        EXPECT_EQ(r.status, 0);
        EXPECT_EQ(r.errors, "");
        EXPECT_EQ(bits("a.etd"), bits("whole.etd"));
        const auto report = nlohmann::json::parse(read_text(path("stats.json")));
        EXPECT_GT(report["checkpoints"]["written"], 0);
    }
}

/// The next checkpoint would need the room that it takes.
TEST_F(FileFaults, AFileThatDoesNotBecomeDurableIsRemovedAtOnce) {
    fs::create_directory(path("faulty"));
    const Program program =
        start_with("ETENDUE_FAULT=fail:1 ETENDUE_FAULT_CALL=fsync",
                   render("a.exr", {"-i", "path", "--time", "600", "--checkpoint",
                                    path("faulty/a.etd"), "--checkpoint-every", "4"}));
    wait_for_file("mark");
    ASSERT_TRUE(was_faulty());
    const auto begin = Clock::now();
    while (hidden_files("faulty") > 0 && seconds_since(begin) < 3) wait(0.01);
    EXPECT_EQ(hidden_files("faulty"), 0);
    EXPECT_FALSE(fs::exists(path("faulty/a.etd")));
    program.interrupt();
    const ProgramResult r = program.wait();
    EXPECT_EQ(r.status, 0);
    EXPECT_NE(r.errors.find("warning: cannot write"), std::string::npos) << r.errors;
    EXPECT_GT(info("faulty/a.etd")["spp"], 0);
}

TEST_F(FileFaults, ASlowCheckpointTakesAHundredthOfTheTimeUnlessItsIntervalIsGiven) {
    fs::create_directory(path("faulty"));
    // How many files were written beside the passes, and not at the end.
    const auto written = [&](const std::string& what, const std::string& variables,
                             const Arguments& more) {
        Arguments all = {"-i", "path", "--threads", "1", "--stats", path("stats.json")};
        all.insert(all.end(), more.begin(), more.end());
        const std::string image = what == "images" ? "faulty/a.pfm" : "a.exr";
        const ProgramResult r = start_with(variables, render(image, all)).wait();
        EXPECT_EQ(r.status, 0) << r.errors;
        fs::remove(path("faulty/a.etd"));
        return nlohmann::json::parse(read_text(path("stats.json")))[what]["written"].get<int>();
    };
    // The clock runs a hundred times as fast, and each file takes several of its seconds. The first one comes after a minute,
    // and perhaps a second and a third.
    const std::string slow = "ETENDUE_CLOCK=100 ETENDUE_SLOW_WRITE=20", file = path("faulty/a.etd");
    const int by_default = written("checkpoints", slow, {"--time", "600", "--checkpoint", file});
    EXPECT_GE(by_default, 1);
    EXPECT_LE(by_default, 3);
    EXPECT_GT(written("checkpoints", slow,
                      {"--time", "600", "--checkpoint", file, "--checkpoint-every", "6"}),
              by_default);
    // Each file takes 50 s of its clock or more, a hundredth of more than the whole time. Checkpoints come every 15 minutes
    // nevertheless, but images do not.
    const std::string slower = "ETENDUE_CLOCK=1000 ETENDUE_SLOW_WRITE=50";
    EXPECT_GE(written("checkpoints", slower, {"--time", "4000", "--checkpoint", file}), 2);
    EXPECT_EQ(written("images", slower, {"--time", "4000"}), 1);
}

/// A file of a run that takes long postpones the next one by a quarter of an hour, and not by a hundred times as long.
TEST_F(FileFaults, ASlowFileOfTheStudioIsFollowedByAnother) {
    fs::create_directory(path("faulty"));
    // The clock runs a thousand times as fast, and each file takes more than a hundred of its seconds.
    const Program program =
        start_with("ETENDUE_CLOCK=1000 ETENDUE_SLOW_WRITE=100",
                   {"studio", scene, "-i", "path", "--resolution", "16x12", "--threads", "1", "-o",
                    folder.path().string(), "--runs", path("faulty")});
    const auto kept = [&] { return read_text(path("faulty/cornell-path-1.etd")); };
    EXPECT_TRUE(wait_for([&] { return !kept().empty(); })) << program.errors();
    const std::string first = kept();
    const auto begin = Clock::now();
    EXPECT_TRUE(wait_for([&] { return kept() != first; })) << program.errors();
    EXPECT_LT(seconds_since(begin), 7);  // A second; without the limit, more than ten.
    program.interrupt();
    EXPECT_EQ(program.wait().status, 0);
}

/// Whatever fails, the image is the old one or the new one, and the new one is somewhere.
TEST_F(FileFaults, AnImageIsWholeWhateverCallFails) {
    const std::string image = path("faulty/a.pfm");
    const auto arguments = [&](const char* spp) {
        return Arguments{"render", scene, "-o",   image,   "--quiet", "--resolution",
                         "48x36",  "-i",  "path", "--spp", spp,       "--write-every",
                         "0"};
    };
    expect_run(arguments("2"));
    const std::string expected = read_text(image);
    expect_run(arguments("1"));
    const std::string old = read_text(image);
    ASSERT_NE(old, expected);
    for (const char* fault : {"fail", "kill"}) {
        int n = 0, elsewhere = 0;
        for (bool is_reached = true; is_reached;) {
            SCOPED_TRACE(fmt::format("{}:{}", fault, ++n));
            ASSERT_LT(n, 100);
            std::ofstream(image, std::ios::binary) << old;
            const ProgramResult r =
                start_with(fmt::format("ETENDUE_FAULT={}:{}", fault, n), arguments("2")).wait();
            is_reached = was_faulty();
            // The folder may fail to become durable, when the new file is there already.
            const std::string left = read_text(image);
            EXPECT_TRUE(left == old || left == expected);
            if (r.status == 0) {
                EXPECT_EQ(left, expected);
            }
            if (r.signal == SIGKILL) continue;
            const std::string mark = "; the image is in ";
            const size_t at = r.errors.find(mark);
            if (at == std::string::npos) continue;
            const std::string file =
                r.errors.substr(at + mark.size(), r.errors.find('\n') - at - mark.size());
            EXPECT_EQ(read_text(file), expected) << r.errors;
            fs::remove(file);
            ++elsewhere;
        }
        EXPECT_GT(n, 4);
        if (std::string(fault) == "fail") {
            EXPECT_GE(elsewhere, 3);
        }
    }
}

}  // namespace
}  // namespace etendue::test
