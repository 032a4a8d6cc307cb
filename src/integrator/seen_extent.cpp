#include "integrator/seen_extent.h"

#include <algorithm>
#include <vector>

namespace etendue {
namespace {

/// Of a list that is not empty.
float median(std::vector<float> values) {
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace

float seen_radius(const Scene& scene) {
    constexpr float kMost = 3;
    const float radius = scene.bounds().is_empty() ? 1 : scene.bounds().radius();
    std::array<std::vector<float>, 3> coordinates;
    for_each_seen(scene, [&](const SensorRay&, const SurfaceHit& hit) {
        const Vec3 p = hit.geometry.p;
        for (size_t i = 0; i < 3; ++i) coordinates[i].push_back(i == 0 ? p.x : i == 1 ? p.y : p.z);
    });
    const auto& [x, y, z] = coordinates;
    if (x.empty()) return radius;
    const Vec3 middle{median(x), median(y), median(z)};
    std::vector<float> distances;
    for (size_t i = 0; i < x.size(); ++i)
        distances.push_back(length(Vec3{x[i], y[i], z[i]} - middle));
    const float seen = kMost * median(std::move(distances));
    return seen > 0 ? std::min(radius, seen) : radius;
}

}  // namespace etendue
