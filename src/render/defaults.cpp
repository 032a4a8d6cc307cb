#include "render/defaults.h"

#include <algorithm>
#include <stdexcept>

namespace etendue {

IntegratorSpec choose_integrator(const Scene& scene, const std::string& text) {
    const RenderDefaults& defaults = scene.defaults();
    if (text.empty() && !defaults.integrator_problem.empty())
        throw std::runtime_error(defaults.integrator_problem + "; choose another one (-i)");
    IntegratorSpec spec =
        IntegratorSpec::parse(!text.empty()                 ? text
                              : defaults.integrator.empty() ? "path"
                                                            : defaults.integrator);
    const std::vector<ParamInfo>& params = integrator_entry(spec.name).info.params;
    const auto takes = [&](const std::string& name) {
        return std::any_of(params.begin(), params.end(),
                           [&](const ParamInfo& p) { return p.name == name; });
    };
    for (const auto& [name, value] : defaults.integrator_params)
        if (takes(name)) spec.params.emplace(name, value);
    return spec;
}

uint64_t default_spp(const Scene& scene) {
    const int given = scene.defaults().spp;
    return given > 0 ? uint64_t(given) : 64;
}

void set_default_limit(RenderLimits& limits, const Scene& scene) {
    if (limits.spp || limits.seconds || limits.error) return;
    limits.spp = default_spp(scene);
}

std::optional<SamplerKind> sampler_kind(std::string_view name) {
    if (name == "independent") return SamplerKind::Independent;
    if (name == "sobol") return SamplerKind::Sobol;
    return {};
}

}  // namespace etendue
