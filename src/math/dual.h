#pragma once
// Numbers of double with their derivatives by two parameters: a formula that is written once for any type of number gives
// values in float, and values with derivatives here. Vectors of them.

#include <cmath>

#include "math/vec3d.h"

namespace etendue {

struct Dual {
    double value = 0, by_1 = 0, by_2 = 0;

    constexpr Dual() = default;
    constexpr Dual(double v, double d1 = 0, double d2 = 0) : value(v), by_1(d1), by_2(d2) {}
    explicit constexpr operator int() const { return int(value); }

    friend constexpr Dual operator+(Dual a, Dual b) {
        return {a.value + b.value, a.by_1 + b.by_1, a.by_2 + b.by_2};
    }
    friend constexpr Dual operator-(Dual a) { return {-a.value, -a.by_1, -a.by_2}; }
    friend constexpr Dual operator-(Dual a, Dual b) { return a + -b; }
    friend constexpr Dual operator*(Dual a, Dual b) {
        return {a.value * b.value, a.by_1 * b.value + a.value * b.by_1,
                a.by_2 * b.value + a.value * b.by_2};
    }
    friend constexpr Dual operator/(Dual a, Dual b) {
        return a * of(1 / b.value, -1 / (b.value * b.value), b);
    }
    // By their values.
    friend constexpr bool operator<(Dual a, Dual b) { return a.value < b.value; }
    friend constexpr bool operator>(Dual a, Dual b) { return b < a; }
    friend bool isfinite(Dual a) { return std::isfinite(a.value); }

    friend Dual sqrt(Dual a) {
        const double root = std::sqrt(a.value);
        return of(root, 0.5 / root, a);
    }
    friend Dual hypot(Dual x, Dual y) { return sqrt(x * x + y * y); }
    friend Dual atan2(Dual y, Dual x) {
        const double r2 = x.value * x.value + y.value * y.value;
        return {std::atan2(y.value, x.value), (x.value * y.by_1 - y.value * x.by_1) / r2,
                (x.value * y.by_2 - y.value * x.by_2) / r2};
    }
    friend Dual floor(Dual a) { return std::floor(a.value); }
    friend Dual fabs(Dual a) { return std::signbit(a.value) ? -a : a; }
    friend double copysign(double magnitude, Dual a) { return std::copysign(magnitude, a.value); }
    friend constexpr Dual clamp(Dual a, Dual lo, Dual hi) { return a < lo ? lo : a > hi ? hi : a; }
    friend constexpr Dual lerp(Dual t, Dual a, Dual b) { return a + t * (b - a); }

private:
    /// A function of `a` with this value and derivative.
    static constexpr Dual of(double v, double slope, Dual a) {
        return {v, slope * a.by_1, slope * a.by_2};
    }
};

struct Vec2Dual {
    Dual x, y;

    friend constexpr Vec2Dual operator*(Vec2Dual a, Dual s) { return {a.x * s, a.y * s}; }
};

struct Vec3Dual {
    Dual x, y, z;

    constexpr Vec3Dual() = default;
    constexpr Vec3Dual(Dual vx, Dual vy, Dual vz) : x(vx), y(vy), z(vz) {}
    constexpr Vec3Dual(Vec3d v, Vec3d d1 = {}, Vec3d d2 = {})
        : x(v.x, d1.x, d2.x), y(v.y, d1.y, d2.y), z(v.z, d1.z, d2.z) {}

    constexpr Vec3d value() const { return {x.value, y.value, z.value}; }
    constexpr Vec3d by_1() const { return {x.by_1, y.by_1, z.by_1}; }
    constexpr Vec3d by_2() const { return {x.by_2, y.by_2, z.by_2}; }

    friend constexpr Vec3Dual operator+(Vec3Dual a, Vec3Dual b) {
        return {a.x + b.x, a.y + b.y, a.z + b.z};
    }
    friend constexpr Vec3Dual operator-(Vec3Dual a) { return {-a.x, -a.y, -a.z}; }
    friend constexpr Vec3Dual operator-(Vec3Dual a, Vec3Dual b) { return a + -b; }
    friend constexpr Vec3Dual operator*(Vec3Dual a, Dual s) { return {a.x * s, a.y * s, a.z * s}; }
    friend constexpr Dual dot(Vec3Dual a, Vec3Dual b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
    friend constexpr Vec3Dual cross(Vec3Dual a, Vec3Dual b) {
        return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    }
    friend constexpr Dual length2(Vec3Dual a) { return dot(a, a); }
    friend Dual length(Vec3Dual a) { return sqrt(length2(a)); }
};

}  // namespace etendue
