#pragma once
// What a rendering uses where nothing is asked for.

#include <optional>
#include <string>
#include <string_view>

#include "render/renderer.h"

namespace etendue {

/// The integrator that `text` names, or the scene's where `text` is empty. Parameters missing from `text` are taken
/// from the scene's integrator, if this one has them.
IntegratorSpec choose_integrator(const Scene& scene, const std::string& text);

/// Without any limit: the samples of the scene file, or 64.
void set_default_limit(RenderLimits& limits, const Scene& scene);

/// "independent" or "sobol"; empty for other names.
std::optional<SamplerKind> sampler_kind(std::string_view name);

}  // namespace etendue
