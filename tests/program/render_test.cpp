// Failures of `render`: files that cannot be written, passes that fail, interrupts.

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

class RenderTest : public ::testing::Test {
protected:
    RenderTest() { std::ofstream(image) << kEarlier; }

    Program start(const std::vector<std::string>& arguments) const {
        std::vector<std::string> all = {"render", scene,     "-o",           image,  "--stats",
                                        stats,    "--quiet", "--resolution", "16x16"};
        for (const std::string& a : arguments) {
            // Options must not be repeated, so the default is replaced.
            const auto given = std::find(all.begin(), all.end(), a);
            if (given != all.end() && a.starts_with("-"))
                all.erase(given, given + 1 + (a != "--quiet"));
        }
        all.insert(all.end(), arguments.begin(), arguments.end());
        return Program(ETENDUE_PROGRAM, all, folder.path());
    }
    ProgramResult run(const std::vector<std::string>& arguments) const {
        return start(arguments).wait();
    }
    nlohmann::json report() const { return nlohmann::json::parse(read_text(stats)); }
    bool has_earlier_image() const { return read_text(image) == kEarlier; }

    static constexpr const char* kEarlier = "an earlier picture";
    TemporaryFolder folder;
    std::string scene = fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml";
    std::string image = folder.path() / "image.exr", stats = folder.path() / "stats.json";
};

TEST_F(RenderTest, NoticesUnwritableFilesBeforeItRenders) {
    const std::string file = folder.path() / "file";
    std::ofstream(file) << "not a folder";
    fs::create_directory(folder.path() / "folder.json");
    for (const auto& [option, path] : std::vector<std::pair<std::string, std::string>>{
             {"-o", "/proc/a.exr"},
             {"-o", file + "/a.exr"},
             {"--stats", "/proc/a.json"},
             {"--stats", file + "/a.json"},
             {"--stats", folder.path() / "folder.json"},
             {"--techniques", "/proc/techniques"},
             {"--techniques", file}}) {
        SCOPED_TRACE(option + " " + path);
        const auto begin = Clock::now();
        const ProgramResult r = run({"--time", "5", option, path});
        EXPECT_LT(Clock::now() - begin, std::chrono::seconds(4));
        EXPECT_EQ(r.status, 1);
        EXPECT_NE(r.errors.find(path), std::string::npos) << r.errors;
        EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
        EXPECT_TRUE(has_earlier_image());
    }
}

TEST_F(RenderTest, LeavesNoTraceOfWhatItChecked) {
    ASSERT_EQ(run({"--spp", "1", "--techniques", folder.path() / "new/techniques"}).status, 0);
    for (const auto& entry : fs::recursive_directory_iterator(folder.path()))
        EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry.path();
    EXPECT_TRUE(report()["warnings"].empty());
}

TEST_F(RenderTest, RefusesCropsAndSizesThatCannotBe) {
    for (const auto& [arguments, message] :
         std::vector<std::pair<std::vector<std::string>, std::string>>{
             {{"--crop", "2147483647,0,1,1"}, "does not lie within"},
             {{"--crop", "0,2147483647,4,4"}, "does not lie within"},
             {{"--crop", "8,8,2147483647,2147483647"}, "does not lie within"},
             {{"--resolution", "65536x65536"}, "too large"},
             {{"--resolution", "65537x2"}, "--resolution"}}) {
        const ProgramResult r = run(arguments);
        EXPECT_EQ(r.signal, 0);
        EXPECT_EQ(r.status, 1);
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
        EXPECT_TRUE(has_earlier_image());
    }
}

TEST_F(RenderTest, RefusesMoreSamplesThanThereAreRandomNumbers) {
    const ProgramResult r = run({"--spp", "4294967297"});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("4294967297 samples per pixel are too many"), std::string::npos)
        << r.errors;
    EXPECT_TRUE(has_earlier_image());
}

