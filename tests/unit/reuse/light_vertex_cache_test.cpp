// Stored light paths are restored as they were walked.

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "pathspace/walk.h"
#include "random_guide.h"
#include "reuse/light_vertex_cache.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr uint32_t kPaths = 600, kChunks = 7;

class KeptLightPaths : public ::testing::TestWithParam<bool> {  // of guided walks
protected:
    KeptLightPaths() {
        kept.begin(kChunks, LightVertexCache::kVertexBytes, uint64_t(1) << 30, counts.guide);
        for (uint32_t chunk = 0; chunk < kChunks; ++chunk)
            for (uint32_t i = first(chunk); i < first(chunk + 1); ++i) {
                walk(i);
                kept.add(chunk, y);
            }
        kept.assemble();
    }
    static uint32_t first(uint32_t chunk) { return chunk * kPaths / kChunks; }

    /// Light path `index` into `y`, the same each time.
    void walk(uint32_t index) {
        sampler.start(0, index);
        trace_light_path({scene, counts, stats, {8, 3}}, sampler, y);
    }

    /// The walk's ray leaves the predecessor at an offset, see offset_origin(); what is restored looks at the point
    /// itself.
    static float direction_error(const SubPath& path, int i) {
        if (path[i - 1].is_infinite) return 1e-6f;
        const RayEnd from = path[i - 1].ray_end();
        return 1e-6f + length(offset_origin(from, from.ng) - from.p) / length(path[i].p - from.p);
    }

    /// Compares the data of vertex i and of earlier vertices that joins with vertex i read.
    static void expect_same(const SubPath& a, const SubPath& b, int i, bool has_bsdf) {
        SCOPED_TRACE(::testing::Message() << "vertex " << i);
        const Vertex &v = a[i], &w = b[i];
        EXPECT_EQ(v.kind, w.kind);
        for (int axis = 0; axis < 3; ++axis) {
            EXPECT_EQ(v.p[axis], w.p[axis]);
            EXPECT_EQ(v.beta[axis], w.beta[axis]);
        }
        EXPECT_EQ(v.pdf_fwd, w.pdf_fwd);
        EXPECT_EQ(v.is_infinite, w.is_infinite);
        EXPECT_EQ(v.has_cosine, w.has_cosine);
        EXPECT_EQ(v.is_connectible, w.is_connectible);
        EXPECT_EQ(v.is_delta, w.is_delta);
        EXPECT_EQ(v.gloss, w.gloss);
        EXPECT_EQ(v.medium, w.medium);
        EXPECT_EQ(v.survival.steps(), w.survival.steps());
        EXPECT_EQ(v.guide, w.guide);
        if (i == 0) {
            EXPECT_EQ(v.emitter, w.emitter);
            for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(v.ng[axis], w.ng[axis]);
            return;
        }
        EXPECT_EQ(v.to_predecessor, w.to_predecessor);
        EXPECT_NEAR(v.weight_sum, w.weight_sum, 1e-6 * v.weight_sum);
        EXPECT_EQ(v.pair_level, w.pair_level);
        if (v.guide) {
            EXPECT_EQ(v.guide_rev, w.guide_rev);
        }
        if (i == 1) {
            EXPECT_EQ(v.next_event_ratio, w.next_event_ratio);
        }
        if (!has_bsdf) return;
        EXPECT_EQ(v.shape, w.shape);
        EXPECT_EQ(v.emitter, w.emitter);
        const float error = direction_error(a, i);
        for (int axis = 0; axis < 3; ++axis) {
            EXPECT_EQ(v.ng[axis], w.ng[axis]);
            EXPECT_NEAR(v.wo[axis], w.wo[axis], error);
        }
        const Vec3 wi = normalize(v.ng + Vec3{0.3f, -0.2f, 0.1f});
        const BsdfEval f = v.eval(wi, TransportMode::Importance),
                       g = w.eval(wi, TransportMode::Importance);
        EXPECT_NEAR(f.pdf, g.pdf, 1e-6f + (1e-4f + 100 * error) * f.pdf);
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(f.f[c], g.f[c], 1e-6f + (1e-4f + 100 * error) * f.f[c]);
    }

    const Scene scene = test::build(
        test::mixed_room(test::front_camera(8)) +
        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.5\"/></emitter>"
        "<emitter type=\"point\"><point name=\"position\" value=\"0,0.7,0.5\"/></emitter>");
    /// Lobes wide enough that the offset of a ray hardly changes densities.
    const Guide guide =
        test::random_guide(scene.bounds().center(), scene.bounds().radius(), {1, 1, 1}, {}, 5, 7);
    const TechniqueCounts counts{.hit = 1,
                                 .next_event = 1,
                                 .connect = 1,
                                 .splat = 64,
                                 .guide = GetParam() ? &guide : nullptr};
    Sampler sampler{SamplerKind::Independent, 9};
    RenderStats stats;
    SubPath y, restored;
    LightVertexCache kept;
};

