#include "render/defaults.h"

#include <algorithm>
#include <stdexcept>

#include "render/scene_integrator.h"

namespace etendue {

namespace {

/// Parameters that belong to the scene: which paths the image shows, and where they are hard to find.
bool is_of_the_scene(const std::string& param) {
    return param == "max_depth" || param == "user_paths";
}

IntegratorSpec chosen_by_scene(const Scene& scene) {
    try {
        return scene_integrator(scene).spec;
    } catch (const std::exception& e) {
        throw std::runtime_error(std::string(e.what()) + "; choose another one (-i)");
    }
}

}  // namespace

IntegratorSpec choose_integrator(const Scene& scene, const std::string& text) {
    if (text.empty()) return chosen_by_scene(scene);
    IntegratorSpec spec = IntegratorSpec::parse(text);
    const std::vector<ParamInfo>& params = integrator_entry(spec.name).info.params;
    const auto takes = [&](const std::string& name) {
        return std::any_of(params.begin(), params.end(),
                           [&](const ParamInfo& p) { return p.name == name; });
    };
    try {
        const IntegratorSpec of_scene = scene_integrator(scene).spec;
        for (const auto& [name, value] : of_scene.params)
            if (takes(name) && (of_scene.name == spec.name || is_of_the_scene(name)))
                spec.params.emplace(name, value);
    } catch (const std::exception&) {
        // The scene's integrator does not matter where another one is chosen.
    }
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

std::optional<FilterMode> filter_mode(std::string_view name) {
    if (name == "spread") return FilterMode::Spread;
    if (name == "sample") return FilterMode::Sample;
    return {};
}

const char* to_string(FilterMode mode) {
    switch (mode) {
    case FilterMode::Spread: return "spread";
    case FilterMode::Sample: return "sample";
    }
    return "";
}

}  // namespace etendue
