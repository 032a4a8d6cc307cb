// The brightest pass of each pixel, as a film notes it.

#include "session/largest_passes.h"

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

/// A film of three grey pixels.
class ThreePixels {
public:
    explicit ThreePixels(bool keeps_largest = true) {
        if (keeps_largest) film_.keep_largest();
    }
    void add(std::array<float, 3> values) {
        film_.begin_pass(0);
        for (size_t i = 0; i < 3; ++i) film_.add_eye(i, Rgb(values[i]));
        film_.end_pass();
    }
    /// From now on, as if the run had been opened from a file.
    void open() {
        before_ = SumsBefore::of(film_);
        film_.keep_largest();
    }
    LargestPasses largest() const { return {&film_, before_}; }

private:
    Film film_{FilmGeometry{3, 1, 0, 0, 3, 1}, ReconstructionFilter::box()};
    SumsBefore before_;
};

TEST(LargestPasses, NamesThePassOfAFirefly) {
    ThreePixels t;
    t.add({1, 10, 0});
    EXPECT_TRUE(t.largest().worst(3).empty());
    t.add({1.1f, 10, 0});
    t.add({90, 10.5f, 0});
    t.add({0.9f, 10, 0});
    const std::vector<WorstPixel> worst = t.largest().worst(10);
    ASSERT_EQ(worst.size(), 2u);  // Nothing is in the third pixel.
    EXPECT_EQ(worst[0].pixel, 0u);
    EXPECT_EQ(worst[0].pass, 2u);
    EXPECT_NEAR(worst[0].value, 90, 1e-4);
    EXPECT_NEAR(worst[0].share, 90 / 93.0, 1e-5);
    EXPECT_EQ(worst[1].pixel, 1u);
    const std::vector<WorstPixel> first = t.largest().worst(1);
    ASSERT_EQ(first.size(), 1u);
    EXPECT_EQ(first[0].pixel, 0u);
    EXPECT_EQ(t.largest().at(0)->pass, 2u);
    EXPECT_FALSE(t.largest().at(2));
    EXPECT_FALSE(t.largest().at(3));
}

/// A lamp is bright in every pass; a pixel that is dark but for one pass is not the worst unless it is bright in the image.
TEST(LargestPasses, RanksByWhatIsSeen) {
    ThreePixels t;
    t.add({1000, 1, 0});
    t.add({1000, 1, 1e-3f});
    t.add({1000, 1000, 0});
    t.add({1000, 1, 0});
    const std::vector<WorstPixel> worst = t.largest().worst(3);
    ASSERT_EQ(worst.size(), 3u);
    EXPECT_EQ(worst[0].pixel, 1u);
    EXPECT_EQ(worst[1].pixel, 0u);
    EXPECT_EQ(worst[2].pixel, 2u);
}

/// As of a run that was opened from a file.
TEST(LargestPasses, LeavesOutWhatItHasNotSeen) {
    ThreePixels t(false);
    for (int i = 0; i < 100; ++i) t.add({5, 500, 0});
    EXPECT_EQ(t.largest().passes(), 0u);
    EXPECT_TRUE(t.largest().worst(3).empty());
    t.open();
    t.add({1, 1, 1});
    EXPECT_EQ(t.largest().passes(), 1u);
    EXPECT_TRUE(t.largest().worst(3).empty());
    t.add({3, 1, 1});
    EXPECT_EQ(t.largest().passes(), 2u);
    EXPECT_EQ(t.largest().worst(1)[0].pixel, 0u);
    EXPECT_EQ(t.largest().at(0)->pass, 101u);
    EXPECT_NEAR(t.largest().at(0)->share, 0.75, 1e-4);
}

TEST(LargestPasses, KnowsNothingWithoutAFilm) {
    const SumsBefore none;
    const LargestPasses largest(nullptr, none);
    EXPECT_EQ(largest.passes(), 0u);
    EXPECT_FALSE(largest.at(0));
    EXPECT_TRUE(largest.worst(3).empty());
}

}  // namespace
}  // namespace etendue::test
