#pragma once
// Bidirectional mutation [Veach 1997, §11.4.1]: deletes some edges in the middle of a path, and samples others from both
// ends of the gap, as bidirectional path tracing does.

#include "mcmc/mutation/mutation.h"

namespace etendue {

class BidirectionalMutation final : public PathMutation {
public:
    explicit BidirectionalMutation(const PathMeasure& measure);

    bool suits(const PathState&) const override { return true; }
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    /// The true density: not only that of the vertices from that side that made them.
    double Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// Numbers of vertices that may be sampled from the light's side of the gap, of n in all.
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
