// The brightest pass of each pixel, from the totals after each pass.

#include "session/largest_passes.h"

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

/// Totals of three grey pixels, to which passes are added.
class Totals {
public:
    void add(std::array<float, 3> values) {
        for (size_t i = 0; i < 3; ++i)
            for (double& sum : moments_[i].sum) sum += double(values[i]);
        passes.add(moments_, ++count_);
    }
    /// Passes that are not told.
    void skip(std::array<float, 3> values, uint64_t count) {
        for (size_t i = 0; i < 3; ++i)
            for (double& sum : moments_[i].sum) sum += double(values[i]) * double(count);
        count_ += count;
    }
    LargestPasses passes;

private:
    std::array<Film::Moments, 3> moments_;
    uint64_t count_ = 0;
};

TEST(LargestPasses, NamesThePassOfAFirefly) {
    Totals t;
    t.add({1, 10, 0});
    EXPECT_TRUE(t.passes.worst(3).empty());
    t.add({1.1f, 10, 0});
    t.add({90, 10.5f, 0});
    t.add({0.9f, 10, 0});
    const std::vector<WorstPixel> worst = t.passes.worst(10);
    ASSERT_EQ(worst.size(), 2u);  // Nothing is in the third pixel.
    EXPECT_EQ(worst[0].pixel, 0u);
    EXPECT_EQ(worst[0].pass, 2u);
    EXPECT_NEAR(worst[0].value, 90, 1e-4);
    EXPECT_NEAR(worst[0].share, 90 / 93.0, 1e-5);
    EXPECT_EQ(worst[1].pixel, 1u);
    EXPECT_EQ(t.passes.worst(1).size(), 1u);
    EXPECT_EQ(t.passes.at(0)->pass, 2u);
    EXPECT_FALSE(t.passes.at(2));
    EXPECT_FALSE(t.passes.at(3));
}

/// A lamp is bright in every pass; a pixel that is dark but for one pass is not the worst unless it is bright in the image.
TEST(LargestPasses, RanksByWhatIsSeen) {
    Totals t;
    t.add({1000, 1, 0});
    t.add({1000, 1, 1e-3f});
    t.add({1000, 1000, 0});
    t.add({1000, 1, 0});
    const std::vector<WorstPixel> worst = t.passes.worst(3);
    ASSERT_EQ(worst.size(), 3u);
    EXPECT_EQ(worst[0].pixel, 1u);
    EXPECT_EQ(worst[1].pixel, 0u);
    EXPECT_EQ(worst[2].pixel, 2u);
}

/// As of a run that was opened from a file.
TEST(LargestPasses, LeavesOutWhatItHasNotSeen) {
    Totals t;
    t.skip({5, 500, 0}, 100);
    t.add({1, 1, 1});
    EXPECT_EQ(t.passes.passes(), 0u);  // It may be any of the hundred and one.
    t.add({1, 1, 1});
    t.add({3, 1, 1});
    EXPECT_EQ(t.passes.passes(), 2u);
    EXPECT_EQ(t.passes.worst(1)[0].pixel, 0u);
    EXPECT_EQ(t.passes.at(0)->pass, 102u);
    EXPECT_NEAR(t.passes.at(0)->share, 0.75, 1e-4);
    t.skip({1, 1, 1}, 1);
    t.add({1, 1, 1});
    EXPECT_EQ(t.passes.passes(), 0u);
}

}  // namespace
}  // namespace etendue::test
