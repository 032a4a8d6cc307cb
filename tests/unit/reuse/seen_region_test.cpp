// Regions of Bernoulli trials: their density and bounds, and that they contain the slab.

#include "reuse/seen_region.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "random.h"
#include "reuse/arrival_side.h"

namespace etendue {
namespace {

constexpr float kRegionRadius = 0.3f;
const Vec3 kNormal = normalize(Vec3{0.3f, -0.5f, 0.8f});

struct Viewer {
    float height, foot, half_height;
};
/// From straight above to almost in the plane, and in it.
const Viewer kAbove[] = {
    {1, 0, 0.006f}, {0.4f, 0.2f, 0.006f}, {0.1f, 0.9f, 0.01f}, {0.03f, 0.1f, 0.01f}};
const Viewer kAnywhere[] = {{1, 0, 0.006f},       {0.4f, 0.9f, 0.03f},    {0.01f, 0.1f, 0.006f},
                            {0.02f, 1.5f, 0.01f}, {0.002f, 0.5f, 0.006f}, {0, 0.2f, 0.01f}};

SlabView view_of(const Viewer& v) {
    const Frame frame = Frame::from_normal(kNormal);
    return {frame.s * (0.6f * v.foot) + frame.t * (0.8f * v.foot) - kNormal * v.height, kNormal,
            kRegionRadius, v.half_height};
}
float cosine_pdf(Vec3 n, Vec3 d) {
    return std::max(0.0f, dot(n, d)) * kInvPi;
}

/// ∫ of a density over a region, by its map.
template <class Region, class Pdf>
double integral(const Region& region, const Pdf& pdf) {
    constexpr int kSteps = 400;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i)
        for (int j = 0; j < kSteps; ++j) {
            const RegionPoint q =
                region.at({(float(i) + 0.5f) / kSteps, (float(j) + 0.5f) / kSteps});
            sum += double(pdf(q.d) * q.scale);
        }
    return sum * region.measure() / (kSteps * kSteps);
}

TEST(SeenDisc, CosineMassIsTheIntegral) {
    for (const Viewer& v : kAbove) {
        const SlabView view = view_of(v);
        const SeenDisc disc(view);
        int above = 0;
        for (const Vec3 n : {view.frame.n, normalize(view.frame.n + view.frame.s * 0.5f),
                             normalize(view.frame.s * view.center.x + view.frame.t * view.center.y +
                                       view.frame.n * 0.02f)}) {
            const double mass = disc.cosine_mass(n);
            if (mass == 0) continue;
            ++above;
            EXPECT_NEAR(integral(disc, [&](Vec3 d) { return cosine_pdf(n, d); }) / mass, 1, 2e-3)
                << "height " << v.height << ", foot " << v.foot;
        }
        EXPECT_GE(above, 1);
        EXPECT_EQ(disc.cosine_mass(-view.frame.n), 0);
    }
}

/// Compares |∂d/∂u × ∂d/∂v|, the ratio of solid angle to area in the unit square, with RegionPoint::scale.
template <class Region>
void expect_jacobian(const Region& region) {
    constexpr float kStep = 1e-3f;
    testing::Random random(2);
    for (int i = 0; i < 100; ++i) {
        const Vec2 u{random.between(0.01f, 0.99f), random.between(0.01f, 0.99f)};
        const float a = 2 * u.x - 1, b = 2 * u.y - 1;
        // The disc's map has creases there.
        if (std::fabs(std::fabs(a) - std::fabs(b)) < 0.02f) continue;
        const auto slope = [&](Vec2 step) {
            return (region.at(u + step).d - region.at(u - step).d) / (2 * kStep);
        };
        const double jacobian = double(length(cross(slope({kStep, 0}), slope({0, kStep}))));
        EXPECT_NEAR(jacobian / (double(region.at(u).scale) * region.measure()), 1, 0.03);
    }
}

TEST(SeenRegions, HaveTheStatedScale) {
    for (const Viewer& v : kAbove) expect_jacobian(SeenDisc(view_of(v)));
    for (const Viewer& v : kAnywhere) expect_jacobian(SeenBand(view_of(v)));
}

/// Directions to points of the slab are in the region: the cells of a fine division contain them.
template <class Region>
void expect_holds(const Region& region, const SlabView& view, const char* what) {
    constexpr int kCells = 40;
    testing::Random random(3);
    std::vector<RegionPart> parts;
    for (int i = 0; i < kCells * kCells; ++i)
        parts.push_back(region.part({float(i % kCells) / kCells, float(i / kCells) / kCells},
                                    {1.0f / kCells, 1.0f / kCells}));
    for (int i = 0; i < 400; ++i) {
        const Vec3 q{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)};
        const Vec3 v{view.center.x + q.x * view.radius, view.center.y + q.y * view.radius,
                     view.height + q.z * view.half_height};
        if (q.x * q.x + q.y * q.y > 0.99f) continue;
        const Vec3 d = normalize(view.frame.to_world(v));
        bool holds = false;
        for (const RegionPart& part : parts)
            holds = holds || dot(d, part.cone.axis) > std::cos(part.cone.angle) - 1e-5f;
        EXPECT_TRUE(holds) << what << ": height " << view.height << ", foot " << view.foot;
        if (!holds) return;
    }
}

