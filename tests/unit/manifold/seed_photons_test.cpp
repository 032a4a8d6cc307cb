// Photons that tell where chains begin.

#include "manifold/seed_photons.h"

#include <gtest/gtest.h>

#include "random.h"

namespace etendue {
namespace {

constexpr Vec3 kSides[] = {{0, 1, 0}, {0, -1, 0}, {}};
constexpr uint32_t kEmitters = 4;

std::vector<SeedPhoton> on_a_floor(size_t n) {
    testing::Random random(3);
    std::vector<SeedPhoton> photons;
    for (size_t i = 0; i < n; ++i) {
        const Vec2 u = random.next_2d();
        photons.push_back({.p = {u.x, 0, u.y},
                           .n = kSides[i % 3],
                           .left = {float(i), 0, 0},
                           .emitter = uint32_t(random.next_1d() * kEmitters)});
    }
    return photons;
}

TEST(SeedPhotons, AreNearOnTheSideAndOfTheEmitter) {
    const std::vector<SeedPhoton> all = on_a_floor(5000);
    const SeedPhotons photons(all);
    ASSERT_EQ(photons.size(), all.size());
    for (const SeedPhoton& s : all) {
        const auto near = photons.near(s.p, s.n, s.emitter);
        bool is_there = false;
        for (const SeedPhoton& other : near) {
            ASSERT_EQ(other.n, s.n);
            ASSERT_EQ(other.emitter, s.emitter);
            EXPECT_LT(length(other.p - s.p), 0.25f);
            is_there |= other.left == s.left;
        }
        EXPECT_TRUE(is_there);
    }
    EXPECT_TRUE(photons.near({0.5f, 0, 0.5f}, {1, 0, 0}, 0).empty());
    EXPECT_TRUE(photons.near({0.5f, 0, 0.5f}, kSides[0], kEmitters).empty());
}

TEST(SeedPhotons, MayBeNoneOrAtOnePlace) {
    EXPECT_TRUE(SeedPhotons().near({}, kSides[0], 0).empty());
    EXPECT_TRUE(SeedPhotons(std::vector<SeedPhoton>()).near({}, kSides[0], 0).empty());
    const SeedPhotons same(std::vector<SeedPhoton>(100, {{1, 2, 3}, kSides[0], {}, 2}));
    EXPECT_EQ(same.near({}, kSides[0], 2).size(), 100u);
}

}  // namespace
}  // namespace etendue
