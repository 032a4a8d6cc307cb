#pragma once
// Spaces of paths over a scene, and the context in which states are evaluated, without threads.

#include "mcmc/path_space.h"
#include "mcmc/whole_film.h"

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
    /// With uniform choices of length and technique, and W = 1.
    std::unique_ptr<PathSpace> space(const PathMutations& mutations,
                                     const UserSteps& user = {}) const {
        const bool hits_lens = scene_.sensor().has_finite_lens();
        bool hits = false;
        for (const auto& e : scene_.emitters()) hits |= !e->is_delta();
        const Pilot pilot{.map = TargetMap(scene_.film()), .by_technique = {}};
        const float N = float(scene_.film().pixel_count());
        const TechniqueCounts counts{
            .hit = 1, .next_event = 1, .connect = 1, .splat = N, .hit_lens = hits_lens ? N : 0.0f};
        return std::make_unique<PathSpace>(
            PathTarget{measure(), weighted_luminance(pilot.map),
                       LengthChoice(kShortest, kLongest, pilot),
                       TechniqueChoice(kShortest, 8, hits, hits_lens, pilot), user},
            mutations, counts);
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
