#pragma once
// Defaults of renderings.

#include <optional>
#include <string>
#include <string_view>

#include "render/renderer.h"

namespace etendue {

/// The integrator that `text` names, or the scene's if `text` is empty. Parameters missing from `text` are taken from the
/// scene's integrator if it is the same one. From another one, only those are taken that belong to the scene, as max_depth
/// does: other parameters of a method say nothing about another method.
IntegratorSpec choose_integrator(const Scene& scene, const std::string& text);

/// Samples per pixel that the scene file asks for, or 64.
uint64_t default_spp(const Scene& scene);

/// If `limits` has no limit, sets default_spp().
void set_default_limit(RenderLimits& limits, const Scene& scene);

/// "independent" or "sobol"; empty for other names.
std::optional<SamplerKind> sampler_kind(std::string_view name);
/// "spread" or "sample"; empty for other names.
std::optional<FilterMode> filter_mode(std::string_view name);
const char* to_string(FilterMode mode);

}  // namespace etendue
