#include "reuse/proposal.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/warp.h"

namespace etendue {
namespace {

/// Thinning: an event of density `pdf` is kept with probability pdf / bound. A number with few bits would keep improbable
/// events too often.
bool passes(float pdf, float bound, Sampler& sampler, RenderStats& stats) {
    if (pdf > bound * (1 + 1e-4f)) ++stats.bounds_exceeded;
    return sampler.next_1d_unstructured() * double(bound) < double(pdf);
}

/// A point of the region, drawn with the density of the cells' bounds and kept with that of `pdf`.
template <class Region, class Pdf>
std::optional<Vec3> thinned(const Region& region, const BoundedCells& cells, const Pdf& pdf,
                            Sampler& sampler, RenderStats& stats) {
    const float u_cell = sampler.next_1d();
    const auto choice = cells.choose(u_cell, sampler.next_2d());
    const RegionPoint point = region.at(choice.u);
    if (!passes(pdf(point.d) * point.scale, choice.bound, sampler, stats)) return {};
    return point.d;
}

std::optional<Vec3> where_positive(const WalkDensity& density, Vec3 w) {
    return density.pdf(w) > 0 ? std::optional(w) : std::nullopt;
}

}  // namespace

float WalkDensity::max_pdf(const DirectionCone& cone) const {
    return from.max_pdf(cone, mode);
}

std::optional<Vec3> WalkProposal::propose(const WalkDensity& density, Sampler& sampler,
                                          RenderStats&) const {
    const Vec2 u = sampler.next_2d();
    const float u_lobe = density.from.kind == Vertex::Kind::Emitter ? 0.0f : sampler.next_1d();
    const float u_guide = density.from.guide ? sampler.next_1d() : 0.0f;
    const auto s = density.from.sample(u_lobe, u, u_guide, density.mode);
    if (!s || s->is_delta) return {};
    return s->wi;
}

std::optional<BoxProposal> BoxProposal::make(const BallView& view) {
    const double sin2 = view.sin2();
    if (!view.cosine || !(sin2 < 1)) return {};
    const float alpha = std::asin(float(std::sqrt(sin2)));
    const Vec3 axis = view.to_center / float(std::sqrt(view.dist2));
    const float theta = std::acos(std::clamp(dot(axis, *view.cosine), -1.0f, 1.0f));
    const bool holds_pole = !(theta > alpha);
    const float half_phi =
        holds_pole ? kPi : std::asin(std::min(1.0f, std::sin(alpha) / std::sin(theta)));
    BoxProposal p;
    p.low = {holds_pole ? 0.0f : sqr(std::sin(std::min(theta - alpha, kPi / 2))), -half_phi};
    p.size = {sqr(std::sin(std::min(theta + alpha, kPi / 2))) - p.low.x, 2 * half_phi};
    p.mass = double(p.size.x) * double(p.size.y) / (2 * std::numbers::pi);
    if (!(p.mass > 0)) return {};
    p.frame = Frame::from_normal_and_tangent(*view.cosine, axis);
    return p;
}

std::optional<Vec3> BoxProposal::propose(const WalkDensity& density, Sampler& sampler,
                                         RenderStats&) const {
    const Vec2 u = sampler.next_2d();
    const float sin2 = low.x + u.x * size.x, phi = low.y + u.y * size.y;
    const float sin = std::sqrt(sin2);
    return where_positive(
        density, frame.to_world({sin * std::cos(phi), sin * std::sin(phi), safe_sqrt(1 - sin2)}));
}

std::optional<EllipseProposal> EllipseProposal::make(const BallView& view) {
    const double sin2 = view.sin2();
    if (!view.cosine || !(sin2 < 1)) return {};
    const double sin = std::sqrt(sin2);
    const Vec3 axis = view.to_center / float(std::sqrt(view.dist2));
    const double cos_axis = double(dot(axis, *view.cosine));
    if (!(cos_axis > sin * 1.001)) return {};
    const Vec3 radial = axis - *view.cosine * float(cos_axis);
    return EllipseProposal{.mass = sin2 * cos_axis,
                           .frame = Frame::from_normal_and_tangent(*view.cosine, radial),
                           .sin = float(sin),
                           .cos = float(std::sqrt(1 - sin2)),
                           .cos_axis = float(cos_axis),
                           .sin_axis = length(radial)};
}

std::optional<Vec3> EllipseProposal::propose(const WalkDensity& density, Sampler& sampler,
                                             RenderStats&) const {
    const Vec2 disk = sample_uniform_disk(sampler.next_2d());
    const float x = cos * sin_axis + sin * cos_axis * disk.x, y = sin * disk.y;
    return where_positive(density, frame.to_world({x, y, safe_sqrt(1 - sqr(x) - sqr(y))}));
}

std::optional<ConeProposal> ConeProposal::make(const BallView& view, const WalkDensity& density) {
    const double sin2 = view.sin2();
    if (!(sin2 < 1)) return {};
    const double sin = std::sqrt(sin2), one_minus_cos = sin2 / (1 + std::sqrt(1 - sin2));
    const Vec3 axis = view.to_center / float(std::sqrt(view.dist2));
    const float bound = density.max_pdf({axis, float(std::asin(sin))});
    return ConeProposal{.mass = 2 * std::numbers::pi * one_minus_cos * double(bound),
                        .frame = Frame::from_normal(axis),
                        .max_pdf = bound,
                        .one_minus_cos = float(one_minus_cos)};
}

std::optional<Vec3> ConeProposal::propose(const WalkDensity& density, Sampler& sampler,
                                          RenderStats& stats) const {
    const Vec2 u = sampler.next_2d();
    const float h = one_minus_cos * u.x, sin = safe_sqrt(h * (2 - h)), phi = 2 * kPi * u.y;
    const Vec3 w = frame.to_world({sin * std::cos(phi), sin * std::sin(phi), 1 - h});
    if (!passes(density.pdf(w), max_pdf, sampler, stats)) return {};
    return w;
}

template <class Region>
std::optional<RegionProposal<Region>> RegionProposal<Region>::make(const Region& region,
                                                                   const WalkDensity& density) {
    // If the mass is at most this factor above that of an exact bound, more cells gain little.
    constexpr double kEnough = 1.1;
    const RegionPoint center = region.at({0.5f, 0.5f});
    const double without_loss = region.measure() * double(density.pdf(center.d) * center.scale);
    const BoundedCells cells(
        region, [&](const DirectionCone& c) { return density.max_pdf(c); }, kEnough * without_loss);
    return RegionProposal{cells.mass(), region, cells};
}

template <class Region>
std::optional<Vec3> RegionProposal<Region>::propose(const WalkDensity& density, Sampler& sampler,
                                                    RenderStats& stats) const {
    return thinned(
        region, cells, [&](Vec3 w) { return density.pdf(w); }, sampler, stats);
}

template struct RegionProposal<SeenDisc>;
template struct RegionProposal<SeenBand>;

std::optional<CosineDiscProposal> CosineDiscProposal::make(const SeenDisc& disc, Vec3 normal,
                                                           double below) {
    // Rejections cost time here, but no trials.
    constexpr double kEnough = 2, kMost = 16;
    const double mass = disc.cosine_mass(normal);
    if (!(mass > 0 && mass < below)) return {};
    const BoundedCells cells(
        disc, [&](const DirectionCone& c) { return c.max_cosine_pdf(normal); }, kEnough * mass);
    if (!(cells.mass() < kMost * mass)) return {};
    return CosineDiscProposal{mass, normal, disc, cells};
}

std::optional<Vec3> CosineDiscProposal::propose(const WalkDensity& density, Sampler& sampler,
                                                RenderStats& stats) const {
    const auto cosine = [&](Vec3 w) { return std::max(0.0f, dot(w, normal)) * kInvPi; };
    // At least one draw in kMost is accepted on average. So many rejections mean that the geometry is NaN.
    for (int draw = 0; draw < 100000; ++draw)
        if (const auto w = thinned(disc, cells, cosine, sampler, stats))
            return where_positive(density, *w);
    ++stats.runaways;
    return {};
}

ParallelProposal ParallelProposal::make(const Vertex& y0, Vec3 center, Vec3 n, float ball_radius,
                                        std::optional<float> half_height) {
    ParallelProposal p{.mass = 0,
                       .travel = -y0.p,
                       .center = center,
                       .disc = y0.emitter->disc(),
                       .frame = Frame::from_normal(y0.p),
                       .radius = ball_radius};
    const double disc2 = sqr(double(p.disc.radius)), ball = sqr(double(ball_radius));
    p.mass = ball / disc2;
    if (!half_height) return p;
    // All rays that meet the slab pass through this disc in the tangent plane.
    const double cos = double(abs_dot(n, y0.p));
    const double through =
        double(ball_radius) + double(*half_height) * std::sqrt(std::max(0.0, 1 - cos * cos)) / cos;
    const double slab = sqr(through) * cos;
    if (!(slab < ball)) return p;
    p.frame = Frame::from_normal(n);
    p.radius = float(through);
    p.mass = slab / disc2;
    return p;
}

std::optional<Ray> ParallelProposal::propose(Sampler& sampler) const {
    const Vec2 u = sample_uniform_disk(sampler.next_2d()) * radius;
    const Vec3 q = center + frame.s * u.x + frame.t * u.y;
    const Vec3 start = disc.center - travel * disc.radius;
    const Vec3 o = q - travel * dot(start - q, -travel);
    if (!(length2(o - start) < sqr(disc.radius))) return {};
    return Ray{o, travel, kInf};
}

}  // namespace etendue
