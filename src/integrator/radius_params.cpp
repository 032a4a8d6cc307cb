#include "integrator/radius_params.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "integrator/seen_extent.h"

namespace etendue {
namespace {

/// The median over the image; infinite if no eye ray meets a surface.
float pixel_radius(const Scene& scene) {
    std::vector<SeenPoint> points = seen_points(scene);
    if (points.empty()) return kInf;
    const auto median = points.begin() + std::ptrdiff_t(points.size() / 2);
    std::nth_element(
        points.begin(), median, points.end(),
        [](const SeenPoint& a, const SeenPoint& b) { return a.pixel_radius < b.pixel_radius; });
    return median->pixel_radius;
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
