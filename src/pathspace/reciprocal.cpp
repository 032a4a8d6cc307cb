#include "pathspace/reciprocal.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "math/warp.h"
#include "pathspace/seen_region.h"

namespace etendue {
namespace {

/// Where the rays of trials start and go. All that may be proposed has the probability mass() in the walk's density.
class Trials {
public:
    Trials(const PairEvent& event, Sampler& sampler)
        : e_(event), sampler_(sampler), radius_(event.near.radius),
          half_height_(event.near.half_height) {
        if (e_.from.is_infinite) {
            propose_parallel();
            return;
        }
        // Rays start beside `from`, so that what its own directions meet may lie as much beside the neighbourhood.
        const float beside = length(offset_origin(e_.from.p, e_.from.ng, e_.from.ng) - e_.from.p);
        radius_ += beside;
        half_height_ += beside;
        to_center_ = e_.near.p - e_.from.p;
        dist2_ = length2(to_center_);
        if (from_emitter()) {
            if (e_.from.has_cosine) cosine_ = e_.from.ng;
        } else {
            cosine_ = e_.from.bsdf.diffuse_normal();
        }
        if (e_.bound == TrialBound::Box && cosine_) {
            propose_box();
            return;
        }
        propose_cone();
        if (e_.bound == TrialBound::Slab) propose_region();
    }

    double mass() const { return mass_; }

    /// A proposed ray, up to the end of the neighbourhood; nothing where the trial fails without one.
    std::optional<Ray> next(RenderStats& stats) {
        Ray ray;
        switch (proposal_) {
        case Proposal::Walk:
            if (!walk(ray.d)) return {};
            break;
        case Proposal::Box:
            ray.d = in_box(sampler_.next_2d());
            if (!(pdf(ray.d) > 0)) return {};
            break;
        case Proposal::Ellipse:
            ray.d = in_ellipse(sampler_.next_2d());
            if (!(pdf(ray.d) > 0)) return {};
            break;
        case Proposal::Cone:
            ray.d = in_cone(sampler_.next_2d());
            if (!passes(pdf(ray.d), stats)) return {};
            break;
        case Proposal::Region:
            if (!in_region([&](Vec3 d) { return pdf(d); }, ray.d, stats)) return {};
            break;
        case Proposal::WholeRegion:
            // The mass of the cosine is known, so that to draw from it is no trial yet.
            while (!in_region([&](Vec3 d) { return cosine_pdf(d); }, ray.d, stats)) continue;
            if (!(pdf(ray.d) > 0)) return {};
            break;
        case Proposal::Parallel: {
            ray.d = -e_.from.p;
            const Vec2 u = sample_uniform_disk(sampler_.next_2d()) * parallel_radius_;
            const Vec3 q = e_.near.p + frame_.s * u.x + frame_.t * u.y;
            const Vec3 start = disc_.center + e_.from.p * disc_.radius;
            ray.o = q + e_.from.p * dot(start - q, e_.from.p);
            if (!(length2(ray.o - start) < sqr(disc_.radius))) return {};
            break;
        }
        }
        if (proposal_ != Proposal::Parallel)
            ray.o = e_.from.has_cosine ? offset_origin(e_.from.p, e_.from.ng, ray.d) : e_.from.p;
        return e_.near.clip(ray) ? std::optional(ray) : std::nullopt;
    }

private:
    enum class Proposal { Walk, Box, Ellipse, Cone, Region, WholeRegion, Parallel };

    bool from_emitter() const { return e_.from.kind == Vertex::Kind::Emitter; }

    /// Thinning: an event of density `pdf` is kept with probability pdf / max_pdf_.
    bool passes(float pdf, RenderStats& stats) {
        if (pdf > max_pdf_ * (1 + 1e-4f)) ++stats.bounds_exceeded;
        return sampler_.next_1d() * max_pdf_ < pdf;
    }
    /// Bound of the density of directions.
    float max_pdf(const DirectionCone& c) const {
        if (cosine_) {
            const float cos = dot(c.axis, *cosine_);
            return cos > std::cos(c.angle) ? kInvPi : kInvPi * cos_difference(cos, c.angle);
        }
        if (from_emitter()) return e_.from.emitter->max_pdf_d();
        return e_.from.bsdf.max_pdf(e_.from.wo, c);
    }
    /// cos(acos c - a), at least 0.
    static float cos_difference(float c, float a) {
        return std::max(0.0f, c * std::cos(a) + safe_sqrt(1 - c * c) * std::sin(a));
    }

    /// A light at infinity draws parallel rays uniformly from a disc.
    void propose_parallel() {
        proposal_ = Proposal::Parallel;
        disc_ = e_.from.emitter->disc();
        const double cos = abs_dot(e_.near.n, e_.from.p);
        const double disc2 = sqr(double(disc_.radius));
        // Through this part of the tangent plane passes all that meets the neighbourhood.
        const double through =
            double(radius_) + double(half_height_) * std::sqrt(std::max(0.0, 1 - cos * cos)) / cos;
        const double slab = sqr(through) * cos, ball = sqr(double(radius_));
        if (e_.bound == TrialBound::Slab && slab < ball) {
            frame_ = Frame::from_normal(e_.near.n);
            parallel_radius_ = float(through);
            mass_ = slab / disc2;
        } else {
            frame_ = Frame::from_normal(e_.from.p);
            parallel_radius_ = radius_;
            mass_ = ball / disc2;
        }
    }

