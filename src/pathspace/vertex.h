#pragma once
// Vertices and sub-paths. After its walk a sub-path is read only: joins and weights never change it.

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "bsdf/material.h"
#include "emitter/emitter.h"
#include "pathspace/gloss.h"
#include "scene/scene.h"

namespace etendue {

class Guide;
struct GuideCell;
struct GuideView;
class LightSelection;
struct WalkContribution;

/// A probability in steps of 2^-10, so that the compactly stored value is exactly the one used in the decision.
class Survival {
public:
    Survival() = default;
    /// Rounded up, and limited to [2^-10, 1]; 1 if `q` is NaN.
    explicit Survival(float q)
        : steps_(q < 1 ? uint16_t(std::max(std::ceil(q * 0x1p10f) - 1, 0.0f)) : kMost) {}
    float value() const { return float(steps_ + 1) * 0x1p-10f; }
    uint16_t steps() const { return steps_; }
    static Survival from_steps(unsigned steps) {
        Survival q;
        q.steps_ = uint16_t(steps);
        return q;
    }

private:
    static constexpr uint16_t kMost = 0x3ff;
    uint16_t steps_ = kMost;
};

/// An end point or scattering point, with all data that joins and weights need.
struct Vertex {
    enum class Kind : uint8_t { Sensor, Emitter, Surface };

    Vec3 p;  ///< Position; for an emitter at infinity the unit direction toward it.
    Vec3
        ng;  ///< Unit geometric normal; zero-cosine points (point lights) have the direction of the walk.
    Vec3 wo;   ///< Toward the predecessor; unused at the first vertex.
    Rgb beta;  ///< Throughput up to, not including, scattering here.
    /// Area density as sampled from the predecessor. After a delta event it is the event's probability times |cos
    /// θ|/d², without the factor δ, which the density from the other side has too (see BsdfSample::pdf_rev).
    float pdf_fwd = 0;
    /// Solid angle at this vertex over area at the predecessor: |cos θ|/d² there, 1 where it is at infinity.
    float to_predecessor = 0;
    float pdf_rev =
        0;  ///< Area density as it would be sampled from the successor; known two vertices later.
    /// Σ over the techniques whose split lies before vertex i-2, relative to the density of the split there; see mis.h.
    double weight_sum = 0;
    /// p_NE / p_L of an emitter vertex y_0 seen from here (stored at y_1); see mis.h.
    float next_event_ratio = 1;
    Kind kind = Kind::Surface;
    bool is_delta = false;        ///< Whether the walk left this vertex by a delta event.
    bool is_infinite = false;     ///< Whether it is at infinity; p is a direction then.
    bool has_cosine = true;       ///< Whether |cos θ| is part of G here, as on surfaces.
    bool is_connectible = false;  ///< Whether it has a smooth lobe or is an end point.
    /// For eye paths: whether the film point determines this vertex. This is the case after delta events alone if the
    /// lens is a point or at infinity. With a finite lens, only z_1 counts as determined.
    bool is_fixed_by_film = false;
    MediumId medium = kVacuum;  ///< On the edge to the predecessor.
    Survival survival;          ///< Of Russian roulette before the walk left this vertex.
    uint8_t gloss = 0;          ///< Of the emitter or the material, see gloss.h.
    uint8_t pair_level = 0;     ///< Argument of pair_share().
    uint8_t event = 0;          ///< Number of a delta event, see Bsdf::sample_delta().
    const SceneShape* shape = nullptr;
    const Emitter* emitter = nullptr;  ///< Of an emitter vertex, or of the surface.
    SurfaceLocation location;          ///< On a surface; for y_0 only `prim` is set.
    Vec2 uv;                           ///< Parameters within the primitive, as those of `location`.
    float slack = 0;                   ///< Of a surface vertex, see SurfaceGeometry.
    const GuideCell* guide =
        nullptr;  ///< Learned directions here; nullptr if the walk is not guided.
    /// Learned selection of the emitter of next events here; nullptr if it is that of Emitter::selection_pmf.
    const LightSelection* lights = nullptr;
    float guide_rev =
        0;  ///< Learned density of `wo` for walks in the other mode, which arrive from the successor.
    Bsdf bsdf;

