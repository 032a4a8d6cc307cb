#pragma once
// Renderings with checkpoints in a folder of their own.

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;
using Clock = std::chrono::steady_clock;

class CheckpointTest : public ::testing::Test {
protected:
    std::string path(const std::string& name) const { return folder.path() / name; }
    Program start(const Arguments& arguments) const {
        return Program(ETENDUE_PROGRAM, arguments, folder.path());
    }
    ProgramResult run(const Arguments& arguments) const { return start(arguments).wait(); }
    Arguments render(const std::string& image, const Arguments& more) const {
        Arguments all = {"render", scene, "-o", path(image), "--quiet", "--resolution", "48x36"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    void expect_run(const Arguments& arguments) const {
        const ProgramResult r = run(arguments);
        ASSERT_EQ(r.status, 0) << r.errors;
    }
    std::vector<float> pixels(const std::string& image) const {
        return read_image(path(image)).data;
    }
    /// The hash that `info` prints of the sums in a checkpoint.
    std::string bits(const std::string& checkpoint) const { return info(checkpoint)["bits"]; }
    nlohmann::json info(const std::string& checkpoint) const {
        const ProgramResult r = run({"info", "--json", path(checkpoint)});
        EXPECT_EQ(r.status, 0) << r.errors;
        return nlohmann::json::parse(r.output);
    }
    static double seconds_since(Clock::time_point begin) {
        return std::chrono::duration<double>(Clock::now() - begin).count();
    }
    static void wait(double seconds) {
        std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    }
    static void wait_for_start(const Program& program) {
        for (int i = 0; i < 3000 && !program.catches_interrupts(); ++i) wait(0.01);
    }
    void wait_for_file(const std::string& name) const {
        for (int i = 0; i < 3000 && !fs::exists(path(name)); ++i) wait(0.01);
    }

    TemporaryFolder folder;
    const std::string scene = fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml";
};

}  // namespace etendue::test
