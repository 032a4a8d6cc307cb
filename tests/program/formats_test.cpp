// The scenes of tests/scenes/formats are rendered with one sample per pixel.

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

class FormatScenes : public ::testing::TestWithParam<const char*> {};

TEST_P(FormatScenes, AreRendered) {
    const TemporaryFolder folder;
    const std::string image = folder.path() / "image.pfm";
    int count = 0;
    for (const auto& entry : fs::directory_iterator(fs::path(ETENDUE_SOURCE_DIR) /
                                                    "tests/scenes/formats" / GetParam())) {
        SCOPED_TRACE(entry.path());
        const ProgramResult r = Program(ETENDUE_PROGRAM,
                                        {"render", entry.path(), "-o", image, "--quiet", "--spp",
                                         "1", "--resolution", "16x12"},
                                        folder.path())
                                    .wait();
        ASSERT_EQ(r.status, 0) << r.errors;
        float largest = 0;
        for (const Rgb& c : read_rgb(image).pixels) {
            ASSERT_TRUE(std::isfinite(c.r + c.g + c.b));
            largest = std::max(largest, c.max());
        }
        EXPECT_GT(largest, 0);
        fs::remove(image);
        ++count;
    }
    EXPECT_GT(count, 5);
}

INSTANTIATE_TEST_SUITE_P(All, FormatScenes,
                         ::testing::Values("mitsuba06", "mitsuba3", "pbrt3", "pbrt4", "gltf"),
                         [](const auto& format) { return std::string(format.param); });

}  // namespace
}  // namespace etendue::test
