#include "manifold/seeds.h"

#include <algorithm>
#include <cmath>

namespace etendue {

ChainSeeds::ChainSeeds(const Scene& scene, const Vertex& from, const LampPoint& lamp, int depth,
                       const SeedPhotons& photons, ChainTracer& tracer, RenderStats& stats)
    : scene_(scene), from_(from), lamp_(lamp), depth_(depth),
      photons_(photons.near(from.p, side_normal(from), lamp.emitter->index)), tracer_(tracer),
      stats_(stats) {
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

std::optional<Vec3d> ChainSeeds::first_direction(Sampler& sampler) const {
    constexpr float kShareOfPhotons = 0.75f;  // of all where there are photons
    constexpr float kShareOfShapes = 0.6f;    // of the others
    float u = sampler.next_1d();
    const float u_lobe = sampler.next_1d();
    const Vec2 u_direction = sampler.next_2d();
    if (!photons_.empty()) {
        if (u < kShareOfPhotons) {
            const size_t i = size_t(u_lobe * float(photons_.size()));
            return toward(photons_[std::min(i, photons_.size() - 1)].left);
        }
        u = (u - kShareOfPhotons) / (1 - kShareOfPhotons);
    }
    const float u_shape = u / kShareOfShapes;
    if (scene_.clear_shapes().empty() || u_shape >= 1) {
        const auto s = from_.sample_unguided(u_lobe, u_direction, TransportMode::Radiance);
        if (!s || s->is_delta) return {};
        return normalize(Vec3d(s->wi));
    }
    const ClearShape& shape = choose_shape(u_shape);
    return toward(scene_.point_on(shape, u_lobe, u_direction));
}

std::optional<Vec3d> ChainSeeds::toward(Vec3 p) const {
    const Vec3d v = Vec3d(p) - Vec3d(from_.p);
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
