// Russian roulette of joins: before their weights are known, it ends none that would survive with its weight.

#include <atomic>

#include <gtest/gtest.h>

#include "integrator/bidirectional.h"
#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// Connections that get their weights before roulette or after its first part. Some have factors.
class Joins final : public Integrator {
public:
    Joins(const Scene& scene, bool is_early) : is_early_(is_early) {
        std::vector<float> thresholds(scene.film().pixel_count());
        for (size_t i = 0; i < thresholds.size(); ++i) thresholds[i] = 0.02f * float(1 + i % 7);
        paths_.set_roulette(std::move(thresholds));
    }
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return Bidirectional::counts(scene, light_paths);
    }
    uint64_t light_paths(const Scene& scene) const override { return scene.film().pixel_count(); }
    Estimator estimator() const override { return Estimator::Unbiased; }
    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        paths_.trace_eye_paths(c, counts(c[0].scene, c[0].light_paths), z, stats);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths);
        const SubPath &y = work.y, &z = work.z;
        trace_light_path(paths_.light_walk(c.scene, n, work.stats), c.sampler, work.y);
        const auto roulette = paths_.roulette(c, work);
        for (int t = 2; t <= z.size(); ++t) {
            if (!paths_.is_joinable(z, t)) continue;
            for (int s = 1; s <= y.size(); ++s)
                for (const uint32_t draw : {0u, 1u}) {
                    const float factor = draw == 0 ? 1.0f : 0.3f;
                    if (is_early_)
                        paths_.add_connection(c, n, y, s, t, roulette, work, factor, draw);
                    else
                        paths_.add(c, join_connect(c.scene, y, s, z, t, n), work, factor, draw);
                }
        }
    }

private:
    Bidirectional paths_{{.max_depth = 8, .rr_depth = 3}, 2};
    bool is_early_;
};

struct Result {
    std::vector<Rgb> image;
    RenderStats stats;
};

Result render(const Scene& scene, SamplerKind kind, bool is_early) {
    RenderSettings settings;
    settings.sampler = kind;
    settings.spp = 8;
    Renderer renderer(scene, settings, std::make_unique<Joins>(scene, is_early));
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    return {renderer.film().image(), renderer.stats()};
}

TEST(EarlyRoulette, EndsOnlyJoinsThatWouldEnd) {
    for (const std::string& camera : {front_camera(24), lens_camera(24)}) {
        const Scene scene = build(mixed_room(camera));
        for (const SamplerKind kind : {SamplerKind::Independent, SamplerKind::Sobol}) {
            const Result late = render(scene, kind, false), early = render(scene, kind, true);
            EXPECT_GT(late.stats.joins_skipped, 10'000u);
            EXPECT_EQ(late.stats.joins_skipped, early.stats.joins_skipped);
            EXPECT_EQ(late.stats.shadow_rays, early.stats.shadow_rays);
            ASSERT_EQ(late.image.size(), early.image.size());
            for (size_t i = 0; i < late.image.size(); ++i)
                for (int k = 0; k < 3; ++k)
                    ASSERT_EQ(late.image[i][k], early.image[i][k]) << "pixel " << i;
        }
    }
}

TEST(EarlyRoulette, IsAskedForEachConnection) {
    const Scene scene = build(mixed_room(front_camera(8)));
    const Film film{scene.film(), scene.filter()};
    const TechniqueCounts n = Bidirectional::counts(scene, 64);
    RenderStats stats;
    const WalkContext walk{scene, n, stats, {6, 100}};
    SubPath y, z;
    uint64_t joins = 0;
    for (uint32_t i = 0; i < 2000; ++i) {
        Sampler sampler(SamplerKind::Independent, 5);
        sampler.start(i, i % 64);
        trace_eye_path(walk, film, i % 64, sampler, z);
        trace_light_path(walk, sampler, y);
        for (int t = 2; t <= z.size(); ++t)
            for (int s = 2; s <= y.size(); ++s) {
                joins += join_connect(scene, y, s, z, t, n).has_value();
                const EarlyRoulette all{1e30f, 1, join_number(s, t), sampler, stats};
                EXPECT_FALSE(join_connect(scene, y, s, z, t, n, &all));
            }
    }
    EXPECT_GT(joins, 10'000u);
    EXPECT_EQ(stats.joins_skipped, joins);
}

}  // namespace
}  // namespace etendue::test
