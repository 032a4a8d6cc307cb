#include "mcmc/mutation/perturbation.h"

#include <algorithm>
#include <cmath>

namespace etendue {

float LogRange::sample(float u) const {
    return high * std::pow(low / high, u);
}

LogRange film_range(const PathMeasure& measure) {
    constexpr float kSmallest = 1, kShare = 0.005f;
    return {kSmallest, std::max(std::sqrt(kShare * measure.film.area() / kPi), 2 * kSmallest)};
}

Vec3 turned(Vec3 axis, float angle, float u) {
    const Frame frame = Frame::from_normal(axis);
    const float azimuth = 2 * kPi * u, s = std::sin(angle);
    return normalize(
        frame.to_world({s * std::cos(azimuth), s * std::sin(azimuth), std::cos(angle)}));
}

std::optional<BsdfSample> follow(const Vertex& at, const Vertex& like, TransportMode mode) {
    if (at.kind != Vertex::Kind::Surface) return {};
    return at.bsdf.sample_delta(at.wo, like.event, mode);
}

}  // namespace etendue
