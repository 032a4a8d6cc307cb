// Sums of technique images over many passes.

#include "render/technique_images.h"

#include <gtest/gtest.h>

#include "system/section_file.h"

namespace etendue::test {
namespace {

/// Small contributions that follow a very large one are not lost.
TEST(TechniqueImages, KeepWhatFollowsAFirefly) {
    constexpr FilmGeometry kGeometry{4, 3, 0, 0, 4, 3};
    const ReconstructionFilter filter = ReconstructionFilter::box();
    constexpr int kPasses = 1025;
    constexpr float kFirefly = 0x1p26f;
    const Technique technique{Strategy::Connect, 2, 2};
    TechniqueImages images(kGeometry, filter, 4), resumed(kGeometry, filter, 4);
    const auto add_pass = [&](TechniqueImages& to, float value) {
        to.add({{0.5f, 0.5f}, 0}, technique, Rgb(value), 0.5f, 1);
        to.end_pass();
    };
    add_pass(images, kFirefly);
    // With the sums of a checkpoint as well.
    for (int i = 1; i < kPasses / 2; ++i) add_pass(images, 1);
    SectionWriter to;
    images.save(to);
    SectionReader from(to.take(), "sums");
    resumed.add_saved(from);
    for (int i = kPasses / 2; i < kPasses; ++i) add_pass(resumed, 1);
    const auto entries = resumed.images();
    ASSERT_EQ(entries.size(), 1u);
    const double sum = double(kFirefly) + kPasses - 1;
    EXPECT_FLOAT_EQ(entries[0].unweighted[0].g, float(sum / kPasses));
    EXPECT_FLOAT_EQ(entries[0].weighted[0].g, float(0.5 * sum / kPasses));
    EXPECT_EQ(entries[0].unweighted[1].g, 0);
}

}  // namespace
}  // namespace etendue::test
