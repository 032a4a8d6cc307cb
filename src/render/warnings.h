#pragma once
// Known or possible errors of an image, from the counters of its rendering.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "integrator/integrator.h"
#include "pathspace/render_stats.h"
#include "system/available_memory.h"

namespace etendue {

/// One sentence each; empty if nothing is wrong.
std::vector<std::string> warnings(const RenderStats& stats);

/// Warns before the rendering if the light paths of a pass may need more memory than `available` bytes. Their number is
/// never reduced silently, since the image depends on it.
std::vector<std::string> memory_warnings(const Scene& scene, const std::string& name,
                                         const Integrator& integrator, uint64_t light_paths,
                                         std::optional<uint64_t> available);
class Renderer;
std::vector<std::string> memory_warnings(const Renderer& renderer,
                                         std::optional<uint64_t> available = available_memory());

}  // namespace etendue
