// Learned selection of emitters.

#include "guide/light_selection.h"

#include <gtest/gtest.h>

#include "math/hash.h"
#include "state.h"

namespace etendue::test {
namespace {

constexpr Vec3 kUp{0, 0, 1};
constexpr uint32_t kEmitters = 20;

std::vector<float> uniform() {
    return std::vector<float>(kEmitters, 1.0f / kEmitters);
}

/// `n` arrivals on one side, of the emitters 3 and 7 alone, the latter with three times the power.
std::vector<Arrival> two_lamps(int n) {
    std::vector<Arrival> arrivals;
    for (int i = 0; i < n; ++i) {
        arrivals.push_back({{{}, kUp, 1}, 3});
        arrivals.push_back({{{}, kUp, 3}, 7});
    }
    return arrivals;
}

TEST(LightSelection, SelectsWithItsProbabilities) {
    const LightSelections all(two_lamps(10), uniform());
    const LightSelection* selection = all.find({}, kUp);
    ASSERT_NE(selection, nullptr);
    double sum = 0;
    for (uint32_t e = 0; e < kEmitters; ++e) sum += double(selection->pmf(e, 1.0f / kEmitters));
    EXPECT_NEAR(sum, 1, 1e-6);

    constexpr int kDraws = 1 << 16;
    std::array<double, kEmitters> counts{};
    for (int i = 0; i < kDraws; ++i) {
        const LightSelection::Draw draw = selection->sample((i + 0.5) / kDraws);
        ASSERT_GE(draw.u, 0);
        ASSERT_LT(draw.u, 1);
        ++counts[draw.emitter ? *draw.emitter : uint32_t(draw.u * kEmitters)];
    }
    for (uint32_t e = 0; e < kEmitters; ++e)
        EXPECT_NEAR(counts[e] / kDraws, double(selection->pmf(e, 1.0f / kEmitters)), 1e-3) << e;
}

TEST(LightSelection, FollowsThePower) {
    const LightSelections all(two_lamps(1000), uniform());
    const LightSelection& selection = *all.find({}, kUp);
    const float unknown = selection.pmf(0, 1.0f / kEmitters);
    EXPECT_GT(unknown, 0);
    EXPECT_NEAR((selection.pmf(7, 1.0f / kEmitters) - unknown) /
                    (selection.pmf(3, 1.0f / kEmitters) - unknown),
                3, 1e-3);
}

TEST(LightSelection, KnowsNothingOfOtherSides) {
    const LightSelections all(two_lamps(10), uniform());
    EXPECT_NE(all.find({}, kUp), nullptr);
    EXPECT_EQ(all.find({}, -kUp), nullptr);
    EXPECT_EQ(all.find({}, {}), nullptr);
}

/// Twenty lamps in a row, each with its own part of the floor.
LightSelections row_of_lamps() {
    std::vector<Arrival> arrivals;
    for (uint32_t i = 0; i < 100 * kEmitters; ++i) {
        const float x = to_unit_float(uint32_t(mix64(i))) * float(kEmitters);
        arrivals.push_back({{{x, 0, 0}, kUp, 1}, uint32_t(x)});
    }
    return {std::move(arrivals), uniform()};
}

TEST(LightSelection, KnowsTheLampOfEachPlace) {
    const LightSelections all = row_of_lamps();
    for (uint32_t e = 0; e < kEmitters; ++e)
        EXPECT_GT(all.find({float(e) + 0.5f, 0, 0}, kUp)->pmf(e, 1.0f / kEmitters), 0.3f) << e;
}

TEST(LightSelection, TrustsFewArrivalsLess) {
    const auto share = [](int n) {
        return LightSelections(two_lamps(n), uniform()).find({}, kUp)->share();
    };
    EXPECT_LT(share(1), 0.2f);
    EXPECT_GT(share(100), 0.7f);
    EXPECT_LT(share(10000), 0.9f);
}

TEST(LightSelection, GainsWhereLampsDiffer) {
    // With all of a share of 0.8, and probabilities of 1/4 and 3/4 instead of 1/20.
    const double gain = 0.25 * std::log(0.2 + 0.8 * 0.25 * kEmitters) +
                        0.75 * std::log(0.2 + 0.8 * 0.75 * kEmitters);
    EXPECT_NEAR(LightSelections(two_lamps(2000), uniform()).gain(), gain, 0.02);
    // Noise is no gain.
    std::vector<Arrival> any;
    for (uint32_t i = 0; i < 400; ++i)
        any.push_back({{{}, kUp, 1}, uint32_t(mix64(i) % kEmitters)});
    EXPECT_LT(LightSelections(any, uniform()).gain(), 0.0);
}

TEST(LightSelection, LeavesOutWhatIsNotPositiveAndFinite) {
    std::vector<Arrival> arrivals = two_lamps(10);
    arrivals.push_back({{{}, kUp, kInf}, 5});
    arrivals.push_back({{{}, kUp, std::nanf("")}, 5});
    arrivals.push_back({{{}, kUp, 0}, 5});
    const LightSelections all(arrivals, uniform());
    EXPECT_EQ(all.find({}, kUp)->pmf(5, 0), 0);
    EXPECT_TRUE(LightSelections({}, uniform()).is_empty());
}

TEST(LightSelection, IsKept) {
    const LightSelections before = row_of_lamps();
    State state;
    before.save(state);
    LightSelections after;
    after.load(state);
    EXPECT_EQ(after.gain(), before.gain());
    for (uint32_t at = 0; at < kEmitters; ++at) {
        const Vec3 p{float(at) + 0.5f, 0, 0};
        for (uint32_t e = 0; e < kEmitters; ++e)
            EXPECT_EQ(after.find(p, kUp)->pmf(e, 0.1f), before.find(p, kUp)->pmf(e, 0.1f));
    }
    EXPECT_EQ(after.find({}, -kUp), nullptr);
}

}  // namespace
}  // namespace etendue::test