    /// Makes this a surface vertex with the given wo.
    void set_surface(const SceneShape& on, const SurfaceLocation& at, const SurfaceGeometry& g,
                     Vec3 toward_predecessor, ComponentArena& arena) {
        kind = Kind::Surface;
        p = g.p;
        ng = g.ng;
        wo = toward_predecessor;
        shape = &on;
        emitter = on.emitter;
        location = at;
        uv = {at.u, at.v};
        slack = g.slack;
        on.material->make_bsdf(
            {g.p, g.ng, g.ns, g.dpdu, g.dpdv, g.uv, wo, g.color, g.alpha, g.second_uv}, arena,
            bsdf);
        is_connectible = bsdf.has_smooth();
        gloss = gloss_of_roughness(bsdf.roughness());
    }
    /// Whether some directions of walks in `mode` are guided here.
    bool is_guided(TransportMode mode) const;
    /// Makes `cell`, which holds p, guide walks in `mode` here, if it has learned anything for such a vertex. `both`:
    /// whether the densities of walks in the other mode are needed.
    void set_guide(const GuideCell& cell, TransportMode mode, bool both);

    /// Samples a direction in which a walk in `mode` leaves, with weight f̃·|cos θ| / pdf (for emission L_e |cos θ| /
    /// pdf) and both densities; empty if the walk ends. Not for emitters at infinity, whose direction is fixed.
    /// `u_guide` is read only if there is a guide.
    std::optional<BsdfSample> sample(float u_lobe, Vec2 u, float u_guide,
                                     TransportMode mode) const {
        return guide ? sample_guided(u_lobe, u, u_guide, mode) : sample_unguided(u_lobe, u, mode);
    }
    std::optional<BsdfSample> sample_unguided(float u_lobe, Vec2 u, TransportMode mode) const {
        if (kind != Kind::Emitter) return bsdf.sample(wo, u_lobe, u, mode);
        const Vec3 w = emitter->sample_direction(ng, u);
        const Emitter::Emission e = emitter->eval_emission(ng, uv, location.prim, w);
        if (!(e.pdf_d > 0)) return {};
        return BsdfSample{.wi = w, .weight = e.Le_cos * (1 / e.pdf_d), .pdf = e.pdf_d};
    }
    /// f̃·|cos θ| (for emission L_e |cos θ|) toward `w`, and the densities of sample(); of smooth lobes only.
    BsdfEval eval(Vec3 w, TransportMode mode) const {
        BsdfEval e = eval_unguided(w, mode);
        if (guide) mix_guide(w, mode, e.pdf, e.pdf_rev);
        return e;
    }
    BsdfEval eval_unguided(Vec3 w, TransportMode mode) const {
        if (kind != Kind::Emitter) return bsdf.eval(wo, w, mode);
        const Emitter::Emission e = emitter->eval_emission(ng, uv, location.prim, w);
        return {.f = e.Le_cos, .pdf = e.pdf_d};
    }
    /// Upper bound of eval(w).pdf over the directions of a cone; kInf where none is known.
    float max_pdf(const DirectionCone& cone, TransportMode mode) const {
        const float bound = max_pdf_unguided(cone);
        return guide ? max_guided_pdf(bound, cone, mode) : bound;
    }
    /// Upper bound of eval_unguided(w).pdf.
    float max_pdf_unguided(const DirectionCone& cone) const;
    /// The normal n where directions without guide have the density cos θ/π about n; empty for other densities.
    std::optional<Vec3> cosine_normal() const {
        if (kind != Kind::Emitter) return bsdf.diffuse_normal();
        return emitter->emits_by_cosine() ? std::optional(ng) : std::nullopt;
    }

    /// This point as the end of a ray; not at infinity.
    RayEnd ray_end() const {
        if (kind == Kind::Surface) return {p, ng, slack};
        if (kind != Kind::Emitter || !has_cosine) return {p};
        return {p, ng, emitter->slack(location.prim)};
    }

