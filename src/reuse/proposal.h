#pragma once
// Proposals of Bernoulli trials: sets of directions that contain all directions from a vertex into a neighbourhood.
// Each has a mass: the integral of the walk's density, or of an upper bound of it, over the set. With an upper bound,
// proposed directions are accepted with probability density / bound (thinning).

#include <optional>
#include <variant>

#include "emitter/emitter.h"
#include "pathspace/walk.h"
#include "reuse/seen_region.h"

namespace etendue {

/// Density of the directions in which a walk leaves `from` by smooth events, without roulette.
struct WalkDensity {
    const Vertex& from;
    TransportMode mode;

    float pdf(Vec3 w) const { return from.eval(w, mode).pdf; }
    float max_pdf(const DirectionCone& cone) const;
};

/// A ball around the kept vertex, seen from WalkDensity::from.
struct BallView {
    Vec3 to_center;
    float radius;
    double dist2;
    std::optional<Vec3>
        cosine;  ///< Normal about which the density of directions is cos θ/π, if it is.

    /// Squared sine of the half-angle of the ball's cone; at least 1 from inside the ball.
    double sin2() const { return sqr(double(radius)) / dist2; }
};

// Each has `double mass` and propose(): a direction, or empty where the trial fails without a ray.

/// All directions, sampled like the walk.
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

/// The cone of a ball above the horizon, for a cosine density. That density is uniform on the unit disc of (ω_x, ω_y),
/// where the cone is an ellipse.
struct EllipseProposal {
    double mass;
    Frame frame;
    float sin, cos, cos_axis, sin_axis;

    static std::optional<EllipseProposal> make(const BallView& view);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// The cone of a ball, sampled uniformly, with thinning by density / bound.
struct ConeProposal {
    double mass;
    Frame frame;
    float max_pdf, one_minus_cos;

    static std::optional<ConeProposal> make(const BallView& view, const WalkDensity& density);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// A region that contains all directions to a flat neighbourhood, divided into cells with separate bounds for thinning.
template <class Region>
struct RegionProposal {
    double mass;
    Region region;
    BoundedCells cells;

    static std::optional<RegionProposal> make(const Region& region, const WalkDensity& density);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// A cosine density restricted to a disc in the tangent plane, whose mass is known in closed form. It is sampled by
/// rejection, and the rejections are not trials.
struct CosineDiscProposal {
    double mass;
    Vec3 normal;
    SeenDisc disc;
    BoundedCells cells;

    /// Empty if the mass would be 0 or not less than `below`.
    static std::optional<CosineDiscProposal> make(const SeenDisc& disc, Vec3 normal, double below);
    std::optional<Vec3> propose(const WalkDensity& density, Sampler& sampler, RenderStats&) const;
};

/// The parallel rays from an emitter at infinity that can meet the neighbourhood, among all that start on its disc.
struct ParallelProposal {
    double mass;
    Vec3 travel, center;  ///< Direction of the rays; centre of the neighbourhood.
    Emitter::Disc disc;
    Frame frame;
    float radius;

    /// For the ball of radius `ball_radius` about `center`, or for its slab around the plane normal to `n` if that has
    /// less mass.
    static ParallelProposal make(const Vertex& y0, Vec3 center, Vec3 n, float ball_radius,
                                 std::optional<float> half_height);
    std::optional<Ray> propose(Sampler& sampler) const;
};

using DirectionProposal =
    std::variant<WalkProposal, BoxProposal, EllipseProposal, ConeProposal, RegionProposal<SeenDisc>,
                 RegionProposal<SeenBand>, CosineDiscProposal>;

}  // namespace etendue
