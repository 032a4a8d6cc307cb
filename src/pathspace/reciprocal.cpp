#include "pathspace/reciprocal.h"

#include <cmath>

#include "math/warp.h"

namespace etendue {
namespace {

/// Where the rays of trials start and go. What they must hit lies in the sphere.
class Trials {
public:
    Trials(const PairEvent& event, Sampler& sampler) : e_(event), sampler_(sampler) {
        if (e_.from.is_infinite)
            propose_from_disc();
        else
            choose_proposal();
    }

    /// Probability of all that may be proposed, in the density that the walk has.
    double mass() const { return mass_; }

    /// A proposed ray, up to the end of the sphere; nothing where the trial fails without one.
    std::optional<Ray> next(RenderStats& stats) {
        Ray ray;
        switch (proposal_) {
        case Proposal::Walk:
            if (!walk(ray.d)) return {};
            break;
        case Proposal::Ellipse:
            ray.d = in_ellipse(sampler_.next_2d());
            if (!(pdf(ray.d) > 0)) return {};
            break;
        case Proposal::Cone: {
            ray.d = in_cone(sampler_.next_2d());
            const float p = pdf(ray.d);
            if (p > max_pdf_ * (1 + 1e-4f)) ++stats.bounds_exceeded;
            if (!(sampler_.next_1d() * max_pdf_ < p)) return {};
            break;
        }
        case Proposal::Disc:
            ray.d = -e_.from.p;
            ray.o = on_disc(sampler_.next_2d());
            if (!is_near(ray.o, disc_.center + e_.from.p * disc_.radius, sqr(disc_.radius)))
                return {};
            break;
        }
        if (proposal_ != Proposal::Disc)
            ray.o = e_.from.has_cosine ? offset_origin(e_.from.p, e_.from.ng, ray.d) : e_.from.p;
        return to_end_of_sphere(ray) ? std::optional(ray) : std::nullopt;
    }

private:
    enum class Proposal { Walk, Ellipse, Cone, Disc };

    bool from_emitter() const { return e_.from.kind == Vertex::Kind::Emitter; }

    void propose_from_disc() {
        proposal_ = Proposal::Disc;
        disc_ = e_.from.emitter->disc();
        frame_ = Frame::from_normal(e_.from.p);
        mass_ = sqr(double(e_.radius) / disc_.radius);
    }

    void choose_proposal() {
        const Vec3 v = e_.center - e_.from.p;
        const double sin2 = sqr(double(e_.radius)) / double(length2(v));
        if (!(sin2 < 1)) return;  // all around: the walk's own directions
        frame_ = Frame::from_normal(normalize(v));
        const double sin = std::sqrt(sin2), cos = std::sqrt(1 - sin2);
        one_minus_cos_ = float(sin2 / (1 + cos));

        const auto normal = from_emitter()
                                ? (e_.from.has_cosine ? std::optional(e_.from.ng) : std::nullopt)
                                : e_.from.bsdf.diffuse_normal();
        const double cos_axis = normal ? double(dot(frame_.n, *normal)) : 0;
        if (normal && cos_axis > sin * 1.001) {
            // The cosine density is uniform on the unit disc of (ω_x, ω_y), where the cone is an ellipse.
            proposal_ = Proposal::Ellipse;
            mass_ = sin2 * cos_axis;
            sin_ = float(sin), cos_ = float(cos), cos_axis_ = float(cos_axis);
            const Vec3 radial = frame_.n - *normal * cos_axis_;
            frame_ = Frame::from_normal_and_tangent(*normal, radial);
            sin_axis_ = length(radial);
            return;
        }
        const DirectionCone cone{frame_.n, float(std::asin(sin))};
        max_pdf_ =
            from_emitter() ? e_.from.emitter->max_pdf_d() : e_.from.bsdf.max_pdf(e_.from.wo, cone);
        const double mass = 2 * double(kPi) * one_minus_cos_ * max_pdf_;
        if (!(mass < 1)) return;
        proposal_ = Proposal::Cone;
        mass_ = mass;
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

    Vec3 in_ellipse(Vec2 u) const {
        const Vec2 disk = sample_uniform_disk(u);
        const float x = cos_ * sin_axis_ + sin_ * cos_axis_ * disk.x, y = sin_ * disk.y;
        return frame_.to_world({x, y, safe_sqrt(1 - sqr(x) - sqr(y))});
    }
    Vec3 in_cone(Vec2 u) const {
        const float h = one_minus_cos_ * u.x, sin = safe_sqrt(h * (2 - h)), phi = 2 * kPi * u.y;
        return frame_.to_world({sin * std::cos(phi), sin * std::sin(phi), 1 - h});
    }
    Vec3 on_disc(Vec2 u) const {
        const Vec3 plane = disc_.center + e_.from.p * disc_.radius;
        const Vec3 foot = e_.center + e_.from.p * dot(plane - e_.center, e_.from.p);
        const Vec2 disk = sample_uniform_disk(u) * e_.radius;
        return foot + frame_.s * disk.x + frame_.t * disk.y;
    }

    /// Sets the ray's end where it leaves the sphere; false where it misses it.
    bool to_end_of_sphere(Ray& ray) const {
        const Vec3 v = e_.center - ray.o;
        const float b = dot(v, ray.d), off2 = length2(v - ray.d * b);
        const float half2 = sqr(e_.radius) - off2;
        if (!(half2 > 0)) return false;
        ray.tmax = (b + std::sqrt(half2)) * (1 + 1e-5f);
        return ray.tmax > 0;
    }

    const PairEvent& e_;
    Sampler& sampler_;
    Proposal proposal_ = Proposal::Walk;
    double mass_ = 1;
    Frame frame_;  ///< About the cone's axis, the diffuse normal, or the light's direction.
    float sin_ = 0, cos_ = 1, sin_axis_ = 0, cos_axis_ = 1;
    float one_minus_cos_ = 0, max_pdf_ = 0;
    Emitter::Disc disc_;
};

}  // namespace

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
        if (!scene.intersect(*ray, u, hit) ||
            !is_near(hit.geometry.p, event.center, sqr(event.radius)))
            continue;
        arena.reset();
        scratch.set_surface(*hit.shape, hit.location, hit.geometry, -ray->d, arena);
        if (scratch.may_connect)
            return double(n) / (double(event.from.survival.value()) * trials.mass());
    }
    ++stats.runaways;
    return 0;
}

}  // namespace etendue