    void propose_cone() {
        const double sin2 = sqr(double(radius_)) / dist2_;
        if (!(sin2 < 1)) return;  // all around: the walk's own directions
        const double sin = std::sqrt(sin2), cos = std::sqrt(1 - sin2);
        const Vec3 axis = to_center_ / std::sqrt(dist2_);
        const double cos_axis = cosine_ ? double(dot(axis, *cosine_)) : 0;
        if (cosine_ && cos_axis > sin * 1.001) {
            // The cosine density is uniform on the unit disc of (ω_x, ω_y), where the cone is an ellipse.
            proposal_ = Proposal::Ellipse;
            mass_ = sin2 * cos_axis;
            sin_ = float(sin), cos_ = float(cos), cos_axis_ = float(cos_axis);
            const Vec3 radial = axis - *cosine_ * cos_axis_;
            frame_ = Frame::from_normal_and_tangent(*cosine_, radial);
            sin_axis_ = length(radial);
            return;
        }
        const double one_minus_cos = sin2 / (1 + cos);
        const float bound = max_pdf({axis, float(std::asin(sin))});
        const double mass = 2 * double(kPi) * one_minus_cos * bound;
        if (!(mass < mass_)) return;
        proposal_ = Proposal::Cone;
        mass_ = mass;
        max_pdf_ = bound;
        one_minus_cos_ = float(one_minus_cos);
        frame_ = Frame::from_normal(axis);
    }

    /// A region through all of which the neighbourhood is seen.
    void propose_region() {
        // Below this height over the plane, in half heights of the slab, a disc would be much larger than the slab.
        constexpr float kLow = 2;
        const SlabView view(to_center_, e_.near.n, radius_, half_height_);
        if (view.height > kLow * half_height_) propose(SeenDisc(view));
        if (!(view.height > kLow * half_height_) || proposal_ == Proposal::Walk)
            propose(SeenBand(view));
    }
    void propose(const SeenDisc& disc) {
        const double whole = cosine_ ? disc.cosine_mass(*cosine_) : 0;
        if (whole > 0 && whole < mass_) {
            // Loss costs no trials there, only time.
            constexpr double kEnough = 2, kMost = 16;
            const BoundedCells cells = divide(disc, kEnough * whole);
            if (cells.mass() < kMost * whole) {
                accept(Proposal::WholeRegion, disc, cells, whole);
                return;
            }
        }
        propose_cells(disc);
    }
    void propose(const SeenBand& band) { propose_cells(band); }
    template <class Region>
    void propose_cells(const Region& region) {
        // From this far on over what would be without loss, more cells gain little.
        constexpr double kEnough = 1.1;
        const RegionPoint center = region.at({0.5f, 0.5f});
        const double without_loss = region.measure() * double(pdf(center.d) * center.scale);
        const BoundedCells cells = divide(region, kEnough * without_loss);
        if (cells.mass() < mass_) accept(Proposal::Region, region, cells, cells.mass());
    }
    template <class Region>
    BoundedCells divide(const Region& region, double enough) const {
        return {region, [&](const DirectionCone& c) { return max_pdf(c); }, enough};
    }
    template <class Region>
    void accept(Proposal proposal, const Region& region, const BoundedCells& cells, double mass) {
        proposal_ = proposal;
        region_ = region;
        cells_ = cells;
        mass_ = mass;
    }
    /// A direction of the region; false where thinning ends the trial.
    template <class Pdf>
    bool in_region(const Pdf& pdf, Vec3& d, RenderStats& stats) {
        const float u_cell = sampler_.next_1d();
        const auto choice = cells_->choose(u_cell, sampler_.next_2d());
        const RegionPoint point =
            std::visit([&](const auto& region) { return region.at(choice.u); }, *region_);
        d = point.d;
        max_pdf_ = choice.bound;
        return passes(pdf(d) * point.scale, stats);
    }

    /// With u_1 = sin² θ and u_2 = φ/2π about the normal.
    void propose_box() {
        const double sin2 = sqr(double(radius_)) / dist2_;
        if (!(sin2 < 1)) return;
        const float alpha = std::asin(float(std::sqrt(sin2)));
        const Vec3 axis = to_center_ / std::sqrt(dist2_);
        const float theta = std::acos(std::clamp(dot(axis, *cosine_), -1.0f, 1.0f));
        const bool holds_pole = !(theta > alpha);
        const float half_phi =
            holds_pole ? kPi : std::asin(std::min(1.0f, std::sin(alpha) / std::sin(theta)));
        box_lo_ = {holds_pole ? 0.0f : sqr(std::sin(std::min(theta - alpha, kPi / 2))), -half_phi};
        box_size_ = {sqr(std::sin(std::min(theta + alpha, kPi / 2))) - box_lo_.x, 2 * half_phi};
        const double mass = double(box_size_.x) * box_size_.y / (2 * double(kPi));
        if (!(mass > 0)) return;
        proposal_ = Proposal::Box;
        mass_ = mass;
        frame_ = Frame::from_normal_and_tangent(*cosine_, axis);
    }

