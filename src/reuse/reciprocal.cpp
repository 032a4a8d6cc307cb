#include "reuse/reciprocal.h"

#include <algorithm>
#include <cmath>

#include "reuse/proposal.h"

namespace etendue {
namespace {

/// The trials of one pair: rays from PairEvent::from, by the proposal with the least mass.
class Trials {
public:
    explicit Trials(const PairEvent& event) : e_(event), density_{event.from, event.mode} {
        if (e_.from.is_infinite) {
            const auto half_height =
                e_.bound == TrialBound::Slab ? std::optional(e_.near.half_height) : std::nullopt;
            parallel_ =
                ParallelProposal::make(e_.from, e_.near.p, e_.near.n, e_.near.radius, half_height);
            return;
        }
        // Rays start at a small offset from `from`, so the set of directions is enlarged by it.
        const float beside = length(offset_origin(e_.from.ray_end(), e_.from.ng) - e_.from.p);
        const Vec3 to_center = e_.near.p - e_.from.p;
        choose({to_center, e_.near.radius + beside, double(length2(to_center)),
                e_.from.is_guided(e_.mode) ? std::nullopt : e_.from.cosine_normal()},
               e_.near.half_height + beside);
    }

    /// Mass of the proposal, see proposal.h.
    double mass() const {
        if (parallel_) return parallel_->mass;
        return std::visit([](const auto& p) { return p.mass; }, proposal_);
    }

    /// A proposed ray, which ends behind the neighbourhood; empty where the trial fails without a ray.
    std::optional<Ray> next(Sampler& sampler, RenderStats& stats) const {
        std::optional<Ray> ray;
        if (parallel_) {
            ray = parallel_->propose(sampler);
        } else if (const auto w = std::visit(
                       [&](const auto& p) { return p.propose(density_, sampler, stats); },
                       proposal_)) {
            ray = Ray{e_.from.has_cosine ? offset_origin(e_.from.ray_end(), *w) : e_.from.p, *w,
                      kInf};
        }
        return ray && e_.near.clip(*ray) ? ray : std::nullopt;
    }

private:
    template <class P>
    void take_if_less(const std::optional<P>& p) {
        if (p && p->mass < mass()) proposal_ = *p;
    }

    void choose(const BallView& ball, float half_height) {
        if (e_.bound == TrialBound::Box && ball.cosine) {
            if (const auto box = BoxProposal::make(ball)) proposal_ = *box;
            return;
        }
        if (const auto ellipse = EllipseProposal::make(ball))
            proposal_ = *ellipse;
        else
            take_if_less(ConeProposal::make(ball, density_));
        if (e_.bound != TrialBound::Slab) return;
        // Height above the plane, in half heights of the slab, below which the disc would be much larger than the slab.
        constexpr float kLow = 2;
        const SlabView view(ball.to_center, e_.near.n, ball.radius, half_height);
        const bool is_high = view.height > kLow * half_height;
        if (is_high) {
            const SeenDisc disc(view);
            const auto cosine =
                ball.cosine ? CosineDiscProposal::make(disc, *ball.cosine, mass()) : std::nullopt;
            if (cosine)
                proposal_ = *cosine;
            else
                take_if_less(RegionProposal<SeenDisc>::make(disc, density_));
        }
        if (!is_high || std::holds_alternative<WalkProposal>(proposal_))
            take_if_less(RegionProposal<SeenBand>::make(SeenBand(view), density_));
    }

    const PairEvent& e_;
    WalkDensity density_;
    DirectionProposal proposal_;
    std::optional<ParallelProposal> parallel_;
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
    // The slack covers rounding errors; contains() decides exactly.
    const float slack = 1e-5f * std::fabs(end);
    if (!(end > 0) || begin > end + slack) return false;
    ray.tmax = end + slack;
    return true;
}

double reciprocal_probability(const Scene& scene, const PairEvent& event, Sampler& sampler,
                              Vertex& scratch, RenderStats& stats) {
    constexpr uint64_t kRunaway = 10'000'000;
    const Trials trials(event);
    ComponentArena arena;
    SurfaceHit hit;
    for (uint64_t n = 1; n <= kRunaway; ++n) {
        ++stats.trials;
        const auto ray = trials.next(sampler, stats);
        if (!ray) continue;
        ++stats.trial_rays;
        const float u = scene.has_masks() ? sampler.next_1d() : 0.0f;
        if (!scene.intersect(*ray, u, hit)) continue;
        arena.reset();
        scratch.set_surface(*hit.shape, hit.location, hit.geometry, -ray->d, arena);
        if (!scratch.is_connectible || !event.near.contains(scratch.p, arrival_side(scratch)))
            continue;
        RenderStats::count_trials(n, stats.pairs_by_trials);
        return double(n) / (double(event.from.survival.value()) * trials.mass());
    }
    ++stats.runaways;
    return 0;
}

}  // namespace etendue
