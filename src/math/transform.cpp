#include "math/transform.h"

#include <utility>

namespace etendue {
namespace {

constexpr Transform::Matrix kIdentity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};

Transform::Matrix multiply(const Transform::Matrix& a, const Transform::Matrix& b) {
    Transform::Matrix r{};
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            for (int k = 0; k < 4; ++k) r[i][j] += a[i][k] * b[k][j];
    return r;
}

/// Gauss–Jordan elimination with row pivoting; false where the matrix is singular.
bool invert(Transform::Matrix a, Transform::Matrix& inv) {
    inv = kIdentity;
    for (int c = 0; c < 4; ++c) {
        int pivot = c;
        for (int r = c + 1; r < 4; ++r)
            if (std::fabs(a[r][c]) > std::fabs(a[pivot][c])) pivot = r;
        if (!(std::fabs(a[pivot][c]) > 0)) return false;
        if (pivot != c) {
            std::swap(a[c], a[pivot]);
            std::swap(inv[c], inv[pivot]);
        }
        const double s = 1.0 / a[c][c];
        for (int k = 0; k < 4; ++k) {
            a[c][k] *= s;
            inv[c][k] *= s;
        }
        for (int r = 0; r < 4; ++r) {
            const double f = a[r][c];
            if (r == c || f == 0) continue;
            for (int k = 0; k < 4; ++k) {
                a[r][k] -= f * a[c][k];
                inv[r][k] -= f * inv[c][k];
            }
        }
    }
    return true;
}

}  // namespace

Transform::Transform() : m_(kIdentity), inv_(kIdentity) {}

Transform::Transform(const Matrix& m) : m_(m) {
    invertible_ = invert(m, inv_);
    for (const auto& row : inv_)
        for (double v : row) invertible_ = invertible_ && std::isfinite(v);
}

Transform Transform::translate(Vec3 t) {
    return Transform(Matrix{{{1, 0, 0, t.x}, {0, 1, 0, t.y}, {0, 0, 1, t.z}, {0, 0, 0, 1}}});
}

Transform Transform::scale(Vec3 s) {
    return Transform(Matrix{{{s.x, 0, 0, 0}, {0, s.y, 0, 0}, {0, 0, s.z, 0}, {0, 0, 0, 1}}});
}

Transform Transform::rotate(Vec3 axis, double degrees) {
    const double len =
        std::sqrt(double(axis.x) * axis.x + double(axis.y) * axis.y + double(axis.z) * axis.z);
    const double x = axis.x / len, y = axis.y / len, z = axis.z / len;
    const double a = degrees * (3.14159265358979323846 / 180.0);
    const double c = std::cos(a), s = std::sin(a), k = 1 - c;
    return Transform(Matrix{{{x * x * k + c, x * y * k - z * s, x * z * k + y * s, 0},
                             {y * x * k + z * s, y * y * k + c, y * z * k - x * s, 0},
                             {z * x * k - y * s, z * y * k + x * s, z * z * k + c, 0},
                             {0, 0, 0, 1}}});
}

std::optional<Transform> Transform::look_at(Vec3 origin, Vec3 target, Vec3 up) {
    const Vec3 forward = target - origin;
    if (!(length2(forward) > 0)) return {};
    const Vec3 dir = normalize(forward);
    const Vec3 side = cross(up, dir);
    if (!(length2(side) > 1e-12f * length2(up))) return {};
    const Vec3 left = normalize(side);
    const Vec3 v = cross(dir, left);
    return Transform(Matrix{{{left.x, v.x, dir.x, origin.x},
                             {left.y, v.y, dir.y, origin.y},
                             {left.z, v.z, dir.z, origin.z},
                             {0, 0, 0, 1}}});
}

Transform Transform::operator*(const Transform& b) const {
    return Transform(multiply(m_, b.m_));
}

Vec3 Transform::point(Vec3 p) const {
    double r[4];
    for (int i = 0; i < 4; ++i) r[i] = m_[i][0] * p.x + m_[i][1] * p.y + m_[i][2] * p.z + m_[i][3];
    if (r[3] != 1.0)
        for (int i = 0; i < 3; ++i) r[i] /= r[3];
    return {float(r[0]), float(r[1]), float(r[2])};
}

Vec3 Transform::vector(Vec3 v) const {
    double r[3];
    for (int i = 0; i < 3; ++i) r[i] = m_[i][0] * v.x + m_[i][1] * v.y + m_[i][2] * v.z;
    return {float(r[0]), float(r[1]), float(r[2])};
}

Vec3 Transform::normal(Vec3 n) const {
    double r[3];
    for (int i = 0; i < 3; ++i) r[i] = inv_[0][i] * n.x + inv_[1][i] * n.y + inv_[2][i] * n.z;
    return {float(r[0]), float(r[1]), float(r[2])};
}

Transform Transform::inverse() const {
    Transform r;
    r.m_ = inv_;
    r.inv_ = m_;
    r.invertible_ = invertible_;
    return r;
}

double Transform::determinant3() const {
    return m_[0][0] * (m_[1][1] * m_[2][2] - m_[1][2] * m_[2][1]) -
           m_[0][1] * (m_[1][0] * m_[2][2] - m_[1][2] * m_[2][0]) +
           m_[0][2] * (m_[1][0] * m_[2][1] - m_[1][1] * m_[2][0]);
}

bool Transform::is_identity() const {
    return m_ == kIdentity;
}

}  // namespace etendue
