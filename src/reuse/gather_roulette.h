#pragma once
// What a pair is worth, before its light path is looked up.

#include <array>

#include "math/vec.h"
#include "pathspace/render_stats.h"

namespace etendue {

/// Russian roulette before a look at a pair estimates what its join will add to the pixel from the light vertex's flux and
/// the eye path's throughput alone. How far off that is differs with the lengths of the two sub-paths, since the
/// weight of a gather does. So joins of earlier passes tell the root mean square of what they brought over the estimate,
/// by s and t: the survival with the least variance for its cost is proportional to it.
class GatherRoulette {
public:
    /// From what passes before left; as if joins brought 1/8 of the estimate where they left nothing.
    void learn(const RenderStats& so_far);
    /// Factor of the estimate for a look at the pair of y_{s-1} and z_{t-1}.
    float of(int s, int t) const { return values_[index(s, t)]; }
    /// Of the search for partners of z_{t-1}, which may find several.
    float of_search(int t) const { return searches_[column(t)]; }

    /// A join that brought so many times the estimate: 0 where it failed, and no number, which counts as 0, where its pair
    /// could not have been found.
    static void observe(int s, int t, float brought, RenderStats& stats);

private:
    static constexpr int kLengths = RenderStats::kPairLengths;
    /// Sub-paths of this many vertices and of more are alike.
    static size_t column(int length) { return size_t(std::min(length - 2, kLengths - 1)); }
    static size_t index(int s, int t) { return column(s) * kLengths + column(t); }

    std::array<float, size_t(kLengths) * kLengths> values_{};
    std::array<float, kLengths> searches_{};
};

}  // namespace etendue