/// A memory limit that pass 0 meets, but a later pass exceeds.
TEST_F(RenderTest, KeepsTheImageWhereALaterPassFails) {
    const auto vcm = [&](int light_paths, int spp, int seed) {
        std::ofstream(image) << kEarlier;
        return run({"-i", fmt::format("vcm:memory=1,light_paths={}", light_paths), "--spp",
                    std::to_string(spp), "--seed", std::to_string(seed), "--resolution", "32x16"});
    };
    int fits = 1, fails = 1 << 16;
    while (fails - fits > 1) {
        const int light_paths = (fits + fails) / 2;
        (vcm(light_paths, 1, 0).status == 0 ? fits : fails) = light_paths;
    }
    // A failure in the first pass: nothing is written.
    const ProgramResult first = vcm(fails, 4, 0);
    EXPECT_EQ(first.status, 1);
    EXPECT_TRUE(has_earlier_image());
    EXPECT_NE(first.errors.find("need more than 1 MiB"), std::string::npos) << first.errors;

    for (int seed = 0; seed < 20; ++seed) {
        const ProgramResult r = vcm(fits, 100, seed);
        if (r.status == 0 || has_earlier_image()) continue;
        EXPECT_EQ(r.status, 1);
        EXPECT_EQ(std::count(r.errors.begin(), r.errors.end(), '\n'), 1) << r.errors;
        EXPECT_NE(r.errors.find("need more than 1 MiB"), std::string::npos) << r.errors;
        EXPECT_NE(r.errors.find(image), std::string::npos) << r.errors;
        const nlohmann::json j = report();
        const int passes = j["spp"];
        EXPECT_GT(passes, 0);
        EXPECT_LT(passes, 100);
        EXPECT_NE(r.errors.find(fmt::format("pass {} failed", passes + 1)), std::string::npos)
            << r.errors;
        EXPECT_EQ(j["stopped_by"], "failure");
        EXPECT_NE(j["failure"].get<std::string>().find("MiB"), std::string::npos);
        EXPECT_EQ(j["pass_seconds"].size(), size_t(passes));
        // The image is that of the passes before the failure.
        const std::vector<float> pixels = read_image(image).data;
        ASSERT_EQ(vcm(fits, passes, seed).status, 0);
        EXPECT_EQ(read_image(image).data, pixels);
        return;
    }
    FAIL() << "no pass failed with light_paths=" << fits;
}

TEST_F(RenderTest, MemoryIsLimited) {
    for (const char* size : {"-1", "0", "4X", "much", "16E", "1.5GG"}) {
        const ProgramResult r = run({"--memory", size, "--spp", "1"});
        EXPECT_EQ(r.status, 1) << size;
        EXPECT_NE(r.errors.find("--memory must be a size such as 4G or 1.5G"), std::string::npos)
            << r.errors;
    }
    const ProgramResult film = run({"--memory", "0.5 GiB", "--resolution", "4000x4000"});
    EXPECT_EQ(film.status, 1);
    EXPECT_NE(film.errors.find("MiB are free"), std::string::npos) << film.errors;
    const ProgramResult stacks = run({"--memory", "300M", "--threads", "64"});
    EXPECT_EQ(stacks.status, 1);
    EXPECT_NE(stacks.errors.find("63 further threads need 504 MiB for their stacks"),
              std::string::npos)
        << stacks.errors;
    EXPECT_TRUE(has_earlier_image());
    EXPECT_EQ(run({"--memory", "600mb", "--spp", "1", "--threads", "2"}).status, 0);
    // The stacks, and what allocators reserve: about 400 MiB, more or less by the threads that come to load the scene.
    EXPECT_EQ(run({"--memory", "1000M", "--spp", "1", "--threads", "64"}).status, 0);
}

