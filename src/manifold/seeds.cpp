#include "manifold/seeds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace etendue {

ChainSeeds::ChainSeeds(const Scene& scene, const Vertex& from, const LampPoint& lamp, int depth,
                       ChainTracer& tracer, RenderStats& stats)
    : scene_(scene), from_(from), lamp_(lamp), depth_(depth), tracer_(tracer), stats_(stats) {
    constexpr size_t kMany = 64;
    const std::vector<ClearShape>& shapes = scene.clear_shapes();
    if (shapes.size() < 2 || shapes.size() > kMany) return;
    float sum = 0;
    sums_.reserve(shapes.size());
    for (const ClearShape& s : shapes) {
        // About the share of directions that see the sphere around the shape.
        const float r2 = sqr(s.radius);
        sum += r2 / (r2 + length2(s.center - from.p));
        sums_.push_back(sum);
    }
}

const ClearShape& ChainSeeds::choose_shape(float u) const {
    const std::vector<ClearShape>& shapes = scene_.clear_shapes();
    const size_t i = sums_.empty()
                         ? size_t(u * float(shapes.size()))
                         : size_t(std::upper_bound(sums_.begin(), sums_.end(), u * sums_.back()) -
                                  sums_.begin());
    return shapes[std::min(i, shapes.size() - 1)];
}

std::optional<Vec3d> ChainSeeds::about_lamp(float u_angle, float u_around) const {
    // Angles of all sizes: panes hardly turn light, balls and waves do.
    constexpr double kSmallest = 0.005, kLargest = 1;
    const Vec3d v = lamp_.is_infinite() ? Vec3d(lamp_.p) : Vec3d(lamp_.p) - Vec3d(from_.p);
    if (!(dot(v, v) > 0)) return {};
    const Vec3d to_lamp = normalize(v);
    const double angle = kSmallest * std::pow(kLargest / kSmallest, double(u_angle)),
                 around = 2 * std::numbers::pi * double(u_around);
    const TangentBasis basis(to_lamp);
    return normalize(to_lamp * std::cos(angle) +
                     (basis.s * std::cos(around) + basis.t * std::sin(around)) * std::sin(angle));
}

std::optional<Vec3d> ChainSeeds::first_direction(Sampler& sampler) const {
    constexpr float kShareOfLamp = 0.4f, kShareOfShapes = 0.35f;
    const float u = sampler.next_1d(), u_lobe = sampler.next_1d();
    const Vec2 u_direction = sampler.next_2d();
    if (u < kShareOfLamp) return about_lamp(u_lobe, u_direction.x);
    const float u_shape = (u - kShareOfLamp) / kShareOfShapes;
    if (scene_.clear_shapes().empty() || u_shape >= 1) {
        const auto s = from_.sample_unguided(u_lobe, u_direction, TransportMode::Radiance);
        if (!s || s->is_delta) return {};
        return normalize(Vec3d(s->wi));
    }
    const ClearShape& shape = choose_shape(u_shape);
    const Vec3d v = Vec3d(scene_.point_on(shape, u_lobe, u_direction)) - Vec3d(from_.p);
    if (!(dot(v, v) > 0)) return {};
    return normalize(v);
}

Rgb ChainSeeds::emission_here() const {
    const RayEnd at = tracer_.origin();
    const Vec3 d = to_float(tracer_.ray().d),
               to_lamp = lamp_.is_infinite() ? lamp_.p : lamp_.p - at.p;
    if (!(dot(to_lamp, d) > 0 && dot(to_lamp, at.ng) * dot(d, at.ng) > 0)) return {};
    const Rgb emission = lamp_.emission(-normalize(to_lamp));
    return !emission.is_zero() && tracer_.sees(lamp_) ? emission : Rgb();
}

std::optional<ChainSeed> ChainSeeds::draw(Sampler& sampler, const ChainEvents* only) {
    ++stats_.chain_seeds;
    const auto w = first_direction(sampler);
    if (!w || from_.eval_unguided(to_float(*w), TransportMode::Radiance).f.is_zero()) return {};
    struct End {
        int events;
        ChainRay ray;
        Rgb guess;
    };
    std::array<End, ChainEvents::kMost> ends;
    size_t count = 0;
    ChainSeed seed{.w = *w, .events = {}, .ray = {}, .guess = {}};
    tracer_.start(*w);
    for (int i = 0; i < depth_ && tracer_.advance(); ++i) {
        const Vertex& v = tracer_.vertex();
        const float u = sampler.next_1d();
        const auto s = v.bsdf.sample(v.wo, u, sampler.next_2d(), TransportMode::Radiance);
        if (!s || !s->is_delta || !tracer_.leave(s->event)) break;
        if (only && i < only->count && s->event != only->number[size_t(i)]) return {};
        seed.events.add(s->event);
        const Rgb emission = emission_here();
        if (emission.is_zero()) continue;
        const ChainRay& ray = tracer_.ray();
        const double distance = lamp_.is_infinite() ? 1 : ray.way + length(Vec3d(lamp_.p) - ray.o);
        ends[count++] = {i + 1, ray, tracer_.value() * emission * float(1 / sqr(distance))};
    }
    if (count == 0) return {};
    const End& end = ends[std::min(size_t(sampler.next_1d() * float(count)), count - 1)];
    seed.events.count = end.events;
    seed.ray = end.ray;
    seed.guess = end.guess;
    return seed;
}

}  // namespace etendue
