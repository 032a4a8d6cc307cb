// Adjoint-driven Russian roulette of guided walks: its survival, by the contributions given, and the throughput of walks
// that survive.

#include <gtest/gtest.h>

#include "guide/guide.h"
#include "modes.h"
#include "pathspace/walk.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr float kLightContribution = 3;

/// One cell without lobes, whose contributions differ by mode and side; unknown on the ceiling.
Guide guide_of_contributions() {
    GuideCell cell;
    for (const auto mode : {kEye, kLight})
        for (size_t k = 0; k < kCubeFaces; ++k)
            cell.fields[size_t(mode)].contribution[k] = {
                0.5f + 0.1f * float(k), (mode == kEye ? 0.02f : 0.01f) * float(1 + k * k)};
    for (GuideCell::Field& field : cell.fields) field.contribution[cube_face({0, -1, 0})] = {};
    Guide guide;
    guide.surfaces = GuideTree(cell);
    guide.has_roulette = true;
    guide.light_contribution = kLightContribution;
    return guide;
}

class GuidedRoulette : public ::testing::Test {
protected:
    template <TransportMode mode>
    void walk(uint32_t index, int rr_depth, const Guide* guide, SubPath& path) {
        const TechniqueCounts counts{
            .hit = 1, .next_event = 1, .connect = 1, .splat = 64, .guide = guide};
        Sampler sampler(SamplerKind::Independent, 3);
        sampler.start(index, index % 64);
        const WalkContext context{scene, counts, stats, {kVertices, rr_depth}};
        if (mode == kEye)
            trace_eye_path(context, film, index % 64, sampler, path);
        else
            trace_light_path(context, sampler, path);
    }

    /// The contribution at a vertex, by the side from which the walk came.
    static WalkContribution at(const Vertex& v, const Guide& guide, TransportMode mode) {
        const Vec3 n = dot(v.ng, v.wo) > 0 ? v.ng : -v.ng;
        int axis = 0;
        for (int i = 1; i < 3; ++i)
            if (std::fabs(n[i]) > std::fabs(n[axis])) axis = i;
        const size_t face = 2 * size_t(axis) + (n[axis] < 0 ? 1 : 0);
        return guide.surfaces.cell(v.p).fields[size_t(mode)].contribution[face];
    }

    template <TransportMode mode>
    void expect_survival_by_contribution() {
        const Guide guide = guide_of_contributions();
        SubPath with, without;
        int by_contribution = 0, by_throughput = 0;
        double survived = 0, expected = 0, variance = 0;
        for (uint32_t index = 0; index < 20000; ++index) {
            walk<mode>(index, kLate, &guide, with);
            walk<mode>(index, 1000, nullptr, without);
            ASSERT_LE(with.size(), without.size());
            double q = 1;
            float reference = mode == kEye ? 0.0f : kLightContribution;
            bool is_first = mode == kEye;
            for (int i = 0; i < with.size(); ++i) {
                const Vertex& v = with[i];
                for (int c = 0; c < 3; ++c)
                    ASSERT_NEAR(v.beta[c] * q, without[i].beta[c],
                                1e-4 * std::fabs(without[i].beta[c]))
                        << "vertex " << i;
                if (i == 0 || i + 1 == kVertices || v.kind != Vertex::Kind::Surface) continue;
                const float survival = v.survival.value();
                q *= double(survival);
                const WalkContribution c = at(v, guide, mode);
                const bool is_known = v.is_connectible && c.beyond >= 0;
                if (v.is_connectible && is_first) {
                    reference = is_known ? luminance(v.beta) * c.here : 0.0f;
                    is_first = false;
                }
                if (is_known && reference > 0 && guide_class(v.gloss) < kGuideClasses - 1) {
                    const float most = i < kLate ? 1.0f : 0.95f;
                    ASSERT_NEAR(survival,
                                clamp(3 * luminance(v.beta) * c.beyond / reference, 0.1f, most),
                                0.002f)
                        << "vertex " << i;
                    by_contribution += survival < most;
                } else if (i < kLate) {
                    ASSERT_EQ(survival, 1) << "vertex " << i;
                } else {
                    ++by_throughput;
                }
                if (i + 1 == without.size()) continue;
                survived += i + 1 < with.size();
                expected += double(survival);
                variance += double(survival * (1 - survival));
            }
        }
        EXPECT_GT(by_contribution, 1000);
        EXPECT_GT(by_throughput, 100);
        EXPECT_LT(std::fabs(survived - expected), 4 * std::sqrt(variance))
            << survived << " survived, expected " << expected;
    }

    static constexpr int kVertices = 7, kLate = 3;
    const Scene scene = test::build(test::mixed_room(test::front_camera(8)));
    const Film film{scene.film(), scene.filter()};
    RenderStats stats;
};

TEST_F(GuidedRoulette, OfEyePathsFollowsTheirContributions) {
    expect_survival_by_contribution<kEye>();
}

TEST_F(GuidedRoulette, OfLightPathsFollowsTheirContributions) {
    expect_survival_by_contribution<kLight>();
}

TEST_F(GuidedRoulette, IsNoneInWalksWithoutRoulette) {
    const Guide guide = guide_of_contributions();
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .guide = &guide};
    const WalkContext context{
        scene, counts, stats, {.max_vertices = kVertices, .rr_depth = 2, .has_roulette = false}};
    SubPath path;
    for (uint32_t index = 0; index < 1000; ++index) {
        Sampler sampler(SamplerKind::Independent, 3);
        sampler.start(index, index % 64);
        trace_eye_path(context, film, index % 64, sampler, path);
        for (int i = 1; i < path.size(); ++i) ASSERT_EQ(path[i].survival.value(), 1) << i;
    }
}

TEST_F(GuidedRoulette, UnknownContributionsChangeNothing) {
    Guide unknown = guide_of_contributions();
    GuideCell cell;
    unknown.surfaces = GuideTree(cell);
    SubPath a, b;
    for (uint32_t index = 0; index < 1000; ++index) {
        walk<kEye>(index, 2, &unknown, a);
        walk<kEye>(index, 2, nullptr, b);
        ASSERT_EQ(a.size(), b.size());
        for (int i = 1; i < a.size(); ++i) {
            ASSERT_EQ(a[i].survival.steps(), b[i].survival.steps());
            ASSERT_EQ(a[i].beta.max(), b[i].beta.max());
        }
    }
}

}  // namespace
}  // namespace etendue
