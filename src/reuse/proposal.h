#pragma once
// What Bernoulli trials propose: directions among which lie all that lead from a vertex into a neighbourhood. Each proposal
// knows its mass, the probability that the walk's own density (or a bound of it, which thinning makes up for) gives to
// them; a trial fails with the rest.

#include <optional>
#include <variant>

#include "emitter/emitter.h"
#include "pathspace/walk.h"
#include "reuse/seen_region.h"

namespace etendue {

/// The directions in which a walk leaves `from`: its smooth events alone, roulette left out.
struct WalkDensity {
    const Vertex& from;
    TransportMode mode;

    float pdf(Vec3 w) const { return from.eval(w, mode).pdf; }
    float max_pdf(const DirectionCone& cone) const;
};

/// A ball about the kept vertex, seen from `from`.
struct BallView {
    Vec3 to_center;
    float radius;
    double dist2;
    std::optional<Vec3>
        cosine;  ///< Normal about which the density of directions is cos θ/π, if it is.

    /// Sine of the half-angle, squared; 1 and more from inside.
    double sin2() const { return sqr(double(radius)) / dist2; }
};

// Each has `double mass` and propose(): a direction, or nothing where the trial fails without a ray.

/// The walk's own directions: all of them.
struct WalkProposal {
    double mass = 1;
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// A box of the random numbers u_1 = sin² θ, u_2 = φ/2π of a cosine density [Qin et al. 2015, supplement, eq. 3-4].
struct BoxProposal {
    double mass;
    Frame frame;
    Vec2 low, size;

    static std::optional<BoxProposal> make(const BallView& view);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// The cone of a ball clear of the horizon of a cosine density, which is uniform on the unit disc of (ω_x, ω_y), where the
/// cone is an ellipse.
struct EllipseProposal {
    double mass;
    Frame frame;
    float sin, cos, cos_axis, sin_axis;

    static std::optional<EllipseProposal> make(const BallView& view);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// The cone of a ball, uniformly, thinned by the density over its bound.
struct ConeProposal {
    double mass;
    Frame frame;
    float max_pdf, one_minus_cos;

    static std::optional<ConeProposal> make(const BallView& view, const WalkDensity& density);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// A region through which all of a flat neighbourhood is seen, in cells each of which is thinned by a bound of its own.
template <class Region>
struct RegionProposal {
    double mass;
    Region region;
    BoundedCells cells;

    static std::optional<RegionProposal> make(const Region& region, const WalkDensity& density);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// A cosine density within a disc of the tangent plane, whose mass is known: to draw from it is no trial yet.
struct CosineDiscProposal {
    double mass;
    Vec3 normal;
    SeenDisc disc;
    BoundedCells cells;

    static std::optional<CosineDiscProposal> make(const SeenDisc& disc, Vec3 normal,
                                                  const WalkDensity& density, double below);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// The parallel rays of an emitter at infinity that may pass the neighbourhood, of all that start on the emitter's disc.
struct ParallelProposal {
    double mass;
    Vec3 travel, center;  ///< Of the rays; of the neighbourhood.
    Emitter::Disc disc;
    Frame frame;
    float radius;

    /// The ball of `ball_radius` about `center`; of it the slab about the plane normal to `n`, where that is less.
    static ParallelProposal make(const Vertex& y0, Vec3 center, Vec3 n, float ball_radius,
                                 std::optional<float> half_height);
    std::optional<Ray> propose(Sampler& sampler) const;
};

using DirectionProposal =
    std::variant<WalkProposal, BoxProposal, EllipseProposal, ConeProposal, RegionProposal<SeenDisc>,
                 RegionProposal<SeenBand>, CosineDiscProposal>;

}  // namespace etendue
