#pragma once
// Regions that hold every direction in which a flat neighbourhood is seen, as maps of the unit square, and the square's
// cells where what is to be drawn from a region varies much.

#include <array>
#include <cstddef>

#include "bsdf/lobe.h"
#include "math/frame.h"

namespace etendue {

/// The part of a ball at most `half_height` away from a plane through its centre, seen from a point `height` away from that
/// plane, whose foot on it is `foot` away from the centre.
struct SlabView {
    Frame frame;  ///< n points to the plane.
    Vec2 center;  ///< From the foot, along s and t.
    float height, foot, radius, half_height;

    SlabView(Vec3 to_center, Vec3 normal, float radius, float half_height);
};

/// A point of a region: a density p of directions is p·scale in the measure of which the map keeps shares.
struct RegionPoint {
    Vec3 d;
    float scale;
};
/// The map of a part of the unit square: a cone around it, the largest scale in it, and along which side it is longer.
struct RegionPart {
    DirectionCone cone;
    float max_scale;
    bool is_longer_in_x;
};

/// By area, a disc of the plane through all of which the slab is seen: its own, in perspective. For viewers that are not
/// in the slab, height > half_height.
class SeenDisc {
public:
    explicit SeenDisc(const SlabView& view);

    double measure() const { return double(kPi) * radius_ * radius_; }
    RegionPoint at(Vec2 u) const;
    RegionPart part(Vec2 lo, Vec2 size) const;
    /// The probability of a density cos θ/π about `n`; 0 where the horizon cuts the disc.
    double cosine_mass(Vec3 n) const;

private:
    Vec3 point(Vec2 u) const;  ///< In the frame, from the viewer.

    Frame frame_;
    Vec2 center_;
    double height_, foot_, radius_;
};

/// By solid angle, a range of elevations over the plane and of azimuths. For all viewers; thin for one close to the plane.
class SeenBand {
public:
    explicit SeenBand(const SlabView& view);

    double measure() const { return double(size_.x) * double(size_.y); }
    RegionPoint at(Vec2 u) const { return {frame_.to_world(direction(u)), 1}; }
    RegionPart part(Vec2 lo, Vec2 size) const;

private:
    Vec3 direction(Vec2 u) const;  ///< In the frame.

    Frame frame_;
    Vec2 lo_, size_;  ///< Of the sine of the elevation, and of the azimuth.
};

/// Parts of the unit square, each with a bound of the density there. Their mass is that of the bounds.
class BoundedCells {
public:
    /// Divides the square, always the cell with the largest mass, while the mass of all is more than `enough`.
    /// `max_pdf(cone)` bounds the density of directions.
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
