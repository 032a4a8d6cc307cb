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
        return space(mutations, weighted_luminance(TargetMap(scene_.film())), user);
    }
    std::unique_ptr<PathSpace> space(const PathMutations& mutations,
                                     const PathImportance& importance,
                                     const UserSteps& user = {}) const {
        const float N = float(scene_.film().pixel_count());
        const TechniqueCounts counts{.hit = 1,
                                     .next_event = 1,
                                     .connect = 1,
                                     .splat = N,
                                     .hit_lens = scene_.sensor().has_finite_lens() ? N : 0.0f};
        return std::make_unique<PathSpace>(
            PathTarget{measure(), importance, LengthChoice(kShortest, kLongest, {}),
                       TechniqueChoice(scene_, kShortest, 8, {}), user},
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
