// Images of another program: what their names say of time, samples and run.

#include "compare/timed_images.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

/// What is found in a folder with images of these names, without their extension.
TimedImages found(const std::vector<std::string>& names) {
    const TemporaryFolder folder;
    for (const std::string& name : names)
        write_image((folder.path() / (name + ".pfm")).string(),
                    rgb_image(1, 1, std::vector<Rgb>{Rgb(1)}));
    return find_timed_images("other", folder.path().string(), {1, 1, 0, 0, 1, 1});
}

std::string refusal(const std::string& name) {
    try {
        found({name});
    } catch (const std::runtime_error& e) {
        return e.what();
    }
    return "";
}

TEST(TimedImages, HaveTimesSamplesAndRunsInTheirNames) {
    const TimedImages images =
        found({"a-64spp-2.5s", "a-8spp-0.5s", "b_64spp_3s", "4s", "c-x-5s", "d-1spp-7s"});
    ASSERT_EQ(images.runs.size(), 5u);  // "", a, b, c-x and d
    EXPECT_EQ(images.runs[0][0].seconds, 4);
    EXPECT_EQ(images.runs[0][0].spp, 0u);
    ASSERT_EQ(images.runs[1].size(), 2u);
    EXPECT_EQ(images.runs[1][0].seconds, 0.5);
    EXPECT_EQ(images.runs[1][0].spp, 8u);
    EXPECT_EQ(images.runs[1][1].seconds, 2.5);
    EXPECT_EQ(images.runs[2][0].spp, 64u);
    EXPECT_EQ(images.runs[2][0].seconds, 3);
    EXPECT_EQ(images.runs[3][0].seconds, 5);
    EXPECT_EQ(images.runs[4][0].spp, 1u);
}

/// The end of another number is no time.
TEST(TimedImages, WithOtherNumbersAreRefused) {
    for (const char* name : {"1.23e+03s", "1.23e-03s", "a-1e-3s", "2,5s", "1:30s", "a-1m30s",
                             "a-1.2.3s", "a-0s", "seed7", "x5s"})
        EXPECT_NE(refusal(name).find("expected a name that ends with the rendering time"),
                  std::string::npos)
            << name << ": " << refusal(name);
    EXPECT_NE(refusal("a-99999999999999999999spp-1s").find("too many samples per pixel"),
              std::string::npos);
    // The name of a run may end with e.
    EXPECT_EQ(found({"scene-3s"}).runs[0][0].seconds, 3);
}

}  // namespace
}  // namespace etendue::test
