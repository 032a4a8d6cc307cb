#pragma once
// Joins: the ways in which a light and an eye sub-path form a full path. Each evaluates the unweighted contribution
// C_{s,t}, without visibility, and its MIS weight; the caller traces the shadow ray last.

#include <optional>

#include "pathspace/photon.h"
#include "pathspace/walk.h"

namespace etendue {

struct Join {
    Technique technique;
    const Emitter* emitter;  ///< The emitter of x_0.
    Rgb contribution;  ///< C_{s,t} without visibility; for one light path where t ≤ 1 (the film divides by N_L).
    float mis_weight;
    Vec2 film{};  ///< Film point; that of the eye sub-path unless t ≤ 1.
    /// The edge added by the join; b.p is a direction where `to_infinity`. A hit adds no edge.
    RayEnd a{}, b{};
    bool to_infinity = false;
    /// Of a gather: the disc's approximation π d² p of p_c, clamped as in the weights [Qin et al. 2015, eq. 7 and 24].
    float pair_probability = 1;
    bool needs_test = true;
};

/// Survival probability of Russian roulette before the shadow ray [Veach 1997, §10.4.1] for a join whose weighted
/// contribution to a pixel has the luminance `contribution`. `threshold` must not depend on the sample.
inline float join_survival(float contribution, float threshold) {
    return contribution < threshold ? contribution / threshold : 1.0f;
}
/// Whether the join with this number survives with probability q < 1; counts it otherwise.
inline bool survives_roulette(float q, uint64_t number, Sampler& sampler, RenderStats& stats) {
    sampler.seek(Stream::Roulette, number);
    if (sampler.next_1d_unstructured() < double(q)) return true;
    ++stats.joins_skipped;
    return false;
}

/// Russian roulette of a join before its weight is known. No weight exceeds 1, so a join that ends with weight 1 would end with
/// its own.
struct EarlyRoulette {
    float threshold;  ///< Of join_survival().
    float scale;      ///< What a unit of contribution adds to its pixel.
    uint64_t number;  ///< See join_number().
    Sampler& sampler;
    RenderStats& stats;

    bool ends(const Rgb& C) const {
        const float most = luminance(C) * scale;
        return most < threshold &&
               !survives_roulette(join_survival(most, threshold), number, sampler, stats);
    }
};

/// Attenuation along the edge from `a`, which may be at infinity, to `b` by the medium that their surfaces define.
Rgb edge_attenuation(const Scene& scene, const Vertex& a, const Vertex& b, Vec3 a_to_b);
/// Transmittance of the join's edge: 0 where it is blocked.
float visibility(const Scene& scene, const Join& join, RenderStats& stats);

/// C(0,t): z_{t-1} lies on `emitter`.
std::optional<Join> join_hit(const SubPath& z, int t, const Emitter& emitter,
                             const TechniqueCounts& counts);
/// The emitter that next events at `v` select by the number `u`, with the probability next_event_pmf().
const Emitter& select_emitter(const Scene& scene, const Vertex& v, double u);
/// C(1,t): a point on an emitter sampled for z_{t-1}. The points with the numbers `draw` = 0, 1, 2 … are stratified, and
/// each of them alone has the density of the technique.
std::optional<Join> join_next_event(const Scene& scene, const SubPath& z, int t, Sampler& sampler,
                                    const TechniqueCounts& counts, uint32_t draw = 0);
/// Asks for the memory that the next events of several eye paths read of their emitters.
void prefetch_next_events(const Scene& scene, std::span<const WalkInTurn> walks);
/// C(s,t), t ≥ 2; for s = 1, y_0 comes from emission sampling (Strategy::Connect, not NextEvent).
std::optional<Join> join_connect(const Scene& scene, const SubPath& y, int s, const SubPath& z,
                                 int t, const TechniqueCounts& counts,
                                 const EarlyRoulette* roulette = nullptr);
/// M(s,t): y_{s-1} and z_{t-1} treated as one vertex [Georgiev et al. 2012; Hachisuka et al. 2012]. For one light path.
std::optional<Join> join_merge(const SubPath& y, int s, const SubPath& z, int t,
                               const TechniqueCounts& counts);
/// M(s,t) of a photon near z_{t-1} whose power is spread over the area `disc` [Jensen 2001, §7.2], as the only
/// technique that makes its path: weight 1.
std::optional<Join> join_photon(const Photon& photon, const SubPath& z, int t, float disc);
/// U(s,t): z_{t-1} (`drops_eye`) or y_{s-1} is dropped, and the other one is connected to the predecessor of the
/// dropped one [Qin et al. 2015]. For one light path, and without the factor r, the estimate of 1/p_c. The dropped
/// vertex is not read.
std::optional<Join> join_gather(const Scene& scene, const SubPath& y, int s, const SubPath& z,
                                int t, bool drops_eye, const TechniqueCounts& counts);
/// C(s,1): y_{s-1} is connected to a point on the lens.
std::optional<Join> join_splat(const Scene& scene, const SubPath& y, int s, Sampler& sampler,
                               const TechniqueCounts& counts);
/// C(s+1,0): the ray that left y_{s-1}, the path's last flight, crosses a finite lens; the intersection is y_s.
std::optional<Join> join_hit_lens(const Scene& scene, const SubPath& y, int s,
                                  const TechniqueCounts& counts);

/// Calls `use(join)` for C(0,t) of every emitter that z_{t-1} lies on: one on a surface, all of them at infinity.
template <class Use>
void for_each_hit(const Scene& scene, const SubPath& z, int t, const TechniqueCounts& counts,
                  const Use& use) {
    const Vertex& v = z[t - 1];
    if (v.is_infinite) {
        for (const Emitter* e : scene.infinite_emitters())
            if (const auto join = join_hit(z, t, *e, counts)) use(*join);
    } else if (v.emitter) {
        if (const auto join = join_hit(z, t, *v.emitter, counts)) use(*join);
    }
}

}  // namespace etendue
