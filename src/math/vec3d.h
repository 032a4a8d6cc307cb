#pragma once
// Three-component vectors of double, for what is solved or differentiated.

#include <cmath>

#include "math/vec.h"

namespace etendue {

struct Vec3d {
    double x = 0, y = 0, z = 0;

    constexpr Vec3d() = default;
    constexpr Vec3d(double vx, double vy, double vz) : x(vx), y(vy), z(vz) {}
    constexpr explicit Vec3d(Vec3 v) : x(double(v.x)), y(double(v.y)), z(double(v.z)) {}

    friend constexpr Vec3d operator+(Vec3d a, Vec3d b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend constexpr Vec3d operator-(Vec3d a, Vec3d b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend constexpr Vec3d operator-(Vec3d a) { return {-a.x, -a.y, -a.z}; }
    friend constexpr Vec3d operator*(Vec3d a, double s) { return {a.x * s, a.y * s, a.z * s}; }
    friend constexpr Vec3d operator*(double s, Vec3d a) { return a * s; }
    friend constexpr Vec3d operator/(Vec3d a, double s) { return a * (1 / s); }
    constexpr Vec3d& operator+=(Vec3d b) { return *this = *this + b; }
    // Friends, which do not compete with those of Vec3 for braced lists.
    friend constexpr double dot(Vec3d a, Vec3d b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
    friend constexpr Vec3d cross(Vec3d a, Vec3d b) {
        return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    }
    friend double length(Vec3d a) { return std::sqrt(dot(a, a)); }
    friend Vec3d normalize(Vec3d a) { return a / length(a); }
    /// Rounded to float.
    friend constexpr Vec3 to_float(Vec3d a) { return {float(a.x), float(a.y), float(a.z)}; }
};

/// Two unit vectors that make a right-handed frame with the unit vector `n` [Duff et al. 2017].
struct TangentBasis {
    Vec3d s, t;

    explicit TangentBasis(Vec3d n) {
        const double sign = std::copysign(1.0, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
        s = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
        t = {b, sign + n.y * n.y * a, -n.y};
    }
};

}  // namespace etendue
