#include "integrator/light_path_options.h"

#include <algorithm>
#include <cmath>

#include "sampler/pilot_seed.h"

namespace etendue {

std::vector<ParamInfo> LightPathOptions::params() {
    return {
        {"light_paths", ParamKind::Int, "0",
         "Number of light paths in a pass; pixel i connects to light path i modulo light_paths. "
         "0: one for each pixel, or as many as fit into `memory`."},
        {"memory", ParamKind::Int, "6144",
         "Largest memory for the light vertices of a pass, in MiB."}};
}

LightPathOptions::LightPathOptions(const IntegratorParams& p)
    : given(uint64_t(p.integer("light_paths", 0, 1 << 30))),
      memory(uint64_t(p.integer("memory", 1, 1 << 30)) << 20) {}

uint64_t LightPathOptions::count(const Scene& scene, const DepthOptions& depth,
                                 uint64_t vertex_bytes) const {
    if (given > 0) return given;
    const uint64_t pixels = scene.film().pixel_count();
    // If this many vertices per path fit into the memory, no pilot is needed: hardly any scene has more on average.
    constexpr uint64_t kManyVertices = 24;
    if (pixels * kManyVertices * vertex_bytes <= memory) return pixels;
    constexpr double kReserve = 1.1;
    // Of the spread of the sum over the paths of a pass: that of none of thousands of passes is so large.
    constexpr double kSpread = 6;
    const Moments vertices = light_path_length(scene, depth);
    // N paths have m N ± s √N vertices.
    const double most = double(memory) / double(vertex_bytes),
                 m = std::max(kReserve * vertices.mean(), 1.0),
                 s = kSpread * std::sqrt(vertices.variance());
    const double root = (std::sqrt(sqr(s) + 4 * m * most) - s) / (2 * m);
    return std::clamp(uint64_t(sqr(root)), uint64_t(1), pixels);
}

Moments light_path_length(const Scene& scene, const DepthOptions& depth) {
    constexpr uint64_t kPilotPaths = 4096;
    const TechniqueCounts none;
    RenderStats stats;
    const WalkContext walk{
        scene, none, stats, {depth.max_depth + scene.sensor().has_finite_lens(), depth.rr_depth}};
    Sampler sampler(SamplerKind::Independent, pilot_seed(0, PilotUse::LightPathCount));
    SubPath y;
    Moments vertices;
    for (uint64_t i = 0; i < kPilotPaths; ++i) {
        sampler.start(0, i);
        trace_light_path(walk, sampler, y);
        vertices.add(double(y.size()));
    }
    return vertices;
}

}  // namespace etendue
