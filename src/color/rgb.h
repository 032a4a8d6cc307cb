#pragma once
// Linear sRGB triples: radiance, reflectance and path throughput.

#include <algorithm>
#include <cmath>

namespace etendue {

struct Rgb {
    float r = 0, g = 0, b = 0;

    constexpr Rgb() = default;
    constexpr explicit Rgb(float v) : r(v), g(v), b(v) {}
    constexpr Rgb(float r, float g, float b) : r(r), g(g), b(b) {}

    constexpr float operator[](int i) const { return i == 0 ? r : i == 1 ? g : b; }
    constexpr float& operator[](int i) { return i == 0 ? r : i == 1 ? g : b; }

    friend constexpr bool operator==(const Rgb&, const Rgb&) = default;
    friend constexpr Rgb operator+(Rgb p, Rgb q) { return {p.r + q.r, p.g + q.g, p.b + q.b}; }
    friend constexpr Rgb operator-(Rgb p, Rgb q) { return {p.r - q.r, p.g - q.g, p.b - q.b}; }
    friend constexpr Rgb operator*(Rgb p, Rgb q) { return {p.r * q.r, p.g * q.g, p.b * q.b}; }
    friend constexpr Rgb operator/(Rgb p, Rgb q) { return {p.r / q.r, p.g / q.g, p.b / q.b}; }
    friend constexpr Rgb operator*(Rgb a, float s) { return {a.r * s, a.g * s, a.b * s}; }
    friend constexpr Rgb operator*(float s, Rgb a) { return a * s; }
    friend constexpr Rgb operator/(Rgb a, float s) { return a * (1.0f / s); }
    constexpr Rgb& operator+=(Rgb q) { return *this = *this + q; }
    constexpr Rgb& operator*=(Rgb q) { return *this = *this * q; }
    constexpr Rgb& operator*=(float s) { return *this = *this * s; }

    constexpr bool is_zero() const { return r == 0 && g == 0 && b == 0; }
    constexpr float max() const { return std::max(r, std::max(g, b)); }
    constexpr float mean() const { return (r + g + b) * (1.0f / 3.0f); }
};

/// Rec. 709 relative luminance.
constexpr float luminance(Rgb c) {
    return 0.212671f * c.r + 0.715160f * c.g + 0.072169f * c.b;
}
inline bool is_finite(Rgb c) {
    return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b);
}
inline Rgb exp(Rgb c) {
    return {std::exp(c.r), std::exp(c.g), std::exp(c.b)};
}
inline Rgb sqrt(Rgb c) {
    return {std::sqrt(c.r), std::sqrt(c.g), std::sqrt(c.b)};
}
constexpr Rgb lerp(float t, Rgb a, Rgb b) {
    return a + (b - a) * t;
}

}  // namespace etendue
