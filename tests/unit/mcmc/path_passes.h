#pragma once
// Spaces of paths over a scene, and the context in which states are evaluated, without threads.

#include "mcmc/path_space.h"
#include "mcmc/whole_film.h"
#include "pathspace/eye_paths.h"
#include "pathspace/join.h"

namespace etendue::test {

class PathPasses {
public:
    static constexpr int kShortest = 3, kLongest = 7;

    explicit PathPasses(Scene scene)
        : scene_(std::move(scene)), film_(scene_.film(), scene_.filter()) {}

    const Scene& scene() const { return scene_; }
    Workspace& work() { return work_; }
    PathMeasure measure() const {
        return {scene_, reached_region(scene_.film(), scene_.filter()), kShortest, kLongest};
    }
    TechniqueCounts counts() const {
        const float N = float(scene_.film().pixel_count());
        return {.hit = 1,
                .next_event = 1,
                .connect = 1,
                .splat = N,
                .hit_lens = scene_.sensor().has_finite_lens() ? N : 0.0f};
    }
    /// Samples of bidirectional path tracing over the lengths of states, without roulette.
    WeighedSample samples(const Guide* guide = nullptr) const {
        TechniqueCounts guided = counts();
        guided.guide = guide;
        return {[n = guided](int, const SampleContext& c, Workspace& work) {
                    const auto add = [&](const std::optional<Join>& j) {
                        if (!j || j->technique.vertices() <= kShortest ||
                            j->technique.vertices() > kLongest + 1)
                            return;
                        const float Tr = visibility(c.scene, *j, work.stats);
                        if (Tr > 0) c.sink.add(*j, j->contribution * Tr);
                    };
                    const WalkContext walk{c.scene, n, work.stats, {kLongest + 1, 1000}};
                    SubPath &y = work.y, &z = work.z;
                    trace_eye_path(walk, c, z);
                    if (start_light_path(walk, c.sampler, y))
                        for (int s = 1; s <= y.size(); ++s) {
                            add(join_splat(c.scene, y, s, c.sampler, n));
                            if (s >= 2) extend<TransportMode::Importance>(walk, c.sampler, y);
                            add(join_hit_lens(c.scene, y, s, n));
                        }
                    for (int t = 2; t <= z.size(); ++t) {
                        for_each_hit(c.scene, z, t, n, add);
                        if (!z[t - 1].is_connectible) continue;
                        add(join_next_event(c.scene, z, t, c.sampler, n));
                        for (int s = 2; s <= y.size(); ++s)
                            add(join_connect(c.scene, y, s, z, t, n));
                    }
                },
                TargetMap(scene_.film())};
    }
    /// With uniform choices of length and technique, and W = 1.
    std::unique_ptr<PathSpace> space(const PathMutations& mutations,
                                     const UserSteps& user = {}) const {
        return space(mutations, weighted_luminance(TargetMap(scene_.film())), user);
    }
    std::unique_ptr<PathSpace> space(const PathMutations& mutations,
                                     const PathImportance& importance, const UserSteps& user = {},
                                     const Guide* guide = nullptr) const {
        return std::make_unique<PathSpace>(
            PathTarget{measure(), importance, LengthChoice(kShortest, kLongest, {}),
                       TechniqueChoice(scene_, kShortest, 8, {}), user},
            mutations, counts(), samples(guide));
    }
    PassContext pass() const {
        return {.scene = scene_,
                .film = film_,
                .index = 0,
                .light_paths = 1,
                .pixels = scene_.film().pixel_count(),
                .seed = 1,
                .for_each_sample = {},
                .chunks = {},
                .for_each_other_path = {},
                .for_each_chain = {}};
    }

private:
    Scene scene_;
    Film film_;
    Workspace work_;
};

}  // namespace etendue::test
