#include "integrator/radius_params.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "integrator/seen_extent.h"

namespace etendue {

std::vector<ParamInfo> radius_params(const char* doc) {
    return {{"radius", ParamKind::Float, "0", doc},
            {"alpha", ParamKind::Float, "0.75",
             "Controls how fast the radius shrinks, in (0, 1]: in pass i = 1, 2, ... it is "
             "radius·i^((alpha-1)/2) [Knaus & Zwicker 2011, eq. 15]. 1: it stays constant, and "
             "the image stays biased."}};
}

float radius_param(const IntegratorParams& p) {
    constexpr float kLeast = 1e-15f, kLargest = 1e15f;
    const float radius = p.number("radius");
    if (radius == 0 || (radius >= kLeast && radius <= kLargest)) return radius;
    throw std::runtime_error(fmt::format("{}: radius must be 0 or lie in [{:g}, {:g}], but is {:g}",
                                         p.integrator(), kLeast, kLargest, radius));
}

RadiusParams::RadiusParams(const IntegratorParams& p)
    : first(radius_param(p)), alpha(p.number("alpha")) {
    if (!(alpha > 0 && alpha <= 1))
        throw std::runtime_error(fmt::format("{}: alpha must lie in (0, 1]", p.integrator()));
}

float RadiusParams::radius(const Scene& scene, uint32_t index) {
    if (first == 0 && !default_) default_ = default_merge_radius(scene);
    return RadiusSchedule{first > 0 ? first : *default_, alpha}.radius(index);
}

float default_merge_radius(const Scene& scene) {
    constexpr float kPixels = 6;  // A smaller one makes caustics noisier, a larger one blurs them.
    constexpr float kOfScene = 0.01f;
    const SeenExtent seen = seen_extent(scene);
    return std::min(kPixels * seen.pixel_radius, kOfScene * seen.radius);
}

}  // namespace etendue
