#pragma once

#include "pathspace/join.h"

namespace etendue {

/// Where contributions go: the film of a pass, images by technique, the splat list of a Markov chain. A sink never
/// normalises by the number of paths; the film does.
class ContributionSink {
public:
    virtual ~ContributionSink() = default;
    /// What the join brings, unweighted, with visibility. Where t ≥ 2 it belongs to the current eye sub-path's pixel;
    /// where t ≤ 1 it may land anywhere on the film, and is for one light path.
    virtual void add(const Join& join, Rgb contribution) = 0;
};

}  // namespace etendue
