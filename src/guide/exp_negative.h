#pragma once

#include <bit>
#include <cstdint>

namespace etendue {

/// exp(x) for x ≤ 0, to about 2 ulp, in eight lanes.
inline float exp_negative(float x) {
    constexpr float kLog2e = 1.44269504f, kLn2High = 0.693359375f, kLn2Low = -2.12194440e-4f;
    x = x > -87 ? x : -87.0f;
    const float n = float(int(x * kLog2e - 0.5f));
    const float r = (x - n * kLn2High) - n * kLn2Low;
    const float r2 = r * r;
    const float p =
        1 + r +
        r2 * (0.5f +
              r * (0.166666657f +
                   r * (0.0416665795f + r * (8.33345205e-3f + r * (1.39081953e-3f + r * 2e-4f)))));
    return p * std::bit_cast<float>((int32_t(n) + 127) << 23);
}

}  // namespace etendue
