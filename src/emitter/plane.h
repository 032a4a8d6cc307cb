#pragma once
// Point emitters whose light crosses a rectangle: projected images and textured spot lights.

#include <span>

#include "emitter/point.h"
#include "math/distribution.h"
#include "math/transform.h"

namespace etendue {

/// A point emitter along the +z axis of its own coordinates whose intensity depends on where the light crosses a
/// rectangle of the plane z = 1, centred on the axis. Directions are sampled with a piecewise-constant density of points
/// of the rectangle.
class PlaneEmitter : public PointEmitter {
public:
    Vec3 sample_direction(Vec3, Vec2 u) const override;
    Emission eval_emission(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const override;
    float max_pdf_d() const override { return max_pdf_d_; }
    double power() const override { return power_; }

    /// (u, v) = (1/2 + x / 2 half_width, 1/2 + y / 2 half_height), whose signs may be negative.
    struct Rectangle {
        double half_width, half_height;
    };

protected:
    /// `to_world` is a similarity.
    PlaneEmitter(const Transform& to_world, Rectangle rectangle);

    /// Intensity in W/sr along a direction that crosses the rectangle at uv, with the cosine to the axis.
    virtual Rgb intensity_at(Vec2 uv, float cos_theta) const = 0;
    /// Sets density and power; `powers` are those of width × height cells of equal size, row by row along u. A cell whose
    /// power is zero is not sampled.
    void set_powers(std::span<const float> powers, int width, int height);
    /// The same for a smooth intensity, from points within the cells. No cell has the density zero unless
    /// intensity_at() is zero at all points.
    void sample_powers(int width, int height);

    double area() const { return std::fabs(4 * rectangle_.half_width * rectangle_.half_height); }
    /// Solid angle of the cell (x, y) of width × height.
    double solid_angle(int x, int y, int width, int height) const;

private:
    Rgb intensity(Vec3 d) const override;
    float pdf_direction(Vec3 d) const override;
    /// The point where `d` crosses the rectangle; false where it does not.
    bool to_rectangle(Vec3 d, Vec2& uv, float& cos_theta) const;
    float density(Vec2 uv, float cos_theta) const;

    Transform to_world_, to_local_;
    Rectangle rectangle_;
    PiecewiseConstant2D distribution_;
    double power_ = 0;
    float max_pdf_d_ = 0;
};

}  // namespace etendue
