#pragma once
// What a sample, and a pass of samples, is made of: sub-paths, random numbers, and where contributions go.

#include <functional>
#include <memory>
#include <vector>

#include "pathspace/sink.h"

namespace etendue {

/// What an integrator adds up during a pass, for later ones: whole numbers, since workers add in no fixed order.
class PassSums {
public:
    virtual ~PassSums() = default;
};

/// Buffers of one worker, reused from sample to sample.
struct Workspace {
    SubPath y, z;
    SubPath pair;  ///< The other path of a pair of vertices.
    Vertex scratch;
    std::vector<float> masses;  ///< Of light vertices, seen from one eye vertex.
    bool is_observed = false;   ///< Whole sub-paths are read, not only what joins need of them.
    RenderStats stats;
    std::unique_ptr<PassSums> sums;  ///< Of the integrator's kind.
};

/// One sample: the eye path of a pixel, a light path, or both.
struct SampleContext {
    const Scene& scene;
    const Film& film;
    uint64_t pixel;        ///< Index within the crop.
    uint64_t chunk;        ///< Part of the pass; its samples are taken in order by one thread.
    uint64_t light_paths;  ///< N_L of the pass.
    float splat_scale;     ///< 1 / N_L: what a splat is worth on the film.
    Sampler& sampler;
    ContributionSink& sink;

    /// The light path that belongs to the pixel; some belong to several, where there are fewer than pixels.
    uint64_t own_light_path() const { return pixel % light_paths; }

    /// The same sample with other numbers, and contributions to `to`.
    SampleContext with(Sampler& numbers, ContributionSink& to) const {
        return {scene, film, pixel, chunk, light_paths, splat_scale, numbers, to};
    }
};

/// What is known before a pass: the scene, and what the finished passes left.
struct LearnContext {
    const Scene& scene;
    const Film& film;
    uint32_t index;             ///< Of the pass that will be traced, from 0.
    uint64_t light_paths;       ///< N_L of that pass.
    const RenderStats& so_far;  ///< Of all finished passes; the same for any number of threads.
};

/// What an integrator may do before the samples of a pass.
struct PassContext {
    const Scene& scene;
    const Film& film;
    uint32_t index;        ///< Of the pass, from 0.
    uint64_t light_paths;  ///< N_L.
    uint64_t pixels;
    /// Calls `use(context, work)` for the samples 0 … count-1 in parallel. Only splats may be added.
    using Use = std::function<void(const SampleContext&, Workspace&)>;
    std::function<void(uint64_t count, const Use& use)> for_each_sample;
    std::function<uint64_t(uint64_t count)> chunks;  ///< That so many samples are cut into.
    /// Calls `task(i, sampler, work)` for i < count in parallel: paths that bring nothing to the film. The task starts the
    /// sampler; paths from the number of pixels on have numbers of their own.
    using Task = std::function<void(uint64_t, Sampler&, Workspace&)>;
    std::function<void(uint64_t count, const Task& task)> for_each_other_path;

    void for_each_light_path(const Use& use) const { for_each_sample(light_paths, use); }
};

}  // namespace etendue
