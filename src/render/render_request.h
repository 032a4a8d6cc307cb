#pragma once
// What a rendering is asked for: the names, defaults and limits that the command line, Python and studio share.

#include <string>
#include <string_view>

#include "render/renderer.h"

namespace etendue {

/// A rendering as users ask for it. Its defaults are theirs.
struct RenderRequest : RenderOptions {
    RenderRequest() { sampler = SamplerKind::Sobol; }

    std::string integrator;  ///< As choose_integrator() takes it.
};

RenderSettings settings_of(const RenderRequest& request, const Scene& scene);
/// With an integrator of its own instead of request.integrator.
RenderSettings settings_of(const RenderRequest& request, IntegratorSpec integrator);

/// The integrator that `text` names, or the scene's if `text` is empty. Parameters missing from `text` are taken from the
/// scene's integrator if it is the same one. From another one, only those are taken that belong to the scene, as max_depth
/// does: other parameters of a method say nothing about another method.
IntegratorSpec choose_integrator(const Scene& scene, const std::string& text);

/// Samples per pixel that the scene file asks for, or 64.
uint64_t default_spp(const Scene& scene);

/// If `limits` has no limit, sets default_spp().
void set_default_limit(RenderLimits& limits, const Scene& scene);

/// "independent" or "sobol". Throws std::invalid_argument for other names, which calls what was named `option`.
SamplerKind sampler_named(std::string_view name, std::string_view option);
/// The same for "spread" and "sample".
FilterMode filter_mode_named(std::string_view name, std::string_view option);
const char* to_string(SamplerKind sampler);
const char* to_string(FilterMode mode);

}  // namespace etendue