TEST_P(KeptLightPaths, AreRestored) {
    ASSERT_EQ(kept.size(), kPaths);
    uint32_t vertex = 0;
    for (uint32_t path = 0; path < kPaths; ++path) {
        SCOPED_TRACE(::testing::Message() << "path " << path);
        walk(path);
        kept.restore(scene, path, restored);
        ASSERT_EQ(restored.size(), y.size());
        for (int i = 0; i < y.size(); ++i) expect_same(y, restored, i, true);
        for (int i = 1; i < y.size(); ++i, ++vertex) {
            EXPECT_EQ(kept.vertices()[vertex].path, path);
            EXPECT_EQ(kept.depth(vertex), i);
            const Photon photon = kept.photon(vertex);
            EXPECT_EQ(photon.s, i + 1);
            EXPECT_EQ(photon.emitter, y[0].emitter);
            for (int axis = 0; axis < 3; ++axis) {
                EXPECT_EQ(photon.p[axis], y[i].p[axis]);
                EXPECT_EQ(photon.power[axis], y[i].beta[axis]);
                EXPECT_NEAR(photon.wi[axis], y[i].wo[axis], direction_error(y, i));
            }
            bool by_delta_events = true;
            for (int j = 1; j < i; ++j) by_delta_events &= y[j].is_delta;
            EXPECT_EQ(kept.came_by_delta_events(vertex), by_delta_events);
        }
        if (HasFailure()) return;
    }
    EXPECT_EQ(vertex, kept.vertices().size());
    EXPECT_GT(vertex, kPaths);
    walk(0);
    EXPECT_EQ(y[0].guide != nullptr || y[0].is_infinite, GetParam() || y[0].is_infinite);
}

TEST_P(KeptLightPaths, AreRestoredUpToAVertex) {
    for (uint32_t vertex = 0; vertex < kept.vertices().size(); ++vertex)
        for (const bool whole : {false, true}) {
            const int size = kept.depth(vertex) + 1;
            SCOPED_TRACE(::testing::Message() << "vertex " << vertex << ", whole: " << whole);
            walk(kept.vertices()[vertex].path);
            kept.restore_first(scene, vertex, size, whole, restored);
            ASSERT_EQ(restored.size(), size);
            for (int i = 0; i < size; ++i)
                if (i == 0 || whole || i >= size - 3) expect_same(y, restored, i, i == size - 1);
            if (HasFailure()) return;
        }
}

/// N_L² times the fourth power of a ratio of densities: more than a float can hold.
TEST_P(KeptLightPaths, KeepLargeSumsOfWeights) {
    constexpr double kSum = 1e60;
    walk(1);
    ASSERT_GT(y.size(), 1);
    y[1].weight_sum = kSum;
    LightVertexCache one;
    one.begin(1, LightVertexCache::kVertexBytes, uint64_t(1) << 30);
    one.add(0, y);
    one.assemble();
    one.restore(scene, 0, restored);
    EXPECT_NEAR(restored[1].weight_sum, kSum, 1e-6 * kSum);
}

INSTANTIATE_TEST_SUITE_P(Walks, KeptLightPaths, ::testing::Bool(),
                         [](const auto& p) { return p.param ? "guided" : "unguided"; });

/// Where light paths have a guide of emission alone, their vertices need no memory for it.
TEST(KeptLightPathsOfEmission, NeedNoMemoryForTheGuide) {
    const Scene scene = test::build(test::front_camera(8) + test::room() + test::area_lamp());
    Guide guide = test::random_guide({}, 1, {1}, {}, 5, 7);
    const auto add_path = [&] {
        const TechniqueCounts counts{.hit = 1, .connect = 1, .guide = &guide};
        Sampler sampler(SamplerKind::Independent, 9);
        RenderStats stats;
        SubPath y;
        uint32_t index = 0;
        while (y.size() < 3) {
            sampler.start(0, index++);
            trace_light_path({scene, counts, stats, {3, 3}}, sampler, y);
        }
        LightVertexCache cache;
        cache.begin(1, LightVertexCache::kVertexBytes, 3 * LightVertexCache::kVertexBytes, &guide);
        cache.add(0, y);
    };
    EXPECT_THROW(add_path(), std::runtime_error);
    guide.uses_surfaces = false;
    EXPECT_NO_THROW(add_path());
}

}  // namespace
}  // namespace etendue