    /// A direction as the walk draws it; false where the walk ends or leaves by a delta event.
    bool walk(Vec3& d) {
        const Vec2 u = sampler_.next_2d();
        if (from_emitter()) {
            const EmissionSample s = e_.from.emitter->sample_emission(e_.u_emission, u);
            d = s.d;
            return s.pdf_d > 0;
        }
        const auto s = e_.from.bsdf.sample(e_.from.wo, sampler_.next_1d(), u, e_.mode);
        if (!s || s->is_delta) return false;
        d = s->wi;
        return true;
    }
    float cosine_pdf(Vec3 d) const { return std::max(0.0f, dot(d, *cosine_)) * kInvPi; }
    float pdf(Vec3 d) const {
        return from_emitter() ? e_.from.emitter->eval_emission(e_.from.ng, e_.from.uv, d).pdf_d
                              : e_.from.bsdf.eval(e_.from.wo, d, e_.mode).pdf;
    }

    Vec3 in_box(Vec2 u) const {
        const float sin2 = box_lo_.x + u.x * box_size_.x, phi = box_lo_.y + u.y * box_size_.y;
        const float sin = std::sqrt(sin2);
        return frame_.to_world({sin * std::cos(phi), sin * std::sin(phi), safe_sqrt(1 - sin2)});
    }
    Vec3 in_ellipse(Vec2 u) const {
        const Vec2 disk = sample_uniform_disk(u);
        const float x = cos_ * sin_axis_ + sin_ * cos_axis_ * disk.x, y = sin_ * disk.y;
        return frame_.to_world({x, y, safe_sqrt(1 - sqr(x) - sqr(y))});
    }
    Vec3 in_cone(Vec2 u) const {
        const float h = one_minus_cos_ * u.x, sin = safe_sqrt(h * (2 - h)), phi = 2 * kPi * u.y;
        return frame_.to_world({sin * std::cos(phi), sin * std::sin(phi), 1 - h});
    }

    const PairEvent& e_;
    Sampler& sampler_;
    float radius_, half_height_;
    Vec3 to_center_;
    float dist2_ = 0;
    std::optional<Vec3> cosine_;  ///< Normal of a density cos θ/π.
    Proposal proposal_ = Proposal::Walk;
    double mass_ = 1;
    Frame frame_;  ///< About the cone's axis or the cosine's normal.
    float max_pdf_ = 0;
    float sin_ = 0, cos_ = 1, sin_axis_ = 0, cos_axis_ = 1;
    float one_minus_cos_ = 0;
    std::optional<std::variant<SeenDisc, SeenBand>> region_;
    std::optional<BoundedCells> cells_;
    Vec2 box_lo_, box_size_;
    Emitter::Disc disc_;
    float parallel_radius_ = 0;  ///< Of the disc about the vertex through which parallel rays go.
};

}  // namespace

bool Neighbourhood::clip(Ray& ray) const {
    const Vec3 v = p - ray.o;
    const float b = dot(v, ray.d), off2 = length2(v - ray.d * b);
    const float half2 = sqr(radius) - off2;
    if (!(half2 > 0)) return false;
    const float half = std::sqrt(half2);
    float begin = b - half, end = b + half;
    const float to_plane = dot(v, n), slope = dot(ray.d, n);
    if (slope != 0) {
        const float mid = to_plane / slope, reach = half_height / std::fabs(slope);
        begin = std::max(begin, mid - reach);
        end = std::min(end, mid + reach);
    } else if (std::fabs(to_plane) > half_height) {
        return false;
    }
    // What rounding puts outside is left to contains().
    const float slack = 1e-5f * std::fabs(end);
    if (!(end > 0) || begin > end + slack) return false;
    ray.tmax = end + slack;
    return true;
}

double reciprocal_probability(const Scene& scene, const PairEvent& event, Sampler& sampler,
                              Vertex& scratch, RenderStats& stats) {
    constexpr uint64_t kRunaway = 10'000'000;
    Trials trials(event, sampler);
    ComponentArena arena;
    SurfaceHit hit;
    for (uint64_t n = 1; n <= kRunaway; ++n) {
        ++stats.trials;
        const auto ray = trials.next(stats);
        if (!ray) continue;
        ++stats.trial_rays;
        const float u = scene.has_masks() ? sampler.next_1d() : 0.0f;
        if (!scene.intersect(*ray, u, hit)) continue;
        arena.reset();
        scratch.set_surface(*hit.shape, hit.location, hit.geometry, -ray->d, arena);
        if (!scratch.may_connect || !event.near.contains(scratch.p, scratch.arrival_side()))
            continue;
        stats.count_trials(n);
        return double(n) / (double(event.from.survival.value()) * trials.mass());
    }
    ++stats.runaways;
    return 0;
}

}  // namespace etendue
