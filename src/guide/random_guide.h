#pragma once

#include "guide/guide.h"

namespace etendue {

/// A guide that knows nothing and is sure of it: with it, too, everything must be unbiased. `emission`: weights of the
/// emitters, which it changes where they are positive; `at_infinity`: indices of the emitters at infinity whose
/// directions it guides; `kappa`: of all lobes.
Guide random_guide(Vec3 center, float radius, std::vector<double> emission,
                   const std::vector<uint32_t>& at_infinity, float kappa, uint64_t seed);

}  // namespace etendue
