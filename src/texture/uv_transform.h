#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "math/transform.h"

namespace etendue {

/// Affine map of (u, v), from the first two rows and the columns 0, 1 and 3 of a 4×4 matrix (parameter `to_uv`).
class UvTransform {
public:
    /// Finest grid that resolution() asks for along one axis.
    static constexpr int kMaxResolution = 4096;

    UvTransform() = default;
    explicit UvTransform(const Transform& t) {
        for (int row = 0; row < 2; ++row)
            for (int column = 0; column < 3; ++column)
                m_[row][column] = float(t.matrix()[row][column == 2 ? 3 : column]);
    }

    template <class V>
    V point(V uv) const {
        return {m_[0][0] * uv.x + m_[0][1] * uv.y + m_[0][2],
                m_[1][0] * uv.x + m_[1][1] * uv.y + m_[1][2]};
    }
    /// Converts a gradient with respect to point(uv) to one with respect to uv.
    template <class V>
    V gradient(V g) const {
        return {m_[0][0] * g.x + m_[1][0] * g.y, m_[0][1] * g.x + m_[1][1] * g.y};
    }
    /// From the size of a grid over the unit square of point(uv) to that of a grid of the same detail over the unit
    /// square of uv.
    void resolution(int& width, int& height) const {
        const auto cells = [&](int column) {
            const float n = std::hypot(m_[0][column] * float(width), m_[1][column] * float(height));
            return int(std::clamp(std::ceil(n), 1.0f, float(kMaxResolution)));
        };
        const int u = cells(0), v = cells(1);
        width = u;
        height = v;
    }
    /// The interval to which one axis of point(uv) is mapped by the unit square: its start, and its length, which is
    /// negative where it is turned round. Nothing where the axis depends on both of u and v, or on none of them.
    std::optional<std::array<float, 2>> interval(int axis) const {
        constexpr float kRounding = 1e-6f;  // of a rotation by a right angle
        const auto [by_u, by_v, start] = m_[axis];
        const float least = std::min(std::abs(by_u), std::abs(by_v)),
                    most = std::max(std::abs(by_u), std::abs(by_v));
        if (!(least <= kRounding * most && most > 0)) return {};
        return std::array{start, std::abs(by_u) > std::abs(by_v) ? by_u : by_v};
    }
    /// Factor by which areas are multiplied; negative for a reflection.
    float determinant() const { return m_[0][0] * m_[1][1] - m_[0][1] * m_[1][0]; }

private:
    float m_[2][3] = {{1, 0, 0}, {0, 1, 0}};
};

}  // namespace etendue
