#pragma once
// Axis-aligned boxes.

#include "math/vec.h"

namespace etendue {

struct Bounds3 {
    Vec3 lo{kInf, kInf, kInf}, hi{-kInf, -kInf, -kInf};

    bool is_empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
    void extend(Vec3 p) {
        lo = min(lo, p);
        hi = max(hi, p);
    }
    void extend(const Bounds3& b) {
        lo = min(lo, b.lo);
        hi = max(hi, b.hi);
    }
    Vec3 center() const { return (lo + hi) * 0.5f; }
    float radius() const { return is_empty() ? 0.0f : 0.5f * length(hi - lo); }
};

}  // namespace etendue
