#include "compare/default_reference.h"

#include <algorithm>

#include <fmt/format.h>

#include "render/render_request.h"

namespace etendue {
namespace {

/// The integrator's max_depth as text: given in `spec`, or the default of its table.
std::string max_depth(const IntegratorSpec& spec) {
    if (const auto found = spec.params.find("max_depth"); found != spec.params.end())
        return found->second;
    if (spec.make) return "";
    for (const ParamInfo& p : integrator_entry(spec.name).info.params)
        if (std::string(p.name) == "max_depth") return p.fallback;
    return "";
}

}  // namespace

IntegratorSpec reference_integrator(const Scene& scene, const std::vector<MethodSpec>& methods) {
    IntegratorSpec spec = choose_integrator(scene, "bdpt");
    if (methods.empty()) return spec;
    const std::string first = max_depth(methods.front().integrator);
    if (!first.empty() && std::ranges::all_of(methods, [&](const MethodSpec& m) {
            return max_depth(m.integrator) == first;
        }))
        spec.params["max_depth"] = first;
    return spec;
}

RenderLimits reference_limits(const RenderLimits& of_method) {
    RenderLimits limits;
    if (of_method.seconds)
        limits.seconds = 10 * *of_method.seconds;
    else
        limits.spp = 16 * of_method.spp.value_or(1);
    return limits;
}

std::vector<std::string> depth_warnings(const std::vector<MethodSpec>& methods,
                                        const IntegratorSpec& reference) {
    std::vector<std::string> warnings;
    for (const MethodSpec& m : methods)
        if (max_depth(m.integrator) != max_depth(reference))
            warnings.push_back(
                fmt::format("{} has max_depth {}, the reference {}: errors include the difference",
                            m.name, max_depth(m.integrator), max_depth(reference)));
    return warnings;
}

}  // namespace etendue
