#pragma once

#include "guide/guide.h"

namespace etendue {

/// A guide that knows nothing and is sure of it: with it, too, everything must be unbiased. `emission`: weights of the
/// emitters, which it changes where they are positive; `kappa`: of all lobes.
Guide random_guide(Vec3 center, float radius, std::vector<double> emission, float kappa,
                   uint64_t seed);

}  // namespace etendue
