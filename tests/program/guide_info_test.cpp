// etendue info --guide: what a guide has learned, as text, JSON and images.

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

const std::string kScene = ETENDUE_SOURCE_DIR "/scenes/two-rooms.xml",
                  kGuided = ETENDUE_SOURCE_DIR "/scenes/lantern.xml";  ///< both walks gain

class GuideInfoTest : public ::testing::Test {
protected:
    ProgramResult run(std::vector<std::string> more, const std::string& scene = kScene) const {
        std::vector<std::string> arguments{"info", scene, "--resolution", "64x48", "--guide"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    void expect_refusal(const std::vector<std::string>& more, const std::string& message) const {
        const ProgramResult r = run(more);
        EXPECT_NE(r.status, 0) << message;
        EXPECT_EQ(r.output, "");
        EXPECT_NE(r.errors.find(message), std::string::npos) << r.errors;
    }
    std::string file(const char* name) const { return (folder.path() / name).string(); }

    TemporaryFolder folder;
};

/// Also while the scene is loaded. Libraries have threads of their own.
TEST_F(GuideInfoTest, OneThreadIsFewerThanTwo) {
    const auto most_threads = [&](const char* threads) {
        const Program program(
            ETENDUE_PROGRAM,
            {"info", kScene, "--resolution", "64x48", "--guide", "--threads", threads},
            folder.path());
        int most = 0, now = 0;
        while ((now = program.threads()) > 0) {
            most = std::max(most, now);
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        EXPECT_EQ(program.wait().status, 0);
        return most;
    };
    if (std::thread::hardware_concurrency() > 1) {
        EXPECT_LT(most_threads("1"), most_threads("2"));
    }
}

TEST_F(GuideInfoTest, ImagesAgreeWithTheFigures) {
    const ProgramResult r = run({"--json", "--threads", "3", "--shares", file("shares.exr"),
                                 "--pixel", "20,30", "--directions", file("directions.exr")},
                                kGuided);
    ASSERT_EQ(r.status, 0) << r.errors;
    const auto guide = nlohmann::json::parse(r.output)["guide"];
    EXPECT_GT(guide["cells"].get<int>(), 4);

    const Image shares = read_image(file("shares.exr"));
    ASSERT_EQ(shares.width, 64);
    double eye = 0, light = 0;
    for (int y = 0; y < shares.height; ++y)
        for (int x = 0; x < shares.width; ++x) {
            eye += double(shares.at(x, y, shares.channel("R")));
            light += double(shares.at(x, y, shares.channel("G")));
        }
    EXPECT_NEAR(eye / double(shares.pixel_count()), guide["share_eye"].get<double>(), 1e-4);
    EXPECT_NEAR(light / double(shares.pixel_count()), guide["share_light"].get<double>(), 1e-4);
    EXPECT_GT(eye, 0);
    EXPECT_GT(light, 0);
    EXPECT_GE(shares.channel("cells.R"), 0);

    // Each density integrates to one, and is largest about one of the listed lobes.
    const Image map = read_image(file("directions.exr"));
    const auto& place = guide["place"];
    for (const auto& [layer, name] :
         {std::pair("eye.Y", "eye_walks"), {"light.Y", "light_walks"}}) {
        double sum = 0, shares_of_lobes = 0;
        float largest = 0;
        std::array<double, 3> at{};
        for (int y = 0; y < map.height; ++y)
            for (int x = 0; x < map.width; ++x) {
                const double theta = M_PI * (y + 0.5) / map.height,
                             phi = 2 * M_PI * (x + 0.5) / map.width;
                const float density = map.at(x, y, map.channel(layer));
                sum +=
                    double(density) * std::sin(theta) * 2 * M_PI * M_PI / double(map.pixel_count());
                if (density > largest) {
                    largest = density;
                    at = {std::sin(phi) * std::sin(theta), std::cos(theta),
                          -std::cos(phi) * std::sin(theta)};
                }
            }
        EXPECT_NEAR(sum, 1, 0.01) << name;
        double nearest = -1;
        for (const auto& lobe : place[name]["lobes"]) {
            shares_of_lobes += lobe["share"].get<double>();
            const auto w = lobe["direction"].get<std::array<double, 3>>();
            nearest = std::max(nearest, w[0] * at[0] + w[1] * at[1] + w[2] * at[2]);
        }
        EXPECT_NEAR(shares_of_lobes, 1, 1e-4) << name;
        EXPECT_GT(nearest, 0.98) << name;
    }
}

/// The layers of a rendering tell what the lens sees at a pixel.
TEST_F(GuideInfoTest, DescribesTheSurfaceAtThePixel) {
    const ProgramResult image =
        Program(ETENDUE_PROGRAM,
                {"render", kScene, "-i", "path", "--spp", "1", "--resolution", "64x48", "--quiet",
                 "--aov", "position,normal", "-o", file("image.exr")},
                folder.path())
            .wait();
    ASSERT_EQ(image.status, 0) << image.errors;
    const Image layers = read_image(file("image.exr"));
    for (const auto& [x, y] : {std::pair(20, 30), {32, 20}}) {
        const ProgramResult r = run({"--json", "--pixel", fmt::format("{},{}", x, y)});
        ASSERT_EQ(r.status, 0) << r.errors;
        const auto place = nlohmann::json::parse(r.output)["guide"]["place"];
        constexpr double kFootprint = 0.05;  // half a pixel, and more
        for (int i = 0; i < 3; ++i) {
            const std::string axis(1, "RGB"[i]);
            EXPECT_NEAR(place["position"][size_t(i)].get<double>(),
                        double(layers.at(x, y, layers.channel("position." + axis))), kFootprint);
            EXPECT_NEAR(place["normal"][size_t(i)].get<double>(),
                        double(layers.at(x, y, layers.channel("normal." + axis))), kFootprint);
        }
    }
}

TEST_F(GuideInfoTest, IsTheSameForAnyNumberOfThreads) {
    const ProgramResult one = run({"--pixel", "20,30", "--threads", "1"});
    EXPECT_EQ(one.status, 0) << one.errors;
    EXPECT_NE(one.output.find("eye walks, toward radiance"), std::string::npos) << one.output;
    EXPECT_EQ(one.output, run({"--pixel", "20,30", "--threads", "7"}).output);
    EXPECT_NE(one.output, run({"--pixel", "20,30", "--seed", "1"}).output);
}

TEST_F(GuideInfoTest, ShowsTheEnvironmentsDirections) {
    const ProgramResult r = Program(ETENDUE_PROGRAM,
                                    {"info", ETENDUE_SOURCE_DIR "/scenes/environment.xml",
                                     "--resolution", "64x40", "--guide", "--pixel", "3,3"},
                                    folder.path())
                                .wait();
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_NE(r.output.find("pixel       3,3: the environment"), std::string::npos) << r.output;
}

TEST_F(GuideInfoTest, RefusesWhatItCannotDo) {
    expect_refusal({"-i", "pm"}, "integrator \"pm\" has no guide; choose one that has (-i): path,");
    expect_refusal({"-i", "bdpt:gide=on"}, "did you mean \"guide\"?");
    expect_refusal({"--pixel", "64,0"}, "pixel 64,0 lies outside the image of 64 x 48 pixels");
    expect_refusal({"--directions", file("a.png")}, "--pixel");
    expect_refusal({"--shares", file("a.gif")}, "a.gif");
    const ProgramResult without =
        Program(ETENDUE_PROGRAM, {"info", kScene, "--pixel", "1,1"}, folder.path()).wait();
    EXPECT_EQ(without.status, 2);
    EXPECT_NE(without.errors.find("--guide"), std::string::npos) << without.errors;
}

}  // namespace
}  // namespace etendue::test
