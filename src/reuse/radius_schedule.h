#pragma once

#include <cmath>
#include <cstdint>

namespace etendue {

/// r_i = r_1 i^((α-1)/2), for which bias and noise both converge to zero [Knaus & Zwicker 2011, eq. 15].
struct RadiusSchedule {
    float first;  ///< r_1, in scene units.
    float alpha;  ///< 1: the radius does not shrink.

    /// Radius of the pass with index `pass`, from 0.
    float radius(uint32_t pass) const { return first * std::pow(float(pass + 1), (alpha - 1) / 2); }
    bool shrinks() const { return alpha < 1; }
};

}  // namespace etendue
