#include "pathspace/reciprocal.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "math/warp.h"

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
        if (e_.bound == TrialBound::Slab) propose_patch();
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
        case Proposal::Patch:
            if (!toward(in_patch(sampler_.next_2d()), ray.d, stats)) return {};
            break;
        case Proposal::Cells: {
            const auto q = in_cell();
            if (!q || !toward(*q, ray.d, stats)) return {};
            break;
        }
        case Proposal::Parallel: {
            ray.d = -e_.from.p;
            const Vec3 q = in_patch(sampler_.next_2d());
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
    enum class Proposal { Walk, Box, Ellipse, Cone, Patch, Cells, Parallel };

    /// Part of a plane through the neighbourhood's centre: a disc or a rectangle.
    struct Patch {
        Vec3 s, t;
        Vec2 half;  ///< Extents along these.
        bool is_round;
        float height = 0;  ///< Of `from` over the plane,
        Vec2 foot;         ///< and its foot.

        double area() const { return (is_round ? double(kPi) : 4.0) * double(half.x) * half.y; }
        float radius() const { return is_round ? half.x : std::hypot(half.x, half.y); }
    };
    struct Cell {
        Vec2 center;
        float max_pdf;
        double mass;
    };

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
            patch_ = disc_about(e_.near.n, float(through));
            mass_ = slab / disc2;
        } else {
            patch_ = disc_about(e_.from.p, radius_);
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

    /// Points P of a patch through all of which the neighbourhood is seen. With the height H of `from` over its plane their
    /// area density is p_σ H / |P - x|³.
    void propose_patch() {
        const float height = abs_dot(e_.near.n, to_center_), h = half_height_;
        Patch patch;
        if (height > 2 * h) {
            const float foot = safe_sqrt(dist2_ - sqr(height));
            patch = disc_about(e_.near.n, radius_ + (radius_ + foot) * h / (height - h));
            patch.height = height;
            patch.foot = {-dot(to_center_, patch.s), -dot(to_center_, patch.t)};
        } else if (sqr(radius_) < 0.25f * dist2_) {
            patch = seen_edge_on();
        } else {
            return;
        }
        // From this far on a smaller mass is worth its cost.
        constexpr double kLoose = 1.5;
        const float dist = std::sqrt(dist2_);
        const double density = max_area_pdf(patch, {}, patch.radius());
        if (patch.area() * density < mass_) {
            proposal_ = Proposal::Patch;
            mass_ = patch.area() * density;
            max_pdf_ = float(density);
            patch_ = patch;
        }
        const double found = double(kPi) * sqr(double(e_.near.radius)) *
                             double(pdf(to_center_ / dist) * height / (dist2_ * dist));
        if (mass_ > kLoose * found) propose_cells(patch);
    }
    /// Bound of the area density of points within `reach` of `center`; infinite where that goes all around `from`.
    double max_area_pdf(const Patch& patch, Vec2 center, float reach) const {
        const Vec3 v = to_center_ + patch.s * center.x + patch.t * center.y;
        const float dist = length(v), sin = reach / dist;
        if (!(sin < 1)) return double(kInf);
        const float to_foot = std::hypot(center.x - patch.foot.x, center.y - patch.foot.y);
        const double nearest2 =
            sqr(double(patch.height)) + sqr(double(std::max(0.0f, to_foot - reach)));
        return double(max_pdf({v / dist, std::asin(sin)})) * patch.height /
               (nearest2 * std::sqrt(nearest2));
    }
    /// A grid of cells over the patch, each with its own bound.
    void propose_cells(const Patch& patch) {
        const Vec2 half = patch.half * (1.0f / kCells);
        const float reach = std::hypot(half.x, half.y);
        double mass = 0;
        cell_count_ = 0;
        for (int i = 0; i < kCells * kCells; ++i) {
            const Vec2 center{(2 * float(i % kCells) + 1) * half.x - patch.half.x,
                              (2 * float(i / kCells) + 1) * half.y - patch.half.y};
            if (patch.is_round && std::hypot(center.x, center.y) > patch.half.x + reach) continue;
            const double density = max_area_pdf(patch, center, reach);
            const double cell = 4 * double(half.x) * half.y * density;
            if (!(mass + cell < mass_)) return;
            mass += cell;
            cells_[size_t(cell_count_++)] = {center, float(density), cell};
        }
        if (!(mass > 0)) return;
        proposal_ = Proposal::Cells;
        mass_ = mass;
        patch_ = patch;
    }
    /// A rectangle across the direction to a neighbourhood that lies almost in its tangent plane. In perspective the ball
    /// is a disc there, and what the slab leaves of it a strip.
    Patch seen_edge_on() const {
        const float dist = std::sqrt(dist2_);
        const Vec3 axis = to_center_ / dist;
        const float sin_tilt = std::fabs(dot(e_.near.n, axis)),
                    cos_tilt = safe_sqrt(1 - sqr(sin_tilt));
        Patch patch;
        patch.t = normalize(e_.near.n - axis * dot(e_.near.n, axis));
        patch.s = cross(axis, patch.t);
        const float disc = radius_ / safe_sqrt(1 - sqr(radius_ / dist));
        const float strip =
            (half_height_ + radius_ * sin_tilt) / cos_tilt * dist / (dist - radius_);
        patch.half = {disc, std::min(disc, strip)};
        patch.is_round = false;
        patch.height = dist;
        return patch;
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
    float pdf(Vec3 d) const {
        return from_emitter() ? e_.from.emitter->eval_emission(e_.from.ng, e_.from.uv, d).pdf_d
                              : e_.from.bsdf.eval(e_.from.wo, d, e_.mode).pdf;
    }

    Patch disc_about(Vec3 n, float radius) const {
        const Frame frame = Frame::from_normal(n);
        return {.s = frame.s, .t = frame.t, .half = {radius, radius}, .is_round = true, .foot = {}};
    }
    Vec3 at(Vec2 q) const { return e_.near.p + patch_.s * q.x + patch_.t * q.y; }
    Vec3 in_patch(Vec2 u) const {
        const Vec2 q = patch_.is_round ? sample_uniform_disk(u) : Vec2{2 * u.x - 1, 2 * u.y - 1};
        return at({q.x * patch_.half.x, q.y * patch_.half.y});
    }
    /// Nothing where the cell reaches beyond the patch. Sets max_pdf_.
    std::optional<Vec3> in_cell() {
        double u = double(sampler_.next_1d()) * mass_;
        int i = 0;
        while (i + 1 < cell_count_ && u >= cells_[size_t(i)].mass) u -= cells_[size_t(i++)].mass;
        const Vec2 v = sampler_.next_2d();
        const Cell& cell = cells_[size_t(i)];
        max_pdf_ = cell.max_pdf;
        const Vec2 q{cell.center.x + (2 * v.x - 1) * patch_.half.x / kCells,
                     cell.center.y + (2 * v.y - 1) * patch_.half.y / kCells};
        if (patch_.is_round && sqr(q.x) + sqr(q.y) > sqr(patch_.half.x)) return {};
        return at(q);
    }
    /// The direction to a point of the patch; false where thinning ends the trial.
    bool toward(Vec3 q, Vec3& d, RenderStats& stats) {
        const Vec3 v = q - e_.from.p;
        const float dist2 = length2(v), inv_dist = 1 / std::sqrt(dist2);
        d = v * inv_dist;
        return passes(pdf(d) * patch_.height * inv_dist / dist2, stats);
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
    static constexpr int kCells = 4;  ///< Along either side of a patch.
    Patch patch_;
    std::array<Cell, kCells * kCells> cells_;
    int cell_count_ = 0;
    Vec2 box_lo_, box_size_;
    Emitter::Disc disc_;
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
        if (!scene.intersect(*ray, u, hit) || !event.near.contains(hit.geometry.p)) continue;
        arena.reset();
        scratch.set_surface(*hit.shape, hit.location, hit.geometry, -ray->d, arena);
        if (!scratch.may_connect) continue;
        stats.count_trials(n);
        return double(n) / (double(event.from.survival.value()) * trials.mass());
    }
    ++stats.runaways;
    return 0;
}

}  // namespace etendue
