#pragma once
// Chains of delta events between a surface point and a target, mostly a point on a lamp. For fixed ends the chains that obey the
// laws of reflection and refraction are isolated [Jakob & Marschner 2012]. Newton's method finds one of them: its unknowns are
// the direction in which a ray leaves the surface point, and a step follows the ray through the same events.

#include <array>
#include <optional>

#include "manifold/chain_ray.h"
#include "pathspace/render_stats.h"
#include "pathspace/vertex.h"

namespace etendue {

/// The delta events of a chain, in the order in which the eye's ray meets them: Vertex::event.
struct ChainEvents {
    static constexpr int kMost = 8;

    int count = 0;
    std::array<uint8_t, kMost> number{};

    void add(uint8_t event) { number[size_t(count++)] = event; }
    friend bool operator==(const ChainEvents& a, const ChainEvents& b) {
        return a.count == b.count &&
               std::equal(a.number.begin(), a.number.begin() + a.count, b.number.begin());
    }
};

/// What a chain ends at.
struct ChainTarget {
    Vec3d p;  ///< At infinity the direction toward it.
    bool is_infinite = false;

    Passing passed_by(const ChainRay& ray) const {
        return is_infinite ? passing_at_infinity(ray, p) : passing(ray, p);
    }
};

/// y_0, drawn as light walks draw it without guide.
struct LampPoint {
    const Emitter* emitter = nullptr;
    Vec3 p;  ///< At infinity the direction toward it.
    Vec3 ng;
    Vec2 uv;
    uint32_t prim = 0;
    double pdf = 0;  ///< With the probability of the choice of the emitter.

    bool is_infinite() const { return emitter->is_infinite(); }
    ChainTarget target() const { return {Vec3d(p), is_infinite()}; }
    RayEnd ray_end() const {
        return emitter->is_area() ? RayEnd{p, ng, emitter->slack(prim)} : RayEnd{p};
    }
    /// L_e |cos θ| of the light that leaves along `w`.
    Rgb emission(Vec3 w) const {
        const Vec3 n = emitter->is_area() ? ng : w;
        return emitter->eval_emission(n, uv, prim, w).Le_cos;
    }
    Passing passed_by(const ChainRay& ray) const { return target().passed_by(ray); }
};

/// Follows rays from one surface point through delta events.
class ChainTracer {
public:
    /// `from` must outlive the tracer.
    ChainTracer(const Scene& scene, const Vertex& from, RenderStats& stats)
        : scene_(scene), from_(from), stats_(stats) {}

    /// The ray begins at the point, along the unit vector `w`.
    void start(Vec3d w);
    /// Traces the ray to the next surface, at which vertex() is then made. False where it meets none that a chain may have.
    /// Rays pass all surfaces that are not certain to stop them.
    bool advance();
    /// Leaves the surface by its delta event `event`; false where there is none.
    bool leave(uint8_t event);

    const Vertex& vertex() const { return vertex_; }
    /// The first surface that the present ray has met.
    RayEnd first() const { return first_; }
    const ChainRay& ray() const { return ray_; }
    /// Of the ray that left the last surface.
    RayEnd origin() const { return origin_; }
    MediumId medium() const { return medium_; }
    /// Product of the coefficients of the events and of the transmittance of the edges before the ray.
    Rgb value() const { return value_; }

    /// Follows the ray along `w` through all events; false where one of them is not met.
    bool follow(Vec3d w, const ChainEvents& events);
    /// The direction near `w` whose ray passes through the target, behind the events; the tracer has followed it then. It is a
    /// function of its arguments: found by one seed, it is found again by the same one. `ray`: the ray along `w` after its
    /// events. `most_rays`: through the whole chain.
    std::optional<Vec3d> solve(Vec3d w, const ChainEvents& events, const ChainRay& ray,
                               const ChainTarget& target, int most_rays = 30);
    /// The same, where `w` has not been followed yet.
    std::optional<Vec3d> solve(Vec3d w, const ChainEvents& events, const ChainTarget& target,
                               int most_rays);
    /// Transmittance of the edge from the last surface to the lamp, where the ray passes through its point: of masks, and
    /// of the medium. 0 where it is blocked.
    Rgb transmittance_to(const LampPoint& lamp) const;
    bool sees(const LampPoint& lamp) const { return visibility_of(lamp) > 0; }

private:
    float visibility_of(const LampPoint& lamp) const;

    const Scene& scene_;
    const Vertex& from_;
    RenderStats& stats_;
    ChainRay ray_;
    RayEnd first_, origin_;
    MediumId medium_ = kVacuum;
    Rgb value_;
    SurfaceHit hit_;
    SurfaceJet jet_;
    Vertex vertex_;
    ComponentArena arena_;
};

/// Follows a known chain of a path, vertex by vertex, without tracing it again.
class KnownChain {
public:
    /// From the point `from`, along `w`.
    KnownChain(const Scene& scene, Vec3 from, Vec3d w)
        : scene_(scene), ray_(ChainRay::start(Vec3d(from), normalize(w))) {}

    /// Goes on to `v`, and leaves it by its event; `toward` is the direction there toward the eye. False where chains may
    /// not have it.
    bool pass(const Vertex& v, Vec3 toward);
    const ChainRay& ray() const { return ray_; }

private:
    const Scene& scene_;
    ChainRay ray_;
};

/// Whether two directions of chains with the same ends and events are one solution.
inline bool is_same_solution(Vec3d a, Vec3d b) {
    constexpr double kAngle = 1e-6;
    return dot(a - b, a - b) < kAngle * kAngle;
}

/// Newton's method ends where the ray misses the target by a smaller angle, seen from the last event, and the step of the first
/// direction is smaller, too, in radians. One further step squares that.
inline constexpr double kMissOfSolutions = 1e-7, kStepOfSolutions = 1e-8;

}  // namespace etendue
