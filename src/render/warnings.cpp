#include "render/warnings.h"

#include <algorithm>

#include <fmt/format.h>

#include "render/renderer.h"
#include "reuse/light_vertex_cache.h"

namespace etendue {

std::vector<std::string> warnings(const RenderStats& stats) {
    std::vector<std::string> all;
    if (stats.rejected > 0)
        all.push_back(
            fmt::format("{} contributions were not finite and were left out", stats.rejected));
    if (stats.runaways > 0)
        all.push_back(fmt::format("{} pairs of vertices or specular connections were abandoned "
                                  "after too many trials: their light is "
                                  "missing, and the image is darker than it should be",
                                  stats.runaways));
    if (stats.bounds_exceeded > 0)
        all.push_back(fmt::format(
            "{} trials met a density above its assumed bound: the image may be biased there; "
            "please report the scene",
            stats.bounds_exceeded));
    return all;
}

std::vector<std::string> memory_warnings(const Scene& scene, const std::string& name,
                                         const Integrator& integrator, uint64_t light_paths,
                                         std::optional<uint64_t> available) {
    const uint64_t allowed = integrator.light_path_memory();
    if (allowed == 0 || !available) return {};
    // About what a pass needs for a light path of a closed room.
    constexpr uint64_t kBytesPerPath = 24 * LightVertexCache::kVertexBytes;
    const uint64_t paths = std::max(light_paths, scene.film().pixel_count());
    const uint64_t need = std::min(allowed, paths * kBytesPerPath);
    if (need <= *available) return {};
    const uint64_t fitting = std::max<uint64_t>(*available / 4 * 3 >> 20, 1);
    return {fmt::format("{} may need up to {} for its light paths, but only {} of memory are free; "
                        "memory={} limits it, and there are fewer light paths then",
                        name, format_bytes(need), format_bytes(*available), fitting)};
}

std::vector<std::string> memory_warnings(const Renderer& renderer,
                                         std::optional<uint64_t> available) {
    return memory_warnings(renderer.scene(), renderer.settings().integrator.name,
                           renderer.integrator(), renderer.light_paths(), available);
}

}  // namespace etendue
