#include "manifold/seeds.h"

namespace etendue {

bool ChainSeeds::may_end_here() const {
    const RayEnd at = tracer_.origin();
    const Vec3 d = to_float(tracer_.ray().d),
               to_lamp = lamp_.is_infinite() ? lamp_.p : lamp_.p - at.p;
    if (!(dot(to_lamp, d) > 0 && dot(to_lamp, at.ng) * dot(d, at.ng) > 0)) return false;
    return !lamp_.emission(-normalize(to_lamp)).is_zero() && tracer_.sees(lamp_);
}

std::optional<ChainSeed> ChainSeeds::draw(Sampler& sampler, const ChainEvents* only) {
    ++stats_.chain_seeds;
    const float u_lobe = sampler.next_1d();
    const Vec2 u_direction = sampler.next_2d();
    const auto first = from_.sample_unguided(u_lobe, u_direction, TransportMode::Radiance);
    if (!first || first->is_delta) return {};
    ChainSeed seed{.w = normalize(Vec3d(first->wi)), .events = {}};
    std::array<int, ChainEvents::kMost> ends{};
    int count = 0;
    tracer_.start(seed.w);
    for (int i = 0; i < depth_ && tracer_.advance(); ++i) {
        const Vertex& v = tracer_.vertex();
        const float u = sampler.next_1d();
        const auto s = v.bsdf.sample(v.wo, u, sampler.next_2d(), TransportMode::Radiance);
        if (!s || !s->is_delta || !tracer_.leave(s->event)) break;
        if (only && i < only->count && s->event != only->number[size_t(i)]) return {};
        seed.events.add(s->event);
        if (may_end_here()) ends[size_t(count++)] = i + 1;
    }
    if (count == 0) return {};
    seed.events.count = ends[std::min(size_t(sampler.next_1d() * float(count)), size_t(count) - 1)];
    return seed;
}

}  // namespace etendue
