#pragma once

#include "pathspace/join.h"

namespace etendue {

/// Receiver of contributions: the film of a pass, technique images, or the splat list of a Markov chain. A sink does
/// not normalise by the number of paths; the film does.
class ContributionSink {
public:
    virtual ~ContributionSink() = default;
    /// Adds the unweighted contribution of a join, including visibility. For t ≥ 2 it belongs to the pixel of the
    /// current eye sub-path. For t ≤ 1 it is that of one light path, at any film point.
    virtual void add(const Join& join, Rgb contribution) = 0;
};

/// Where states of Markov chains go, whose contributions count with factors that are known later than they are.
class SplatSink {
public:
    virtual ~SplatSink() = default;
    /// Adds to the film, as a light path's splat.
    virtual void add(Vec2 film, Rgb value) = 0;
    /// Of what add() got, a join's part: factor times its weighted contribution, wherever t is. Only where the workspace
    /// is observed.
    virtual void tell(const Join& join, Rgb contribution, float factor) = 0;
};

}  // namespace etendue
