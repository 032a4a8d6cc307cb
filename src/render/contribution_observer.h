#pragma once

#include "integrator/integrator.h"

namespace etendue {

/// Receives every contribution to the film together with its sub-paths.
class ContributionObserver {
public:
    virtual ~ContributionObserver() = default;
    /// The film adds contribution · mis_weight · `share` to the eye path's `pixel` (t ≥ 2), or, spread by the filter, at
    /// join.film (t ≤ 1). Called from all threads.
    virtual void observe(const Join& join, Rgb contribution, float share, uint64_t pixel,
                         const Workspace& paths) = 0;
};

}  // namespace etendue
