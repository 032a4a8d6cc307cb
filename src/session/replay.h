#pragma once
// The paths that contributed to a pixel, traced again. Random numbers have addresses, so nothing is recorded during the
// rendering. What pixels share, such as light paths, is not traced again: a method that shares data has those of one pass,
// the last one or that in flight.

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "integrator/integrator.h"
#include "render/renderer.h"

namespace etendue {

struct ReplayRequest {
    IntegratorSpec integrator;
    SamplerKind sampler = SamplerKind::Sobol;
    FilterMode filter_mode = FilterMode::Spread;
    uint64_t seed = 0;
    uint64_t pixel = 0;  ///< Index within the crop.
    uint32_t first_pass = 0, passes = 1;
    bool splats = false;  ///< Whether to trace the light paths of the first pass as well.
    size_t most_paths = 10000;
    double seconds = 2;  ///< Time limit.
};

struct ReplayedPath {
    struct Point {
        Vec3 p;  ///< Position; if `is_infinite`, the direction toward it.
        char event =
            'D';  ///< L on the emitter, S at a delta event, D at other surfaces, E on the lens.
        bool is_infinite = false;
    };
    std::vector<Point> points;  ///< From the emitter to the lens.
    Technique technique;
    uint32_t pass;
    float mis_weight;
    Rgb value;  ///< Its weighted contribution to the pixel in this pass.
};

struct Replay {
    std::vector<ReplayedPath> paths;  ///< Paths with a contribution, by luminance.
    Rgb sum;                   ///< Sum of all contributions with t ≥ 2, also of paths left out.
    uint32_t passes = 0;       ///< Number of passes that were traced.
    uint64_t light_paths = 0;  ///< Number of light paths that were traced for splats.
    size_t left_out = 0;       ///< Number of paths beyond `most_paths`.
};

/// Which passes of an integrator can be traced again.
enum class ReplayedPasses {
    Any,
    Whole,  ///< As a whole, since pixels share data, or paths depend on what was learned: see replay_pass().
    None,  ///< Paths are states of Markov chains, or are not kept.
};
ReplayedPasses replayed_passes(const IntegratorSpec& integrator, const Scene& scene);
/// Joins pass no Russian roulette before shadow rays. The sum therefore agrees with the image on average, and exactly if
/// the image was rendered with roulette=0. Throws std::runtime_error unless any pass can be traced again.
Replay replay(const Scene& scene, const ReplayRequest& request);
/// A pass of a run of which only passes as a whole can be traced again.
struct PassOfRun {
    std::shared_ptr<const Scene> scene;
    RenderSettings settings;
    uint32_t pass = 0;
    std::shared_ptr<const Generation> generation;
};
/// What replay_last() would be after this pass, and the splats. Takes the time of what the samples of a pass share, such as its
/// light paths, and the memory of a film. Throws PassDropped if `drop` is set.
Replay replay_pass(const PassOfRun& of, uint64_t pixel, size_t most_paths,
                   const std::atomic<bool>& drop);
/// Contributions with t ≥ 2 in Renderer::kept_pass(), with Russian roulette before shadow rays. May be called where that
/// may. Throws std::runtime_error if there is no such pass.
Replay replay_last(const Renderer& renderer, uint64_t pixel, size_t most_paths);

}  // namespace etendue
