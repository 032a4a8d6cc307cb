#pragma once
// Contexts of samples and of passes: sub-paths, random numbers, and the destination of contributions.

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "pathspace/sink.h"

namespace etendue {

class LearnedState;

/// Sums that an integrator accumulates during a pass, for later passes; integers, since the order of workers is not
/// fixed.
class PassSums {
public:
    virtual ~PassSums() = default;
    /// For a process that did not make the pass.
    virtual void save(LearnedState& to) const = 0;
    virtual void load(LearnedState& from) = 0;
};

/// Ends a pass that is to be discarded.
struct PassDropped {};

/// Buffers of one worker, reused from sample to sample.
struct Workspace {
    SubPath y, z;
    std::vector<SubPath> eye_paths;  ///< Of further samples.
    /// The stored light path of a merge or gather, or y_0 … y_{s-1} of a specular connection.
    SubPath pair;
    Vertex scratch;
    std::vector<float> masses;  ///< Of light vertices, for one eye vertex.
    bool is_observed =
        false;  ///< Whether whole sub-paths must be restored, for a ContributionObserver.
    RenderStats stats;
    std::unique_ptr<PassSums> sums;  ///< Of the type of the integrator.
    const std::atomic<bool>* drop =
        nullptr;  ///< Whether the pass is to be discarded; nullptr: never.

    /// The light vertices of a path made by the technique; only its first s vertices belong to it.
    const SubPath& light_side(const Technique& q) const {
        return has_own_light_side(q.strategy) ? pair : y;
    }
    /// Throws PassDropped if the pass is to be discarded. What makes many paths for one sample calls it again and again.
    void go_on() const {
        if (drop && drop->load(std::memory_order_relaxed)) throw PassDropped();
    }
};

/// One sample: an eye path, a light path, or both.
struct SampleContext {
    const Scene& scene;
    const Film& film;
    const ExpectedLuminance& expected;  ///< What the samples of a pass know of earlier ones.
    /// Of the sample: its eye path belongs to the film point Film::sample_pixel(index). Sample i is that of pixel i of the
    /// crop. There are further ones outside the crop if the film spreads().
    uint64_t index;
    uint64_t chunk;  ///< Part of the pass, whose samples are processed in order by one thread.
    uint64_t light_paths;  ///< N_L of the pass.
    float splat_scale;     ///< 1 / N_L: factor of splats.
    Sampler& sampler;
    ContributionSink& sink;
    bool is_of_whole_film = false;  ///< The eye path belongs to no pixel.

    /// Whether the film point depends on a number of the sample.
    bool needs_film_number() const { return is_of_whole_film || !film.spreads(); }
    /// Film point of the eye path, and the factor of its contribution.
    Film::PixelSample film_sample(Vec2 u) const {
        return is_of_whole_film ? film.sample_anywhere(u) : film.sample_pixel(index, u);
    }
    /// Expected luminance of the sample's pixel.
    float expected_of_pixel() const { return expected.at(film.pixel_of(index)); }
    /// Index of the light path of this sample; samples share light paths where there are fewer of these.
    uint64_t own_light_path() const { return index % light_paths; }

    /// The same sample with other random numbers and another sink.
    SampleContext with(Sampler& numbers, ContributionSink& to) const {
        return {scene,       film,        expected, index, chunk,
                light_paths, splat_scale, numbers,  to,    is_of_whole_film};
    }
    /// The same sample where `n` light paths are stored.
    SampleContext with_light_paths(uint64_t n) const {
        return {scene, film,         expected, index, chunk,
                n,     1 / float(n), sampler,  sink,  is_of_whole_film};
    }
};

/// Data available before a pass: the scene and the results of the finished passes.
struct LearnContext {
    const Scene& scene;
    const Film& film;
    uint32_t index;             ///< Of the next pass, from 0.
    uint64_t light_paths;       ///< N_L of that pass.
    const RenderStats& so_far;  ///< Of all finished passes; the same for any number of threads.
};

/// Services for an integrator before the samples of a pass.
struct PassContext {
    const Scene& scene;
    const Film& film;
    uint32_t index;        ///< Of the pass, from 0.
    uint64_t light_paths;  ///< N_L.
    uint64_t pixels;
    uint64_t seed;
    /// Calls `use(context, work)` for the samples 0 … count-1 in parallel. Only splats may be added.
    using Use = std::function<void(const SampleContext&, Workspace&)>;
    std::function<void(uint64_t count, const Use& use)> for_each_sample;
    std::function<uint64_t(uint64_t count)> chunks;  ///< Number of chunks for `count` samples.
    /// Calls `task(i, sampler, work)` for i < count in parallel, for paths that do not contribute to the film. The task
    /// must call Sampler::start(). No sample uses the sampler's numbers (pilot_seed()).
    using Task = std::function<void(uint64_t, Sampler&, Workspace&)>;
    std::function<void(uint64_t count, const Task& task)> for_each_other_path;

    /// Calls `task(i, splats, work)` for i < count in parallel, each as a separate task; for Markov chains. If
    /// work.is_observed is set, the task must report the joins to splats.tell().
    using ChainTask = std::function<void(uint64_t, SplatSink&, Workspace&)>;
    std::function<void(uint64_t count, const ChainTask& task)> for_each_chain;
    /// Forgets the statistics of this pass so far; after a resumed rendering has made data of an earlier pass again.
    std::function<void()> forget_statistics = [] {};

    void for_each_light_path(const Use& use) const { for_each_sample(light_paths, use); }
};

}  // namespace etendue
