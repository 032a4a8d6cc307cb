#include "reuse/point_grid.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "random.h"

namespace etendue {
namespace {

using testing::Random;

constexpr float kRadius = 0.1f;

std::vector<PointGrid::Entry> points(int count, uint64_t seed) {
    Random random(seed);
    std::vector<PointGrid::Entry> entries;
    for (int i = 0; i < count; ++i) entries.push_back({random.in_cube(), uint32_t(i)});
    return entries;
}

/// The inverse of its width is finite.
TEST(CellHash, BallsOfAnyRadiusMeetFewCells) {
    for (float radius : {1e-40f, 1e-30f, 1.0f, 1e30f}) {
        int cells = 0;
        CellHash(100, radius).for_each_near({1, -2, 3}, radius, [&](const CellHash::Cell&) {
            if (++cells > 100) throw std::runtime_error("too many cells");
        });
        EXPECT_LE(cells, 27) << radius;
    }
}

/// Few points have fewer buckets than a ball meets cells; none must be found twice.
TEST(PointGrid, AgreesWithALoop) {
    PointGrid grid;
    for (int count : {0, 1, 3, 5000}) {
        const auto entries = points(count, 1);
        grid.build(entries, kRadius);
        size_t found_in_all = 0;
        for (float radius : {kRadius, 0.3f * kRadius, 2 * kRadius})
            for (const auto& query : points(300, 2)) {
                std::vector<uint32_t> found, expected;
                grid.for_each_near(query.p, radius,
                                   [&](const PointGrid::Entry& e) { found.push_back(e.index); });
                for (const auto& e : entries)
                    if (length2(e.p - query.p) < radius * radius) expected.push_back(e.index);
                std::sort(found.begin(), found.end());
                EXPECT_EQ(found, expected);
                EXPECT_GE(grid.candidates(query.p, radius), found.size());
                found_in_all += found.size();
            }
        EXPECT_EQ(found_in_all > 500, count == 5000);
    }
}

/// Those on the border of the slab may be found as well.
TEST(PointGrid, FindsTheFlatPartOfABall) {
    PointGrid grid;
    const auto entries = points(5000, 1);
    grid.build(entries, kRadius);
    size_t found_in_all = 0;
    for (const auto& query : points(300, 2)) {
        const Vec3 n = normalize(query.p + Vec3{0.1f, -0.2f, 0.3f});
        const FlatBall region{query.p, kRadius, n, 0.3f * kRadius};
        const auto is_inside = [&](Vec3 p, float height) {
            return length2(p - query.p) < sqr(kRadius) && std::fabs(dot(p - query.p, n)) <= height;
        };
        size_t found = 0, expected = 0;
        grid.for_each_in(region, [&](const PointGrid::Entry& e) {
            EXPECT_TRUE(is_inside(e.p, 1.002f * region.half_height));
            found += is_inside(e.p, region.half_height);
        });
        for (const auto& e : entries) expected += is_inside(e.p, region.half_height);
        EXPECT_EQ(found, expected);
        found_in_all += found;
    }
    EXPECT_GT(found_in_all, 200u);
}

TEST(PointGrid, TestsFewDistantPoints) {
    PointGrid grid;
    grid.build(points(20000, 1), kRadius);
    double candidates = 0, found = 0;
    for (const auto& query : points(2000, 2)) {
        candidates += double(grid.candidates(query.p, kRadius));
        grid.for_each_near(query.p, kRadius, [&](const PointGrid::Entry&) { ++found; });
    }
    // Eight cells have 15.3 times the volume of the ball; other cells share their buckets.
    EXPECT_GT(candidates, 10 * found);
    EXPECT_LT(candidates, 25 * found);
}

// Points whose cells have no numbers share the outermost ones.
TEST(PointGrid, FindsPointsFarAway) {
    PointGrid grid;
    const float far = 1e12f;
    const std::vector<PointGrid::Entry> entries = {
        {{far, -far, far}, 0}, {{0, 0, 0}, 1}, {{-1e18f, 0, 1e18f}, 2}};
    grid.build(entries, kRadius);
    for (const auto& [p, index] :
         {std::pair(Vec3{far, -far, far}, 0u), {Vec3{0, 0, 0}, 1u}, {Vec3{-1e18f, 0, 1e18f}, 2u}}) {
        std::vector<uint32_t> found;
        grid.for_each_near(p, kRadius,
                           [&](const PointGrid::Entry& e) { found.push_back(e.index); });
        EXPECT_EQ(found, std::vector{index});
    }
}

}  // namespace
}  // namespace etendue
