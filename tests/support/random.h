#pragma once
// Pseudo-random numbers for tests: a counter through mix64, the same on every machine.

#include "math/hash.h"
#include "math/vec.h"

namespace etendue::testing {

class Random {
public:
    explicit Random(uint64_t seed) : state_(mix64(seed)) {}

    uint64_t bits() { return mix64(state_ += 0x9e3779b97f4a7c15ull); }
    float next_1d() { return to_unit_float(uint32_t(bits() >> 32)); }
    Vec2 next_2d() {
        const float x = next_1d(), y = next_1d();
        return {x, y};
    }
    float between(float lo, float hi) { return lo + (hi - lo) * next_1d(); }
    Vec3 in_cube() {
        const float x = between(-1, 1), y = between(-1, 1), z = between(-1, 1);
        return {x, y, z};
    }
    Vec3 unit_vector() {
        for (;;) {
            const Vec3 v = in_cube();
            if (length2(v) > 1e-3f && length2(v) <= 1) return normalize(v);
        }
    }

private:
    uint64_t state_;
};

}  // namespace etendue::testing
