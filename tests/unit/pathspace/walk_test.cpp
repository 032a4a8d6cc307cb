// Russian roulette of walks: the throughput of a surviving walk is that without roulette, divided by the probability of
// survival.
// Also: walks that meet a surface edge-on.

#include <gtest/gtest.h>

#include "pathspace/walk.h"
#include "test_scenes.h"

namespace etendue {
namespace {

struct Walks : ::testing::Test {
    const Scene scene = test::build(test::mixed_room(test::front_camera(8)));
    const Film film{scene.film(), scene.filter()};
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .connect = 1, .splat = 64};
    RenderStats stats;

    /// A sub-path of the same numbers with any options.
    template <TransportMode mode>
    void walk(uint32_t index, const WalkOptions& options, SubPath& path) {
        Sampler sampler(SamplerKind::Independent, 3);
        sampler.start(index, index % 64);
        const WalkContext context{scene, counts, stats, options};
        if (mode == TransportMode::Radiance)
            trace_eye_path(context, film, index % 64, sampler, path);
        else
            trace_light_path(context, sampler, path);
    }

    template <TransportMode mode>
    void expect_expected_throughput() {
        constexpr int kFirst = 2, kVertices = 7;
        double survived = 0, expected = 0, variance = 0;
        SubPath with, without;
        for (uint32_t index = 0; index < 20000; ++index) {
            walk<mode>(index, {kVertices, kFirst}, with);
            walk<mode>(index, {kVertices, 1000}, without);
            ASSERT_LE(with.size(), without.size());
            double q = 1;
            for (int i = 0; i < with.size(); ++i) {
                const Rgb a = with[i].beta, b = without[i].beta;
                for (int c = 0; c < 3; ++c)
                    ASSERT_NEAR(a[c] * q, b[c], 1e-4 * std::fabs(b[c])) << "vertex " << i;
                if (i < kFirst || with[i].kind != Vertex::Kind::Surface) continue;
                q *= double(with[i].survival.value());
                // A walk that ends here is ended by roulette if the walk without roulette continues.
                if (i + 1 == without.size()) continue;
                const double survival = double(with[i].survival.value());
                survived += i + 1 < with.size();
                expected += survival;
                variance += survival * (1 - survival);
            }
        }
        EXPECT_GT(variance, 1000) << "roulette hardly plays";
        EXPECT_LT(std::fabs(survived - expected), 4 * std::sqrt(variance))
            << survived << " survived, expected " << expected;
    }
};

TEST_F(Walks, RouletteKeepsTheExpectedThroughputOfEyePaths) {
    expect_expected_throughput<TransportMode::Radiance>();
}

TEST_F(Walks, RouletteKeepsTheExpectedThroughputOfLightPaths) {
    expect_expected_throughput<TransportMode::Importance>();
}

/// A unit sphere before a sky, which a ray along -x meets at the height `z`.
struct Grazing : ::testing::Test {
    const Scene scene = test::build(
        test::front_camera(8) + test::sphere("0,0,0", "1", test::diffuse("0.5,0.5,0.5")) +
        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1,1,1\"/></emitter>");
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .connect = 1, .splat = 64};
    RenderStats stats;
    SubPath path;

    bool append_at(float z) {
        path.clear();
        Vertex& v = path.append();
        v.kind = Vertex::Kind::Sensor;
        v.p = {5, 0, z};
        v.ng = {-1, 0, 0};
        v.beta = Rgb(1);
        Sampler sampler(SamplerKind::Independent, 1);
        sampler.start(0, 0);
        return append<TransportMode::Radiance>({scene, counts, stats, {}}, sampler,
                                               {.wi = {-1, 0, 0}, .weight = Rgb(1), .pdf = 1},
                                               path);
    }
};

TEST_F(Grazing, ASurfaceMetEdgeOnEndsTheWalk) {
    ASSERT_TRUE(append_at(0.5f));
    EXPECT_EQ(path[1].kind, Vertex::Kind::Surface);
    EXPECT_GT(path[1].pdf_fwd, 0);

    EXPECT_FALSE(append_at(1)) << "the density of a vertex there is 0";
    EXPECT_EQ(path.size(), 1);
    EXPECT_LT(path.flight.length, kInf) << "the sky does not shine through";

    ASSERT_TRUE(append_at(1.5f));
    EXPECT_TRUE(path[1].is_infinite);
}

}  // namespace
}  // namespace etendue
