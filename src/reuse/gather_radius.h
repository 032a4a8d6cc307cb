#pragma once
// The largest distance between the vertices of a pair, learned from earlier passes.

#include "film/film.h"
#include "pathspace/render_stats.h"
#include "reuse/gather_moment.h"
#include "reuse/gather_sums.h"

namespace etendue {

/// A smaller radius makes gathers cheaper, a larger one makes them less noisy. With m times the number of pairs, variance
/// and time of a sample are taken to be
///     V m^-a   and   T (1 - δ + δ m),
/// where δ is the part of the time that gathers take. Their product is least for m = a (1 - δ) / ((1 - a) δ). The exponent
/// a is that of V(4) = V - κ (M(1) - M(4)), where M(m) is the second moment of the paths that gathers can make
/// (GatherMoment), and κ is the part of second moments that is variance. The number of pairs changes by √m only, since a
/// is smaller for more pairs. All of this is estimated from earlier
/// passes, so that the image remains unbiased. Time is counted in rays, so that it depends neither on the machine nor on
/// the number of threads.
class GatherRadius {
public:
    /// `given`: the radius, or 0 if it is to be chosen. `scene_radius`: that of the scene's bounds. `pairs_per_radius2`:
    /// number of pairs that an eye path finds, divided by the square of the radius; 0 if unknown.
    void start(float given, float scene_radius, double pairs_per_radius2);
    /// Chooses the radius of the next passes, unless it was given; where no pair was observed, for GatherConstants::pairs.
    void learn(const Film& film, const RenderStats& so_far, const GatherTotals& totals);
    float value() const { return radius_; }
    /// √m, where kMore times the number of pairs reduces the variance by the part `gain`. `time`: δ.
    static double factor_of_pairs(double gain, double time);

    /// Records a visible pair. `weight_scale`: GatherWeightScale::value().
    static void observe(const GatherMoment& pair, double weight_scale, GatherSums& sums) {
        // A pair that adds ten times the pixel's luminance. V leaves rare ones out, too.
        constexpr double kMost = 100;
        sums.moment += GatherMoment::fixed(std::min(pair.with(1, weight_scale), kMost));
        sums.moment_of_more += GatherMoment::fixed(std::min(pair.with(kMore, weight_scale), kMost));
    }

private:
    static constexpr double kMore = 4;

    /// Sums over passes. `gain`: of M(1) - M(kMore).
    struct Sums {
        double eye_paths = 0, pairs = 0, gather_time = 0, other_time = 0, gain = 0;

        Sums operator-(const Sums& o) const {
            return {eye_paths - o.eye_paths, pairs - o.pairs, gather_time - o.gather_time,
                    other_time - o.other_time, gain - o.gain};
        }
    };

    float radius_ = 0, scene_radius_ = 0;
    bool is_given_ = false;
    Sums before_;  ///< Of all passes, when the radius was chosen.
};

}  // namespace etendue
