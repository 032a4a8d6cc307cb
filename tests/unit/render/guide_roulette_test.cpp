// What adjoint-driven Russian roulette learns in a room with a partition, and what becomes of walks there.

#include <gtest/gtest.h>

#include "pathspace/walk.h"
#include "render/learned_guide.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr auto kEye = TransportMode::Radiance, kLight = TransportMode::Importance;

struct LearnedRoulette : ::testing::Test {
    static constexpr int kWidth = 192, kPixels = kWidth * kWidth;
    /// The lamp is left of the partition, whose right side it does not see.
    const Scene scene =
        test::build(test::front_camera(kWidth) + test::room() + test::area_lamp() +
                    test::rectangle("<scale x=\"1\" y=\"0.7\"/><rotate y=\"1\" angle=\"90\"/>"
                                    "<translate x=\"0.4\" y=\"-0.3\"/>",
                                    test::diffuse("0.7,0.7,0.7")));
    const Film film{scene.film(), scene.filter()};
    const Guide guide = [&] {
        Guide learned = LearnedGuide(scene, IntegratorSpec::parse("bdpt:guide=on"), 1, 2).guide();
        learned.uses_surfaces = true;  // although directions gain little here
        return learned;
    }();
    /// The same without guided directions.
    const Guide roulette_alone = [&] {
        Guide learned = guide;
        learned.uses_surfaces = false;
        return learned;
    }();

    /// Means over vertices from the third on whose contribution is known.
    struct Walks {
        double vertices = 0, survival = 0;
        double weak = 0;  ///< Number that contribute less than a tenth of the mean.
    };
    template <TransportMode mode>
    Walks trace(const Guide& of_walks) {
        const TechniqueCounts counts{
            .hit = 1, .next_event = 1, .connect = 1, .splat = kPixels, .guide = &of_walks};
        RenderStats stats;
        const WalkContext walk{scene, counts, stats, {12, 1000}};
        SubPath path;
        Walks all;
        for (uint32_t index = 0; index < 4000; ++index) {
            Sampler sampler(SamplerKind::Independent, 3);
            sampler.start(1, index);
            if (mode == kEye)
                trace_eye_path(walk, film, index % kPixels, sampler, path);
            else
                trace_light_path(walk, sampler, path);
            const auto expected = [&](int i) {
                return expected_contribution(path[i], guide.surfaces.cell(path[i].p), mode);
            };
            for (int i = 1; i < path.size() && !of_walks.uses_surfaces; ++i)
                EXPECT_EQ(path[i].guide, nullptr);
            for (int i = 2; i + 1 < path.size(); ++i) {
                const WalkContribution at = expected(i);
                if (!(at.beyond >= 0)) continue;
                const float whole = mode == kEye ? luminance(path[1].beta) * expected(1).here
                                                 : guide.light_contribution;
                ++all.vertices;
                all.survival += double(path[i].survival.value());
                all.weak += luminance(path[i].beta) * at.beyond < 0.1f * whole;
            }
        }
        all.survival /= all.vertices;
        all.weak /= all.vertices;
        return all;
    }
    template <TransportMode mode>
    void expect_fewer_weak_walks(const Guide& with) {
        Guide without = with;
        without.has_roulette = false;
        const Walks plain = trace<mode>(without), chosen = trace<mode>(with);
        ASSERT_GT(plain.vertices, 1000);
        EXPECT_EQ(plain.survival, 1);
        EXPECT_GT(chosen.survival, 0.5);
        EXPECT_LT(chosen.survival, 0.95);
        EXPECT_GT(plain.weak, 0.05);
        EXPECT_LT(chosen.weak, 0.6 * plain.weak);
    }
};

TEST_F(LearnedRoulette, TellsTheSidesOfAWallApart) {
    ASSERT_TRUE(guide.has_roulette);
    EXPECT_GT(guide.light_contribution, 0);
    const GuideCell& cell = guide.surfaces.cell({0.4f, -0.5f, 0});
    const auto& eye = cell.field(kEye).contribution;
    const WalkContribution lit = eye[cube_face({-1, 0, 0})], dark = eye[cube_face({1, 0, 0})];
    ASSERT_GT(dark.here, 0);
    // The cell holds parts of other walls as well.
    EXPECT_GT(lit.here, 1.1f * dark.here);
    EXPECT_GT(lit.here, lit.beyond) << "light that joins there bring";
}

TEST_F(LearnedRoulette, EndsWeakEyeWalks) {
    expect_fewer_weak_walks<kEye>(guide);
}

TEST_F(LearnedRoulette, EndsWeakLightWalks) {
    expect_fewer_weak_walks<kLight>(guide);
}

TEST_F(LearnedRoulette, NeedsNoGuidedDirections) {
    expect_fewer_weak_walks<kEye>(roulette_alone);
    expect_fewer_weak_walks<kLight>(roulette_alone);
}

}  // namespace
}  // namespace etendue
