#pragma once
// What differs between processors with the same instructions.

#include <cstdint>

namespace etendue {

/// Hash of what this processor's approximations of 1/x and 1/√x return, which those of Intel and AMD round differently.
/// Embree begins divisions and square roots with them, so the last bits of hits depend on them. 0 where there are none.
uint64_t reciprocals_of_processor();
/// The same of two functions, at about 8000 places of the intervals [1, 2) and, for 1/√x, [2, 4).
uint64_t hash_of_reciprocals(float (*inverse)(float), float (*inverse_root)(float));

}  // namespace etendue
