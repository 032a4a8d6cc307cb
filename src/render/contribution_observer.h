#pragma once

#include "integrator/integrator.h"

namespace etendue {

/// Receives every contribution to the film together with its sub-paths.
class ContributionObserver {
public:
    virtual ~ContributionObserver() = default;
    /// The film adds contribution · mis_weight · `share` to `target`. Called from all threads.
    virtual void observe(const Join& join, Rgb contribution, float share, const FilmTarget& target,
                         const Workspace& paths) = 0;
};

}  // namespace etendue
