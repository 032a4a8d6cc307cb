#pragma once
// What textures take and give in double with derivatives, for surfaces in specular connections.

#include "color/rgb.h"
#include "math/dual.h"

namespace etendue {

struct RgbDual {
    Dual r, g, b;

    constexpr RgbDual() = default;
    constexpr RgbDual(Dual vr, Dual vg, Dual vb) : r(vr), g(vg), b(vb) {}
    constexpr RgbDual(Rgb c) : r(double(c.r)), g(double(c.g)), b(double(c.b)) {}

    friend constexpr RgbDual operator*(RgbDual p, RgbDual q) {
        return {p.r * q.r, p.g * q.g, p.b * q.b};
    }
    // A friend, which does not compete with luminance(Rgb) for braced lists.
    friend constexpr Dual luminance(RgbDual c) {
        constexpr Rgb kEach[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        return luminance(kEach[0]) * c.r + luminance(kEach[1]) * c.g + luminance(kEach[2]) * c.b;
    }
};
constexpr RgbDual lerp(Dual t, RgbDual a, RgbDual b) {
    return {lerp(t, a.r, b.r), lerp(t, a.g, b.g), lerp(t, a.b, b.b)};
}

/// As TexturePoint, with derivatives by two parameters of the surface.
struct TextureJetPoint {
    Vec2Dual uv, second_uv;
    Vec3Dual p, dpdu, dpdv;

    TextureJetPoint moved(Vec2 d) const {
        const Dual x = double(d.x), y = double(d.y);
        return {{uv.x + x, uv.y + y}, second_uv, p + dpdu * x + dpdv * y, dpdu, dpdv};
    }
};

}  // namespace etendue
