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
    PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// Range of the number of vertices, of n in total, that may be sampled from the light's side of the gap.
    struct Splits {
        int first, last;
        double pmf() const { return 1.0 / (last - first + 1); }
    };
    /// What a mutation deletes of a path of `edges` edges: everything between x_l and x_m.
    struct Gap {
        int l, m, edges;
        int deleted() const { return m - l; }
    };
    Splits splits(const PathState& x, const Gap& gap, int n) const;
    /// Whether a new path can come of inserting so many edges.
    bool is_possible(const Gap& gap, int inserted) const;
    /// Sum of the weights of all numbers of edges that can be inserted.
    double insertion_sum(const Gap& gap) const;

    const PathMeasure& measure_;
    bool hits_, hits_lens_;
    bool has_one_origin_;  ///< Whether all paths begin at one point or direction.
};

}  // namespace etendue
