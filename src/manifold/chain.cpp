#include "manifold/chain.h"

namespace etendue {

void ChainTracer::start(Vec3d w) {
    ray_ = ChainRay::start(Vec3d(from_.p), w);
    origin_ = from_.ray_end();
    medium_ = from_.medium_toward(to_float(w));
    value_ = Rgb(1);
}

bool ChainTracer::advance() {
    const Vec3 d = to_float(ray_.d);
    Passage passage{medium_};
    ++stats_.chain_rays;
    if (!scene_.find_certain({offset_origin(origin_, d), d, kInf}, hit_, passage)) return false;
    if (!may_be_in_chain(*hit_.shape)) return false;
    scene_.complete(hit_);
    const auto jet =
        scene_.jet(hit_.location, ray_.o, ray_.d, dot(Vec3d(hit_.geometry.p) - ray_.o, ray_.d));
    if (!jet) return false;
    jet_ = *jet;
    arena_.reset();
    vertex_.set_surface(*hit_.shape, hit_.location, hit_.geometry, -d, arena_);
    vertex_.medium = passage.medium;
    if (!vertex_.bsdf.has_delta()) return false;
    if (ray_.way == 0) first_ = vertex_.ray_end();
    ray_.arrive(jet_);
    value_ *= passage.attenuation;
    return true;
}

bool ChainTracer::leave(uint8_t event) {
    const auto s = vertex_.bsdf.sample_delta(vertex_.wo, event, TransportMode::Radiance);
    if (!s) return false;
    if (event % 2 == 0)
        ray_.reflect(jet_);
    else if (!ray_.refract(jet_, double(s->eta)))
        return false;
    value_ *= s->weight * s->pdf;
    vertex_.event = event;
    origin_ = vertex_.ray_end();
    medium_ = vertex_.medium_toward(to_float(ray_.d));
    return true;
}

bool ChainTracer::follow(Vec3d w, const ChainEvents& events) {
    start(w);
    for (int i = 0; i < events.count; ++i)
        if (!advance() || !leave(events.number[size_t(i)])) return false;
    return true;
}

std::optional<Vec3d> ChainTracer::solve(Vec3d w, const ChainEvents& events, const ChainRay& ray,
                                        const ChainTarget& target, int most_rays) {
    constexpr double kLongestStep = 0.25;  // radians
    constexpr double kLeastShare = 1.0 / 64;
    constexpr double kRounding = 1e-12;  // of miss()
    Passing at = target.passed_by(ray);
    double share = 1;  // of the step
    for (int i = 1; i < most_rays; ++i) {
        if (!(at.distance > 0)) return {};
        auto [a, b] = at.step();
        const double size = std::hypot(a, b);
        if (!std::isfinite(size)) return {};
        // Where rays are focused, as at the edge of a caustic, a ray that hardly misses may still be far from the solution.
        const bool is_last = size < kStepOfSolutions && at.miss() < kMissOfSolutions;
        if (!is_last && size > 0) {
            const double factor = share * std::fmin(1, kLongestStep / size);
            a *= factor, b *= factor;
        }
        const TangentBasis basis(w);
        const Vec3d next = normalize(w + basis.s * a + basis.t * b);
        const bool follows = follow(next, events);
        if (is_last) {
            if (!follows) return {};
            const Passing end = target.passed_by(ray_);
            const bool is_closer =
                end.distance > 0 && end.miss() <= std::fmax(at.miss(), kRounding);
            return is_closer ? std::optional(next) : std::nullopt;
        }
        const Passing there = follows ? target.passed_by(ray_) : at;
        if (follows && there.distance > 0 && there.miss() < at.miss()) {
            w = next;
            at = there;
            share = std::fmin(1, 2 * share);
        } else if ((share /= 2) < kLeastShare) {
            return {};
        }
    }
    return {};
}

std::optional<Vec3d> ChainTracer::solve(Vec3d w, const ChainEvents& events,
                                        const ChainTarget& target, int most_rays) {
    if (!follow(w, events)) return {};
    return solve(w, events, ChainRay(ray_), target, most_rays);
}

float ChainTracer::visibility_of(const LampPoint& lamp) const {
    ++stats_.chain_rays;
    const float Tr = lamp.is_infinite() ? scene_.transmittance_to_infinity(origin_, lamp.p)
                                        : scene_.transmittance(origin_, lamp.ray_end());
    return Tr;
}

Rgb ChainTracer::transmittance_to(const LampPoint& lamp) const {
    const float Tr = visibility_of(lamp);
    if (!(Tr > 0)) return {};
    if (!scene_.has_media()) return Rgb(Tr);
    return (lamp.is_infinite() ? scene_.attenuation_to_infinity(medium_, origin_, lamp.p)
                               : scene_.attenuation(medium_, origin_, lamp.ray_end())) *
           Tr;
}

bool KnownChain::pass(const Vertex& v, Vec3 toward) {
    if (!may_be_in_chain(*v.shape)) return false;
    const auto jet = scene_.jet(v.location, ray_.o, ray_.d, dot(Vec3d(v.p) - ray_.o, ray_.d));
    const auto s = v.bsdf.sample_delta(toward, v.event, TransportMode::Radiance);
    if (!jet || !s) return false;
    ray_.arrive(*jet);
    if (v.event % 2 == 0) {
        ray_.reflect(*jet);
        return true;
    }
    return ray_.refract(*jet, double(s->eta));
}

}  // namespace etendue
