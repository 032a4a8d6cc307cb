#pragma once
// Affine and projective maps of space with their inverses, in double.

#include <array>
#include <optional>

#include "math/vec.h"

namespace etendue {

/// A 4×4 matrix (row-major, column vectors) that maps points, vectors and normals.
class Transform {
public:
    using Matrix = std::array<std::array<double, 4>, 4>;

    Transform();
    explicit Transform(const Matrix& m);  ///< A singular matrix is allowed; see is_invertible().

    static Transform translate(Vec3 t);
    static Transform scale(Vec3 s);
    /// Right-handed rotation by `degrees` about `axis` (of any length above zero).
    static Transform rotate(Vec3 axis, double degrees);
    /// Camera to world, with the z axis from `origin` to `target`; empty where `origin` equals `target` or `up` is
    /// parallel to the viewing direction.
    static std::optional<Transform> look_at(Vec3 origin, Vec3 target, Vec3 up);

    /// This transform applied after `b`.
    Transform operator*(const Transform& b) const;
    bool operator==(const Transform& b) const { return m_ == b.m_; }

    Vec3 point(Vec3 p) const;   ///< Divides by w.
    Vec3 vector(Vec3 v) const;  ///< Applies the upper 3×3 part.
    Vec3 normal(Vec3 n) const;  ///< Applies the inverse transpose; not normalised.
    Transform inverse() const;

    const Matrix& matrix() const { return m_; }
    const Matrix& inverse_matrix() const { return inv_; }
    double determinant3() const;  ///< Of the upper 3×3 part; negative where handedness changes.
    bool is_invertible() const { return invertible_; }
    bool is_identity() const;

private:
    Matrix m_, inv_;
    bool invertible_ = true;
};

}  // namespace etendue
