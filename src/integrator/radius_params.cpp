#include "integrator/radius_params.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "integrator/seen_extent.h"

namespace etendue {
namespace {

/// Radius of a disc with the area of a pixel, projected to the first surface: the median over the image. Infinite if no
/// eye ray hits a surface.
float pixel_radius(const Scene& scene) {
    std::vector<float> areas;
    for_each_seen(scene, [&](const SensorRay& ray, const SurfaceHit& hit) {
        const float to_area = abs_dot(hit.geometry.ng, ray.d) /
                              (scene.sensor().is_orthographic() ? 1.0f : sqr(hit.t));
        if (to_area > 0) areas.push_back(1 / (ray.pdf_dir * to_area));
    });
    if (areas.empty()) return kInf;
    const auto median = areas.begin() + std::ptrdiff_t(areas.size() / 2);
    std::nth_element(areas.begin(), median, areas.end());
    return std::sqrt(*median / kPi);
}

}  // namespace

std::vector<ParamInfo> radius_params(const char* doc) {
    return {{"radius", ParamKind::Float, "0", doc},
            {"alpha", ParamKind::Float, "0.75",
             "Controls how fast the radius shrinks, in (0, 1]: in pass i = 1, 2, ... it is "
             "radius·i^((alpha-1)/2) [Knaus & Zwicker 2011, eq. 15]. 1: it stays constant, and "
             "the image stays biased."}};
}

RadiusParams::RadiusParams(const IntegratorParams& p)
    : first(p.number("radius")), alpha(p.number("alpha")) {
    if (!(first >= 0))
        throw std::runtime_error(fmt::format("{}: radius must not be negative", p.integrator()));
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
    return std::min(kPixels * pixel_radius(scene), kOfScene * seen_radius(scene));
}

}  // namespace etendue