/// Where the passes succeed, so does what follows them: statistics are written even if an image is not.
TEST_F(RenderTest, WritesBeyondTheLimitOfMemory) {
    int fits = 400, fails = 100;  // MiB
    while (fits - fails > 6) {
        fs::remove(stats);
        const int limit = (fits + fails) / 2;
        const ProgramResult r = run({"--memory", fmt::format("{}M", limit), "--spp", "1", "-i",
                                     "path:max_depth=2", "--resolution", "500x500", "--threads",
                                     "2", "--aov", "albedo,normal,depth,position,uv,variance"});
        if (fs::exists(stats)) {
            EXPECT_EQ(r.status, 0) << limit << ": " << r.errors;
        }
        (r.status == 0 ? fits : fails) = limit;
    }
}

/// Passes of seconds, on one thread.
class InterruptTest : public RenderTest {
protected:
    Program start_long(const std::vector<std::string>& more = {}) const {
        std::vector<std::string> all = {"-i",        "bdpt", "--resolution", "900x700",
                                        "--threads", "1",    "--time",       "600"};
        all.insert(all.end(), more.begin(), more.end());
        return start(all);
    }
    static void wait(double seconds) {
        std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    }
    static void wait_for_start(const Program& program) {
        for (int i = 0; i < 3000 && !program.catches_interrupts(); ++i) wait(0.01);
    }
};

TEST_F(InterruptTest, TheSecondDropsThePassInFlight) {
    const Program program = start_long();
    wait_for_start(program);
    program.interrupt();
    wait(0.2);
    const auto begin = Clock::now();
    program.interrupt();
    const ProgramResult r = program.wait();
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(2));
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("interrupted in the first pass"), std::string::npos) << r.errors;
    EXPECT_TRUE(has_earlier_image());
}

TEST_F(InterruptTest, ThePassIsDroppedAfterTheGrace) {
    const Program program = start_long({"--grace", "1"});
    wait_for_start(program);
    const auto begin = Clock::now();
    program.interrupt();
    const ProgramResult r = program.wait();
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(3));
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("interrupted in the first pass"), std::string::npos) << r.errors;
}

TEST_F(InterruptTest, APassThatIsDroppedAfterTheGraceLeavesTheFirst) {
    const std::string checkpoint = folder.path() / "a.etd";
    const Program program =
        start_long({"--grace", "1", "--checkpoint", checkpoint, "--checkpoint-every", "1e-6"});
    // It is written between the first pass and the next one.
    for (int i = 0; i < 6000 && !fs::exists(checkpoint); ++i) wait(0.01);
    const auto begin = Clock::now();
    program.interrupt();
    const ProgramResult r = program.wait();
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(3));
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(report()["spp"], 1);
    EXPECT_EQ(report()["stopped_by"], "interrupted");
    const std::vector<float> pixels = read_image(image).data;
    ASSERT_EQ(run({"-i", "bdpt", "--resolution", "900x700", "--spp", "1"}).status, 0);
    EXPECT_TRUE(read_image(image).data == pixels);
}

TEST_F(InterruptTest, ThePassesBeforeTheDroppedOneAreWritten) {
    const Program program = start({"-i", "bdpt", "--resolution", "150x100", "--threads", "1",
                                   "--time", "600", "--grace", "0"});
    // Long enough for more than one pass, each of which takes a tenth of a second, also on a busy machine.
    wait_for_start(program);
    wait(4);
    program.interrupt();
    const ProgramResult r = program.wait();
    EXPECT_EQ(r.status, 0) << r.errors;
    const nlohmann::json j = report();
    EXPECT_EQ(j["stopped_by"], "interrupted");
    const int passes = j["spp"];
    const std::vector<float> pixels = read_image(image).data;
    ASSERT_EQ(
        run({"-i", "bdpt", "--resolution", "150x100", "--spp", std::to_string(passes)}).status, 0);
    EXPECT_EQ(read_image(image).data, pixels) << passes;
    EXPECT_EQ(report()["walk_rays"], j["walk_rays"]);
}

}  // namespace
}  // namespace etendue::test
