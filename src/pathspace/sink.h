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

/// Receiver of states of Markov chains. The factors of their contributions are known only after the states are
/// evaluated.
class SplatSink {
public:
    virtual ~SplatSink() = default;
    /// Adds a value to the film, as a splat of a light path.
    virtual void add(Vec2 film, Rgb value) = 0;
    /// Reports the part of a join in the value passed to add(): `factor` times its weighted contribution, for any t.
    /// Called only if the workspace is observed.
    virtual void tell(const Join& join, Rgb contribution, float factor) = 0;
};

}  // namespace etendue
