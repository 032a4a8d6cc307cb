// The nearest photons against a search through all of them.

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

#include "random.h"
#include "reuse/photon_map.h"

namespace etendue {
namespace {

std::vector<MapPhoton> random_photons(size_t count) {
    testing::Random random(5);
    std::vector<MapPhoton> photons(count);
    for (MapPhoton& p : photons) p.p = random.in_cube();
    return photons;
}

TEST(PhotonMap, FindsTheNearest) {
    PhotonMap map;
    map.build(random_photons(3000));
    testing::Random random(6);
    for (const int count : {1, 2, 7, 64, PhotonMap::kMostNeighbours})
        for (const float radius : {0.02f, 0.2f, 0.7f, 10.0f})
            for (int query = 0; query < 20; ++query) {
                SCOPED_TRACE(::testing::Message() << count << " within " << radius);
                const Vec3 p = random.in_cube() * 1.2f;
                const auto distance2 = [&](uint32_t i) { return length2(map.photons()[i].p - p); };
                std::vector<uint32_t> all(map.photons().size());
                std::iota(all.begin(), all.end(), 0u);
                std::ranges::sort(all, {}, distance2);
                const auto within = std::ranges::count_if(
                    all, [&](uint32_t i) { return distance2(i) < radius * radius; });
                const bool is_full = within >= count;
                const size_t expected = size_t(is_full ? count - 1 : within);
                const float expected_disc =
                    kPi * (is_full ? distance2(all[expected]) : radius * radius);

                PhotonMap::Neighbours found;
                map.find(p, count, radius, found);
                ASSERT_EQ(size_t(found.count), expected);
                std::sort(found.index.begin(), found.index.begin() + found.count);
                std::sort(all.begin(), all.begin() + ptrdiff_t(expected));
                EXPECT_TRUE(std::equal(all.begin(), all.begin() + ptrdiff_t(expected),
                                       found.index.begin()));
                EXPECT_NEAR(found.disc, expected_disc, 1e-5f * expected_disc);
            }
}

TEST(PhotonMap, FindsNothingInAnEmptyMap) {
    PhotonMap map;
    PhotonMap::Neighbours found;
    map.find({}, 8, 1, found);
    EXPECT_EQ(found.count, 0);
    map.build({});
    map.find({}, 8, 1, found);
    EXPECT_EQ(found.count, 0);
    EXPECT_FLOAT_EQ(found.disc, kPi);
}

TEST(PhotonSides, FindTheNearest) {
    std::vector<MapPhoton> photons = random_photons(2000);
    testing::Random random(7);
    const Vec3 up{0, 0, 1};
    for (size_t i = 0; i < photons.size(); ++i)
        photons[i].side = ArrivalSide(i % 3 == 0 ? up : i % 3 == 1 ? -up : Vec3{1, 0, 0}, false);
    PhotonMap map;
    map.build(photons);
    const auto sorted = map.photons();
    for (const int step : {1, 4}) {
        PhotonSides sides;
        sides.build(map, step);
        for (const float radius : {0.05f, 0.5f, 10.0f})
            for (int query = 0; query < 50; ++query) {
                const Vec3 p = random.in_cube() * 1.2f;
                std::optional<uint32_t> expected;
                for (uint32_t i = 0; i < sorted.size(); i += uint32_t(step)) {
                    const float dist2 = length2(sorted[i].p - p);
                    if (dot(sorted[i].side.normal(), up) > 0.9f && dist2 < radius * radius &&
                        (!expected || dist2 < length2(sorted[*expected * uint32_t(step)].p - p)))
                        expected = i / uint32_t(step);
                }
                EXPECT_EQ(sides.nearest(p, up, radius), expected);
            }
    }
}

}  // namespace
}  // namespace etendue
