#pragma once
// Regions that contain every direction to a flat neighbourhood, parametrised over the unit square, and a division of
// the square into cells for densities that vary over a region.

#include <array>
#include <cstddef>
#include <numbers>

#include "bsdf/lobe.h"
#include "math/frame.h"

namespace etendue {

/// The slab: the part of a ball within `half_height` of a plane through its centre, seen from a point at the distance
/// `height` from that plane, whose projection onto the plane is at the distance `foot` from the centre.
struct SlabView {
    Frame frame;  ///< n points to the plane.
    Vec2 center;  ///< Of the ball, relative to the projected point, along s and t.
    float height, foot, radius, half_height;

    SlabView(Vec3 to_center, Vec3 normal, float radius, float half_height);
};

/// A point of a region: a density p of directions corresponds to p·scale in the measure that the map preserves.
struct RegionPoint {
    Vec3 d;
    float scale;
};
/// Bounds for a part of the unit square: a cone that contains its directions, and the largest scale.
struct RegionPart {
    DirectionCone cone;
    float max_scale;
    bool is_longer_in_x;
};

/// A disc in the plane through which all of the slab is seen, measured by area. For viewers outside the slab: height >
/// half_height.
class SeenDisc {
public:
    explicit SeenDisc(const SlabView& view);

    double measure() const { return std::numbers::pi * radius_ * radius_; }
    RegionPoint at(Vec2 u) const;
    RegionPart part(Vec2 lo, Vec2 size) const;
    /// Integral of the density cos θ/π about `n` over the disc; 0 where the horizon intersects the disc.
    double cosine_mass(Vec3 n) const;

private:
    Vec3 point(Vec2 u) const;  ///< In frame_, relative to the viewer.

    Frame frame_;
    Vec2 center_;
    double height_, foot_, radius_;
};

/// A range of elevations above the plane and of azimuths, measured by solid angle. For all viewers; it is thin for
/// viewers close to the plane.
class SeenBand {
public:
    explicit SeenBand(const SlabView& view);

    double measure() const { return double(size_.x) * double(size_.y); }
    RegionPoint at(Vec2 u) const { return {frame_.to_world(direction(u)), 1}; }
    RegionPart part(Vec2 lo, Vec2 size) const;

private:
    Vec3 direction(Vec2 u) const;  ///< In frame_.

    Frame frame_;
    Vec2 lo_, size_;  ///< Of the sine of the elevation, and of the azimuth.
};

/// A division of the unit square into cells with an upper bound of the density in each; mass() is the integral of the
/// bounds.
class BoundedCells {
public:
    /// Divides the cell with the largest mass repeatedly, until the total mass is at most `enough` or there are 16
    /// cells. `max_pdf(cone)` is an upper bound of the density of directions.
    template <class Region, class MaxPdf>
    BoundedCells(const Region& region, const MaxPdf& max_pdf, double enough) {
        const auto cell = [&](Vec2 lo, Vec2 size) -> Cell {
            const RegionPart part = region.part(lo, size);
            const float bound = part.cone.angle < kPi ? max_pdf(part.cone) * part.max_scale : kInf;
            return {lo, size, bound,
                    region.measure() * double(size.x) * double(size.y) * double(bound),
                    part.is_longer_in_x};
        };
        cells_[0] = cell({0, 0}, {1, 1});
        for (count_ = 1;;) {
            const size_t largest = sum_up();
            if (!(mass_ > enough) || count_ == cells_.size()) return;
            Cell& whole = cells_[largest];
            Vec2 size = whole.size, step{};
            if (whole.is_longer_in_x)
                step.x = size.x = size.x / 2;
            else
                step.y = size.y = size.y / 2;
            cells_[count_++] = cell(whole.lo + step, size);
            whole = cell(whole.lo, size);
        }
    }
    double mass() const { return mass_; }

    struct Choice {
        Vec2 u;
        float bound;
    };
    /// A point of a cell chosen by mass, uniform in it.
    Choice choose(float u_cell, Vec2 u) const;

private:
    struct Cell {
        Vec2 lo, size;
        float bound;
        double mass;
        bool is_longer_in_x;
    };
    /// Returns the cell with the largest mass.
    size_t sum_up();

    std::array<Cell, 16> cells_;
    size_t count_ = 0;
    double mass_ = 0;
};

}  // namespace etendue