    /// Medium on the edge that leaves along `w`.
    MediumId medium_toward(Vec3 w) const {
        if (kind == Kind::Emitter) {
            const bool is_behind = emitter->medium_behind != emitter->medium && dot(ng, w) < 0;
            return is_behind ? MediumId(emitter->medium_behind) : medium;
        }
        if (!shape || !shape->is_interface) return medium;
        return shape->medium_toward(ng, w);
    }

private:
    std::optional<BsdfSample> sample_guided(float u_lobe, Vec2 u, float u_guide,
                                            TransportMode mode) const;
    /// Converts the densities of `w`, and of `wo` from `w`, to those of guided walks.
    void mix_guide(Vec3 w, TransportMode mode, float& pdf, float& pdf_rev) const;
    float max_guided_pdf(float unguided, const DirectionCone& cone, TransportMode mode) const;
};

/// The density of `w` for a walk in `mode` that arrives at `v` from `from`, where that without guide is `unguided`:
///     [p_b > 0] ((1 - a) p_b + a (1 - P_δ) g),
/// with the learned density g, its share a, and the probability P_δ of delta events.
float guided_pdf(const Vertex& v, const GuideCell& cell, Vec3 from, Vec3 w, TransportMode mode,
                 float unguided);

/// The share of guided directions at `v` for walks in `mode`.
float guide_share(const Vertex& v, const GuideCell& cell, TransportMode mode);
/// What walks in `mode` that reach `v` as this one did contribute on average.
WalkContribution expected_contribution(const Vertex& v, const GuideCell& cell, TransportMode mode);
/// Normal of a surface on the side from which the walk came.
inline Vec3 facing_normal(const Vertex& v) {
    return dot(v.ng, v.wo) < 0 ? -v.ng : v.ng;
}
/// The same as an argument of surface_side(): zero where light passes through the surface.
inline Vec3 side_normal(const Vertex& v) {
    return v.shape->material->is_transmissive() ? Vec3{} : facing_normal(v);
}
/// How a walk that arrives at `v` from `from` sees the lobes of the cell.
GuideView guide_view(const Vertex& v, const GuideCell& cell, Vec3 from);

/// Density of y_0 = `d` of an emitter at infinity for light paths, in solid angle, where that without guide is
/// `unguided`; of finite emitters `unguided`, in area.
float origin_pdf(const Guide* guide, const Emitter& emitter, Vec3 d, float unguided);
/// Density p_d of emission along `w` from y_0 at `p` with the normal `ng`, where that without guide is `unguided`.
float emission_pdf(const Guide* guide, const Emitter& emitter, Vec3 p, Vec3 ng, Vec3 w,
                   float unguided);
/// How light that starts at `p` with the normal `ng` sees the lobes of the cell.
GuideView emission_view(const Emitter& emitter, const GuideCell& cell, Vec3 p, Vec3 ng);
float learned_selection_pmf(const LightSelection& lights, const Emitter& emitter);
/// Probability that next events at `v` select the emitter.
inline float next_event_pmf(const Vertex& v, const Emitter& emitter) {
    return v.lights ? learned_selection_pmf(*v.lights, emitter) : emitter.selection_pmf;
}
/// The same for next events with a guide, at any surface vertex: those of light walks keep no selection.
float next_event_pmf(const Vertex& v, const Emitter& emitter, const Guide* guide);
/// p_NE(y_0): density with which next events at `v` sample y_0 = `y0` of an emitter, the selection included. `hit` is what is
/// known of y_0.
inline double next_event_pdf(const Vertex& v, const Vertex& y0, const Emitter& emitter,
                             const EmitterHit& hit) {
    const float point =
        emitter.is_infinite() ? hit.pdf : emitter.direct_pdf(y0.p, y0.ng, y0.location.prim, v.p);
    return double(next_event_pmf(v, emitter)) * double(point);
}
float guided_emission_pmf(const Guide& guide, const Emitter& emitter);
/// Probability that light paths choose the emitter.
inline float emission_pmf(const Guide* guide, const Emitter& emitter) {
    return guide ? guided_emission_pmf(*guide, emitter) : emitter.selection_pmf;
}
/// The learned directions of emission at `p`, or nullptr.
const GuideCell* emission_cell(const Guide* guide, const Emitter& emitter, Vec3 p);

/// The last ray of a walk, whether or not it hit a surface; it may cross a finite lens.
struct Flight {
    Vec3 o, d;
    float length = kInf;  ///< Distance to the surface it hit.
    Rgb beta;  ///< Throughput along it: that of the vertex it left, times scattering over density.
    /// Density of d, or probability of a delta event; 0 where the last step traced no ray.
    float pdf_sa = 0;
    MediumId medium = kVacuum;
};

/// A walk from one end of a path: y_0 … or z_0 …
struct SubPath {
    ComponentArena arena;
    Vec2 film;  ///< Film point of an eye sub-path.
    float film_weight =
        1;  ///< Factor of the reconstruction filter, for contributions to the own pixel.
    Flight flight;
    float eta2 = 1;  ///< Product of η² over the refractions of an eye sub-path.
    float gain = 1;  ///< Product of BsdfSample::gain.
    /// Expected contribution of an eye sub-path at its first connectible vertex; 0 where unknown or not yet reached.
    float expected = 0;
    const GuideCell* cell = nullptr;  ///< That holds the last vertex; nullptr without a guide.

