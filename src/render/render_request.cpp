#include "render/render_request.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "description/scene_description.h"
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
        throw std::runtime_error(std::string(e.what()) + "; choose another integrator");
    }
}

template <class T>
struct Named {
    const char* name;
    T value;
};
constexpr Named<SamplerKind> kSamplers[] = {{"independent", SamplerKind::Independent},
                                            {"sobol", SamplerKind::Sobol}};
constexpr Named<FilterMode> kFilterModes[] = {{"spread", FilterMode::Spread},
                                              {"sample", FilterMode::Sample}};

template <class T, size_t N>
T value_of(const Named<T> (&all)[N], std::string_view name, std::string_view option) {
    std::vector<std::string> known;
    for (const Named<T>& one : all) {
        if (one.name == name) return one.value;
        known.emplace_back(one.name);
    }
    const std::string near = nearest_name(name, known);
    throw std::invalid_argument(
        fmt::format("{} must be {}, but is \"{}\"{}", option, fmt::join(known, " or "), name,
                    near.empty() ? "" : fmt::format("; did you mean \"{}\"?", near)));
}

template <class T, size_t N>
const char* name_of(const Named<T> (&all)[N], T value) {
    for (const Named<T>& one : all)
        if (one.value == value) return one.name;
    return "";
}

}  // namespace

RenderSettings settings_of(const RenderRequest& request, const Scene& scene) {
    return settings_of(request, choose_integrator(scene, request.integrator));
}

RenderSettings settings_of(const RenderRequest& request, IntegratorSpec integrator) {
    RenderSettings s;
    static_cast<RenderOptions&>(s) = request;
    s.integrator = std::move(integrator);
    return s;
}

IntegratorSpec choose_integrator(const Scene& scene, const std::string& text) {
    if (text.empty()) return chosen_by_scene(scene);
    IntegratorSpec spec = IntegratorSpec::parse(text);
    const PluginInfo& method = integrator_entry(spec.name).info;
    try {
        const IntegratorSpec of_scene = scene_integrator(scene).spec;
        for (const auto& [name, value] : of_scene.params)
            if (method.has_param(name) && (of_scene.name == spec.name || is_of_the_scene(name)))
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

SamplerKind sampler_named(std::string_view name, std::string_view option) {
    return value_of(kSamplers, name, option);
}

FilterMode filter_mode_named(std::string_view name, std::string_view option) {
    return value_of(kFilterModes, name, option);
}

const char* to_string(SamplerKind sampler) {
    return name_of(kSamplers, sampler);
}

const char* to_string(FilterMode mode) {
    return name_of(kFilterModes, mode);
}

}  // namespace etendue
