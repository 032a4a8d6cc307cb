#pragma once

#include "color/rgb.h"
#include "math/vec.h"
#include "pathspace/technique.h"

namespace etendue {

/// Where contributions go: the film of a pass, images by technique, the splat list of a Markov chain. A sink never
/// normalises by the number of paths; the film does.
class ContributionSink {
public:
    virtual ~ContributionSink() = default;
    /// Unweighted contribution of a path of the current eye sub-path's own pixel (t ≥ 2), and its weight.
    virtual void add_eye(const Technique& technique, Rgb contribution, float mis_weight) = 0;
    /// The same for a path that may land anywhere on the film (t ≤ 1), for one light path.
    virtual void add_splat(Vec2 film, const Technique& technique, Rgb contribution,
                           float mis_weight) = 0;
};

}  // namespace etendue
