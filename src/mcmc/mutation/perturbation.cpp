#include "mcmc/mutation/perturbation.h"

#include <algorithm>
#include <cmath>

namespace etendue {
namespace {

/// The shading frame on the side of the geometric normal, whatever side a walk arrived from.
Frame shading_frame(const Vertex& v) {
    const Frame& frame = v.bsdf.front().frame;
    return dot(frame.n, v.ng) < 0 ? frame.flipped() : frame;
}

bool is_glossy_reflection(const PathState& x, int i) {
    constexpr float kRoughest = 0.4f;
    const Vertex& v = x[i].v;
    if (v.kind != Vertex::Kind::Surface || v.is_delta || v.gloss < gloss_of_roughness(kRoughest))
        return false;
    return dot(direction(v, x[i - 1].v), v.ng) * dot(direction(v, x[i + 1].v), v.ng) > 0;
}

}  // namespace

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

BsdfSample given(Vec3 wi) {
    return {.wi = wi, .weight = Rgb(1), .pdf = 1, .pdf_rev = 1};
}

bool is_followed(const PathState& x, int i, Followed events) {
    return x[i].v.is_delta || (events == Followed::Glossy && is_glossy_reflection(x, i));
}

bool is_same_event(const PathState& x, const PathState& y, int i, Followed events) {
    return x[i].v.is_delta == y[i].v.is_delta &&
           is_followed(x, i, events) == is_followed(y, i, events);
}

std::optional<BsdfSample> follow(const Vertex& at, const PathState& x, int i, TransportMode mode) {
    const Vertex& like = x[i].v;
    if (at.kind != Vertex::Kind::Surface) return {};
    if (like.is_delta) return at.bsdf.sample_delta(at.wo, like.event, mode);
    const Vec3 half = direction(like, x[i - 1].v) + direction(like, x[i + 1].v);
    const Vec3 h = normalize(shading_frame(at).to_world(shading_frame(like).to_local(half)));
    const Vec3 wi = normalize(h * (2 * dot(at.wo, h)) - at.wo);
    return given(wi);
}

double followed_density(const PathState& x, int i, TransportMode mode) {
    const bool from_eye = mode == TransportMode::Radiance;
    const PathVertex& at = x[i];
    if (at.v.is_delta)
        return from_eye ? x.eye(i - 1) / double(at.eye_pmf) : x.light(i + 1) / double(at.light_pmf);
    // A half vector turns by dω / (4 cos θ) if one direction turns by dω.
    const double cosine = double(dot(direction(at.v, x[i - 1].v), direction(at.v, x[i + 1].v)));
    const double cos_half = std::sqrt(std::max(0.5 * (1 + cosine), 1e-12));
    return (from_eye ? x.geometry_from_eye(i - 1) : x.geometry_from_light(i + 1)) / (4 * cos_half);
}

}  // namespace etendue
