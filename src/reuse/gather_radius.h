#pragma once
// The largest distance between the vertices of a pair, learned from earlier passes.

#include <algorithm>

#include "film/film.h"
#include "pathspace/render_stats.h"
#include "reuse/gather_constants.h"
#include "reuse/gather_moment.h"
#include "reuse/gather_sums.h"

namespace etendue {

/// Variance and time of all samples of some passes. Variance: relative to the pixels' squared luminance; time: in rays.
struct VarianceAndTime {
    double variance = 0, time = 0;

    /// What remains without a part of both. All are estimates, and something always remains.
    VarianceAndTime without(double part_of_variance, double part_of_time) const {
        constexpr double kLeast = 0.05;
        return {std::max(variance - part_of_variance, kLeast * variance),
                std::max(time - part_of_time, kLeast * time)};
    }
};

/// A smaller radius makes gathers cheaper, a larger one makes them less noisy. Eye vertices fixed by the film point
/// (Vertex::is_fixed_by_film) have one radius, and others have a smaller one. Pairs of the former share an eye path
/// without any random choice, so that each of them helps; pairs of the latter share a random eye path.
///
/// The smaller radius is such that an eye path finds GatherConstants::inner_pairs pairs, and fewer where pairs bring
/// little. The larger one is that of the least product of variance and time. With m times the number of pairs, variance
/// and time of a sample are taken to be
///     V - M(1) + M(m)   and   T - t(1) + t(m).
/// M is the second moment of the paths that these gathers can make (GatherMoment): the number of pairs has a Poisson
/// distribution, for which this is the variance. t is the time of the search, which is proportional to m, and of the
/// trials for pairs that roulette leaves. A pair survives with the probability min(1, x/m), so that pairs with x < m cost
/// the same for any m. Their moment is then the same as well if they survive independently; systematic sampling leaves
/// only a part of it. All of this is estimated from earlier passes, so that the image remains unbiased. Time is counted
/// in rays, so that it depends neither on the machine nor on the number of threads.
class GatherRadius {
public:
    /// `given`: both radii, or 0 if they are to be chosen. `has_inner`: whether there are two; otherwise the one radius is
    /// that of GatherConstants::pairs pairs for an eye path. `seen_radius`: that of what the camera sees, in scene units.
    /// `pairs_per_radius2`: numbers of pairs that an eye path finds, by Vertex::is_fixed_by_film, divided by the square
    /// of the radius.
    void start(float given, bool has_inner, float seen_radius,
               const std::array<double, 2>& pairs_per_radius2);
    /// Chooses the radii of the next passes, unless one was given.
    void learn(const Film& film, const RenderStats& so_far, const GatherTotals& totals);
    /// The radius of eye vertices fixed by the film point, or of others.
    float of(bool is_fixed_by_film) const { return radii_[is_fixed_by_film]; }
    /// Of the passes that learn() saw last.
    const VarianceAndTime& observed() const { return observed_; }

    /// m of a candidate, in [0, kRadiusChanges).
    static constexpr double factor_of_pairs(size_t candidate) {
        constexpr double kFactors[kRadiusChanges] = {1 / 16.0, 1 / 4.0, 1, 4, 16};
        return kFactors[candidate];
    }
    /// Records a visible pair of an eye vertex fixed by the film point. `x`: its survival probability in roulette without
    /// the limit of 1; `weight_scale`: GatherWeightScale::value().
    static void observe(const GatherMoment& pair, double x, double weight_scale, GatherSums& sums) {
        // A pair that adds ten times the pixel's luminance. V leaves rare ones out, too.
        constexpr double kMost = 100;
        for (size_t k = 0; k < kRadiusChanges; ++k) {
            const double m = factor_of_pairs(k),
                         roulette = 1 + kGatherConstants.roulette_noise * std::max(0.0, m / x - 1);
            sums.moments[k] +=
                GatherMoment::fixed(std::min(pair.with(m, weight_scale, roulette), kMost));
        }
    }
    /// Records the trials for such a pair.
    static void observe_trials(uint64_t trials, double x, GatherSums& sums) {
        constexpr double kLeast = 1e-3, kMost = 1 << 20;
        const double most = std::max(x, kLeast),
                     of_pairs = 256 * std::min(double(trials), kMost) / std::min(most, 1.0);
        for (size_t k = 0; k < kRadiusChanges; ++k)
            sums.trials[k] += uint64_t(of_pairs * std::min(factor_of_pairs(k), most));
    }

    template <class Radius, class Use>
    static void for_each_field(Radius& radius, const Use& use) {
        auto& [seen_radius, radii, is_given, has_inner, eye_paths, time, before, observed] = radius;
        use(seen_radius), use(radii), use(is_given), use(has_inner), use(eye_paths), use(time),
            use(before), use(observed);
    }

private:
    /// Changes a radius, so that an eye path finds `wanted` pairs, not `pairs`.
    void grow(float& radius, double pairs, double wanted, float largest) const;

    float seen_radius_ = 0;
    std::array<float, 2> radii_{};
    bool is_given_ = false, has_inner_ = false;
    /// Of all passes, when the radii were chosen.
    double eye_paths_before_ = 0, time_before_ = 0;
    GatherTotals before_;
    VarianceAndTime observed_;
};

/// The m for which the product of variance and time is least. `variance`, `time`: V and T, each for the same unit as the
/// sums of the gathers, `moments` and `times`, which belong to the candidates of GatherRadius::factor_of_pairs().
double best_factor_of_pairs(double variance, double time,
                            const std::array<double, kRadiusChanges>& moments,
                            const std::array<double, kRadiusChanges>& times);

}  // namespace etendue
