#pragma once
// A ray through a chain of delta events, with its derivatives by the first direction [Igehy 1999]. Derivatives of
// position and direction are carried from event to event; those at the end replace the block-tridiagonal matrix of
// half-vector constraints [Jakob & Marschner 2012; Zeltner et al. 2020]. In double, so that Newton's method converges to
// far less than the distance of two solutions.

#include <array>

#include "geometry/surface_jet.h"

namespace etendue {

struct ChainRay {
    Vec3d o, d;  ///< d is a unit vector.
    /// Derivatives of o and d by the angles about the two axes TangentBasis of the first direction, in radians.
    Vec3d o1, o2, d1, d2;
    double way = 0;  ///< Length of the ray up to `o`.

    /// Leaves the point `p` along the unit vector `w`.
    static ChainRay start(Vec3d p, Vec3d w) {
        const TangentBasis basis(w);
        return {.o = p, .d = w, .o1 = {}, .o2 = {}, .d1 = basis.s, .d2 = basis.t};
    }
    /// Moves the origin to a point of a surface that the ray meets.
    void arrive(const SurfaceJet& at);
    /// Reflects the ray about the shading normal of the surface on which it starts.
    void reflect(const SurfaceJet& at);
    /// Refracts it there. `eta` is η of the side that it enters over η of the side that it leaves; 1 leaves it straight.
    /// False under total internal reflection.
    bool refract(const SurfaceJet& at, double eta);
};

/// A 2×2 matrix by columns, and what it takes to solve an equation with it.
struct Matrix2 {
    double a1, b1, a2, b2;  ///< (a1, b1) is the first column.
    double determinant() const { return a1 * b2 - a2 * b1; }
};

/// Where a ray passes a point of a lamp, in the plane through the point normal to the ray; at infinity, by which angle the
/// ray misses a direction.
struct Passing {
    double x, y;  ///< The offset from the point, or the angles.
    double
        distance;  ///< From the ray's origin; 1 at infinity. At most 0 where the point lies behind.
    Matrix2 by_angles;  ///< Derivative of (x, y) by the angles of the first direction.

    /// Newton's step: the change of the first direction's angles after which the ray passes through the point, to first order.
    std::array<double, 2> step() const {
        const Matrix2& m = by_angles;
        const double det = m.determinant();
        return {(y * m.a2 - x * m.b2) / det, (x * m.b1 - y * m.a1) / det};
    }
    /// Angle by which the ray misses the point, for small ones.
    double miss() const { return std::hypot(x, y) / distance; }
    /// Solid angle of first directions over the area that their rays cover, normal to themselves; at infinity over solid
    /// angle.
    double jacobian() const { return 1 / std::fabs(by_angles.determinant()); }
};
Passing passing(const ChainRay& ray, Vec3d point);
/// The same for the direction `to` at infinity.
Passing passing_at_infinity(const ChainRay& ray, Vec3d to);

}  // namespace etendue
