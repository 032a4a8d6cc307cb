#pragma once
// The side of a surface on which a walk arrived, in 16 bits.

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "pathspace/vertex.h"

namespace etendue {

/// The normal on that side, to about a degree, and whether light passes through the surface.
class ArrivalSide {
public:
    ArrivalSide() = default;
    ArrivalSide(Vec3 normal, bool is_transmissive) {
        // Octahedral mapping: |x| + |y| + |z| = 1, with the lower half folded over the upper one [Meyer et al. 2010].
        const float scale = 1 / (std::fabs(normal.x) + std::fabs(normal.y) + std::fabs(normal.z));
        float a = normal.x * scale, b = normal.y * scale;
        if (normal.z < 0) {
            const float fold = 1 - std::fabs(b);
            b = std::copysign(1 - std::fabs(a), b);
            a = std::copysign(fold, a);
        }
        const auto level = [](float x, int steps) {
            return unsigned(std::lround((x * 0.5f + 0.5f) * float(steps)));
        };
        bits_ =
            uint16_t(unsigned(is_transmissive) << 15 | level(a, kStepsA) << 8 | level(b, kStepsB));
    }

    bool is_transmissive() const { return bits_ >> 15; }
    /// Unit vector, to about a degree.
    Vec3 normal() const {
        const Direction d = direction();
        return normalize({float(d.x), float(d.y), float(d.z)});
    }
    /// Whether a path that arrived on `other`, nearby, may continue from here. False for the two sides of a wall and
    /// for walls at right angles. Computed in integers, so that gathers and trials always agree.
    bool admits(ArrivalSide other) const {
        if (is_transmissive()) return true;
        const Direction a = direction(), b = other.direction();
        return a.x * b.x + a.y * b.y + a.z * b.z > 0;
    }

    uint16_t bits() const { return bits_; }
    static ArrivalSide from_bits(unsigned bits) {
        ArrivalSide side;
        side.bits_ = uint16_t(bits);
        return side;
    }

private:
    struct Direction {
        int64_t x, y, z;
    };
    /// On the octahedron |x| + |y| + |z| = kStepsA·kStepsB.
    Direction direction() const {
        constexpr int64_t kOne = int64_t(kStepsA) * kStepsB;
        const int64_t a = (2 * int64_t(bits_ >> 8 & 0x7f) - kStepsA) * kStepsB,
                      b = (2 * int64_t(bits_ & 0xff) - kStepsB) * kStepsA;
        const int64_t z = kOne - std::abs(a) - std::abs(b);
        if (z >= 0) return {a, b, z};
        const auto folded = [&](int64_t across, int64_t sign) {
            return sign < 0 ? std::abs(across) - kOne : kOne - std::abs(across);
        };
        return {folded(b, a), folded(a, b), z};
    }

    static constexpr int kStepsA = 126, kStepsB = 254;  // even, so that the axes are exact

    uint16_t bits_ = 0;
};

/// The side of surface vertex `v` on which a walk arrives that comes from the direction `from`.
inline ArrivalSide arrival_side(const Vertex& v, Vec3 from) {
    return {dot(v.ng, from) < 0 ? -v.ng : v.ng, v.shape->material->is_transmissive()};
}
/// The side on which the walk arrived at `v`.
inline ArrivalSide arrival_side(const Vertex& v) {
    return arrival_side(v, v.wo);
}

}  // namespace etendue
