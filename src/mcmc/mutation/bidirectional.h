#pragma once
// Bidirectional mutation [Veach 1997, §11.4.1]: deletes some edges of a path, and samples new ones from both ends of the
// gap, as bidirectional path tracing does.

#include "mcmc/mutation/mutation.h"

namespace etendue {

class BidirectionalMutation final : public PathMutation {
public:
    explicit BidirectionalMutation(const PathMeasure& measure);

    bool suits(const PathState&) const override { return true; }
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    /// Sum over all splits of the new vertices between the two sides, not only the split that made them.
    double Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// Range of the number of vertices, of n in total, that may be sampled from the light's side of the gap.
    struct Splits {
        int first, last;
        double pmf() const { return 1.0 / (last - first + 1); }
    };
    Splits splits(const PathState& x, int l, int m, int n) const;
    /// p(inserted edges | deleted edges, edges of x).
    double insertion_pmf(int inserted, int deleted, int edges) const;
    bool is_possible(int inserted, int deleted, int edges) const;

    const PathMeasure& measure_;
    bool hits_, hits_lens_;
};

}  // namespace etendue