    SubPath() = default;
    /// Copies would read BSDFs from the arena of the original.
    SubPath(const SubPath&) = delete;
    SubPath& operator=(const SubPath&) = delete;
    SubPath(SubPath&&) = default;
    SubPath& operator=(SubPath&&) = default;

    int size() const { return size_; }
    const Vertex& operator[](int i) const { return store_[size_t(i)]; }
    Vertex& operator[](int i) { return store_[size_t(i)]; }
    /// Appends a vertex. Only the fields that not every kind of vertex sets are reset; the others keep their old
    /// values.
    Vertex& append() {
        if (size_t(size_) == store_.size()) store_.resize(2 * store_.size() + 16);
        Vertex& v = store_[size_t(size_++)];
        v.pdf_rev = 0;
        v.weight_sum = 0;
        v.next_event_ratio = 1;
        v.is_delta = v.is_infinite = v.is_connectible = v.is_fixed_by_film = false;
        v.has_cosine = true;
        v.medium = kVacuum;
        v.survival = {};
        v.shape = nullptr;
        v.emitter = nullptr;
        v.guide = nullptr;
        v.lights = nullptr;
        return v;
    }
    /// Allocates memory for `size` vertices, and no more where they are all.
    void reserve(int size) {
        if (size_t(size) > store_.size()) store_.resize(size_t(size));
    }
    size_t memory_bytes() const {
        return store_.capacity() * sizeof(Vertex) + arena.memory_bytes();
    }
    void truncate(int size) { size_ = size; }
    void clear() {
        size_ = 0;
        arena.reset();
        eta2 = gain = 1;
        expected = 0;
        cell = nullptr;
        flight.pdf_sa = 0;
    }

private:
    std::vector<Vertex> store_;  ///< Never shrinks, so that walks rarely allocate.
    int size_ = 0;
};

/// Unit direction from one vertex to another; at infinity their own.
inline Vec3 direction(const Vertex& from, const Vertex& to) {
    if (to.is_infinite) return to.p;
    if (from.is_infinite) return -from.p;
    return normalize(to.p - from.p);
}

/// Converts a solid-angle density at `from` to an area density at `to`: p_A = p_σ |cos θ_to| / d². It is unchanged
/// where `to` is at infinity.
inline float to_area(float pdf_sa, const Vertex& from, const Vertex& to) {
    if (to.is_infinite) return pdf_sa;
    // From infinity: pdf_sa is the density on the bounding disc.
    if (from.is_infinite) return pdf_sa * abs_dot(to.ng, from.p);
    const Vec3 v = to.p - from.p;
    const float dist2 = length2(v);
    const float pdf = pdf_sa / dist2;
    return to.has_cosine ? pdf * abs_dot(to.ng, v) / std::sqrt(dist2) : pdf;
}

}  // namespace etendue
