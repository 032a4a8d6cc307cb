#pragma once
// The paths that made a pixel, traced again: random numbers have addresses, so nothing is recorded during rendering.

#include <string>
#include <vector>

#include "integrator/integrator.h"

namespace etendue {

struct ReplayRequest {
    IntegratorSpec integrator;
    SamplerKind sampler = SamplerKind::Sobol;
    uint64_t seed = 0;
    uint64_t pixel = 0;  ///< Index within the crop.
    uint32_t first_pass = 0, passes = 1;
    bool splats = false;  ///< Also those of the light paths of the first of the passes.
    size_t most_paths = 10000;
    double seconds = 2;  ///< After which it ends early.
};

struct ReplayedPath {
    struct Point {
        Vec3 p;  ///< A direction where `is_infinite`.
        char event =
            'D';  ///< L on the emitter, S at a delta event, D at other surfaces, E on the lens.
        bool is_infinite = false;
    };
    std::vector<Point> points;  ///< From the emitter to the lens.
    Technique technique;
    uint32_t pass;
    float mis_weight;
    Rgb value;  ///< What the pass's value of the pixel has of it.
};

struct Replay {
    std::vector<ReplayedPath> paths;  ///< Those with a contribution, by luminance.
    Rgb sum;                   ///< Of all contributions with t ≥ 2, also of paths left out.
    uint32_t passes = 0;       ///< That were traced.
    uint64_t light_paths = 0;  ///< That were traced for splats.
    size_t left_out = 0;       ///< Paths beyond `most_paths`.
};

/// Why an integrator's paths cannot be traced again; empty where they can.
std::string replay_problem(const IntegratorSpec& integrator);
/// Joins pass no Russian roulette, so sums agree with the image on average, and exactly if it was rendered without.
/// Throws std::runtime_error with replay_problem().
Replay replay(const Scene& scene, const ReplayRequest& request);

}  // namespace etendue