TEST(SeenRegions, ContainTheSlab) {
    for (const Viewer& v : kAbove) expect_holds(SeenDisc(view_of(v)), view_of(v), "disc");
    for (const Viewer& v : kAnywhere) expect_holds(SeenBand(view_of(v)), view_of(v), "band");
}

/// A sharp lobe about an axis.
struct Lobe {
    Vec3 axis;
    float operator()(Vec3 d) const { return std::pow(std::max(0.0f, dot(d, axis)), 20.0f); }
    float max(const DirectionCone& c) const { return std::pow(c.max_cos(axis), 20.0f); }
};

template <class Region>
void expect_bounded(const Region& region, const SlabView& view) {
    const Lobe lobe{
        normalize(view.frame.to_world({view.center.x + 0.2f, view.center.y, view.height + 0.1f}))};
    const BoundedCells cells(
        region, [&](const DirectionCone& c) { return lobe.max(c); }, 0);
    testing::Random random(4);
    const double mass = integral(region, lobe);
    EXPECT_GT(cells.mass(), mass * 0.999);
    double accepted = 0;
    constexpr int kDraws = 20000;
    for (int i = 0; i < kDraws; ++i) {
        const auto choice = cells.choose(random.next_1d(), {random.next_1d(), random.next_1d()});
        const RegionPoint q = region.at(choice.u);
        const float density = lobe(q.d) * q.scale;
        EXPECT_LE(density, choice.bound * (1 + 1e-4f));
        accepted += double(density / choice.bound) / kDraws;
    }
    if (!std::isfinite(cells.mass())) return;
    EXPECT_NEAR(accepted * cells.mass() / mass, 1, 0.05);
}

TEST(BoundedCells, BoundAndFollowTheDensity) {
    for (const Viewer& v : kAbove) expect_bounded(SeenDisc(view_of(v)), view_of(v));
    for (const Viewer& v : kAnywhere) expect_bounded(SeenBand(view_of(v)), view_of(v));
}

TEST(ArrivalSide, KeepsADirectionToADegree) {
    testing::Random random(5);
    for (int i = 0; i < 10000; ++i) {
        const Vec3 n =
            normalize(Vec3{random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)});
        const ArrivalSide side(n, i % 2);
        EXPECT_GT(dot(side.normal(), n), std::cos(0.025f));
        EXPECT_EQ(side.is_transmissive(), bool(i % 2));
        EXPECT_EQ(ArrivalSide::from_bits(side.bits()).bits(), side.bits());
    }
}

TEST(ArrivalSide, AdmitsItsOwnUnlessLightPasses) {
    const ArrivalSide up({0, 0, 1}, false), tilted(normalize(Vec3{1, 0, 1}), false),
        down({0, 0, -1}, false), glass({0, 0, 1}, true);
    EXPECT_TRUE(up.admits(up) && up.admits(tilted) && tilted.admits(up));
    EXPECT_FALSE(up.admits(down) || down.admits(up) || down.admits(glass));
    EXPECT_TRUE(glass.admits(down) && glass.admits(up));
    EXPECT_EQ(up.normal().z, 1);
    // Right angles are exact: neither admits the other.
    const Vec3 axes[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (const Vec3 a : axes)
        for (const Vec3 b : axes)
            EXPECT_EQ(ArrivalSide(a, false).admits(ArrivalSide(b, false)), dot(a, b) > 0);
}

}  // namespace
}  // namespace etendue
