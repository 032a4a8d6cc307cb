#include "integrator/seen_extent.h"

#include <algorithm>
#include <vector>

#include "pathspace/walk.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

/// Of a list that is not empty.
float median(std::vector<float> values) {
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

struct SeenPoint {
    Vec3 p;
    float pixel_radius;
};

std::vector<SeenPoint> seen_points(const Scene& scene) {
    constexpr int kRays = 64;  // each way
    constexpr int kMostVertices = 32;
    const FilmGeometry& film = scene.film();
    const TechniqueCounts counts;
    RenderStats stats;
    const WalkContext walk{scene, counts, stats, {kMostVertices, kMostVertices}};
    Sampler sampler(SamplerKind::Independent, pilot_seed(0, PilotUse::SeenExtent));
    SubPath z;
    std::vector<SeenPoint> points;
    for (int row = 0; row < kRays; ++row)
        for (int column = 0; column < kRays; ++column) {
            const Vec2 at{(float(column) + 0.5f) * (float(film.width) / kRays),
                          (float(row) + 0.5f) * (float(film.height) / kRays)};
            const SensorRay ray = scene.sensor().sample_ray(at, {0.5f, 0.5f});
            sampler.start(0, uint64_t(row * kRays + column));
            start_eye_path(walk, {at, 1}, ray, sampler, z);
            while (z.size() > 1 && !z[z.size() - 1].is_connectible &&
                   extend<TransportMode::Radiance>(walk, sampler, z)) {
            }
            int last = z.size() - 1;
            if (z[last].kind != Vertex::Kind::Surface) --last;
            if (last < 1) continue;
            float distance = length(z[1].p - ray.p);
            for (int i = 1; i < last; ++i) distance += length(z[i + 1].p - z[i].p);
            const float spread = scene.sensor().is_orthographic() ? 1 : sqr(distance),
                        area = spread / (ray.pdf_dir * abs_dot(z[last].ng, z[last].wo));
            points.push_back({z[last].p, std::sqrt(area / kPi)});
        }
    return points;
}

/// Median distance of the points from their middle.
float median_distance(const std::vector<SeenPoint>& points) {
    Vec3 middle;
    for (const int axis : {0, 1, 2}) {
        std::vector<float> coordinates;
        for (const SeenPoint& at : points) coordinates.push_back(at.p[axis]);
        middle[axis] = median(std::move(coordinates));
    }
    std::vector<float> distances;
    for (const SeenPoint& at : points) distances.push_back(length(at.p - middle));
    return median(std::move(distances));
}

}  // namespace

SeenExtent seen_extent(const Scene& scene) {
    constexpr float kMost = 3;
    const float radius = scene.bounds().is_empty() ? 1 : scene.bounds().radius();
    const std::vector<SeenPoint> points = seen_points(scene);
    if (points.empty()) return {radius, kInf};
    std::vector<float> pixel_radii;
    for (const SeenPoint& at : points) pixel_radii.push_back(at.pixel_radius);
    const float seen = kMost * median_distance(points);
    return {seen > 0 ? std::min(radius, seen) : radius, median(std::move(pixel_radii))};
}

}  // namespace etendue
