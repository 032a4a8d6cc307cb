#include "integrator/light_path_options.h"

#include <algorithm>

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
    constexpr uint64_t kPilotPaths = 4096;
    constexpr double kReserve = 1.1;
    const TechniqueCounts none;
    RenderStats stats;
    const WalkContext walk{scene, none, stats, depth.walk()};
    Sampler sampler(SamplerKind::Independent, pilot_seed(0, PilotUse::LightPathCount));
    SubPath y;
    uint64_t vertices = 0;
    for (uint64_t i = 0; i < kPilotPaths; ++i) {
        sampler.start(0, i);
        trace_light_path(walk, sampler, y);
        vertices += uint64_t(y.size());
    }
    const double bytes = kReserve * double(vertices * vertex_bytes) / double(kPilotPaths);
    return std::clamp(uint64_t(double(memory) / std::max(bytes, 1.0)), uint64_t(1), pixels);
}

}  // namespace etendue
