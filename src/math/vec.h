#pragma once
// Two- and three-component vectors of float; plain data, all operations inline.

#include <algorithm>
#include <cmath>

namespace etendue {

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;
inline constexpr float kInf = __builtin_inff();
/// Largest float below one: random numbers lie in [0, kOneMinusEpsilon].
inline constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;

template <class T>
constexpr T sqr(T x) {
    return x * x;
}

struct Vec2 {
    float x = 0, y = 0;

    friend constexpr bool operator==(const Vec2&, const Vec2&) = default;
    friend constexpr Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
    friend constexpr Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
    friend constexpr Vec2 operator*(Vec2 a, float s) { return {a.x * s, a.y * s}; }
};

/// A point in [0, 1)² with 53 bits per coordinate. A choice among many uses some of the bits and leaves enough for
/// reuse.
struct FinePoint {
    double x = 0, y = 0;
};
/// A number in [0, 1) rounded to float, kept below one.
inline float to_float(double u) {
    return std::min(kOneMinusEpsilon, float(u));
}
inline Vec2 to_float(FinePoint u) {
    return {to_float(u.x), to_float(u.y)};
}

struct Vec3 {
    float x = 0, y = 0, z = 0;

    constexpr float operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
    constexpr float& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }

    friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
    friend constexpr Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend constexpr Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend constexpr Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
    friend constexpr Vec3 operator*(Vec3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
    friend constexpr Vec3 operator*(float s, Vec3 a) { return a * s; }
    friend constexpr Vec3 operator/(Vec3 a, float s) { return a * (1.0f / s); }
    constexpr Vec3& operator+=(Vec3 b) { return *this = *this + b; }
    constexpr Vec3& operator*=(float s) { return *this = *this * s; }
};

constexpr float dot(Vec3 a, Vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline float abs_dot(Vec3 a, Vec3 b) {
    return std::fabs(dot(a, b));
}
constexpr Vec3 cross(Vec3 a, Vec3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
constexpr float length2(Vec3 a) {
    return dot(a, a);
}
inline float length(Vec3 a) {
    return std::sqrt(length2(a));
}
inline Vec3 normalize(Vec3 a) {
    return a * (1.0f / length(a));
}
inline bool is_finite(Vec3 a) {
    return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
constexpr Vec3 min(Vec3 a, Vec3 b) {
    return {a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z};
}
constexpr Vec3 max(Vec3 a, Vec3 b) {
    return {a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z};
}

/// The largest magnitude of a coordinate.
inline float largest_coordinate(Vec3 a) {
    return std::max({std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)});
}

/// √max(x, 0): negative x are results of cancellation.
inline float safe_sqrt(float x) {
    return x > 0 ? std::sqrt(x) : 0.0f;
}
constexpr float clamp(float x, float lo, float hi) {
    return x < lo ? lo : x > hi ? hi : x;
}
constexpr float lerp(float t, float a, float b) {
    return a + t * (b - a);
}

}  // namespace etendue
