#include "reuse/seen_region.h"

#include <algorithm>
#include <cmath>

#include "math/warp.h"

namespace etendue {

SlabView::SlabView(Vec3 to_center, Vec3 normal, float r, float h) : radius(r), half_height(h) {
    const float to_plane = dot(normal, to_center);
    frame = Frame::from_normal(to_plane < 0 ? -normal : normal);
    center = {dot(to_center, frame.s), dot(to_center, frame.t)};
    height = std::fabs(to_plane);
    foot = std::hypot(center.x, center.y);
}

SeenDisc::SeenDisc(const SlabView& v)
    : frame_(v.frame), center_(v.center), height_(double(v.height)), foot_(double(v.foot)) {
    const double r = double(v.radius), h = double(v.half_height);
    radius_ = r + (r + foot_) * h / (height_ - h);
}

Vec3 SeenDisc::point(Vec2 u) const {
    const Vec2 q = center_ + sample_uniform_disk(u) * float(radius_);
    return {q.x, q.y, float(height_)};
}

RegionPoint SeenDisc::at(Vec2 u) const {
    const Vec3 v = point(u);
    const float dist2 = length2(v), inv_dist = 1 / std::sqrt(dist2);
    return {frame_.to_world(v) * inv_dist, v.z * inv_dist / dist2};
}

RegionPart SeenDisc::part(Vec2 lo, Vec2 size) const {
    const Vec3 v = point(lo + size * 0.5f);
    // In the concentric map the radius changes with the larger coordinate of u only; perpendicular to it a point moves
    // by at most π/4 of the sum of the changes of both coordinates.
    const float reach =
        float(radius_) * std::hypot(std::max(size.x, size.y), kPi / 4 * (size.x + size.y));
    const float dist = length(v), sin = reach / dist;
    const double to_foot = std::max(0.0, double(std::hypot(v.x, v.y) - reach));
    const double nearest2 = height_ * height_ + to_foot * to_foot;
    return {{frame_.to_world(v) / dist, sin < 1 ? std::asin(sin) : kPi},
            float(height_ / (nearest2 * std::sqrt(nearest2))),
            size.x > size.y};
}

double SeenDisc::cosine_mass(Vec3 n) const {
    // ∫ cos θ H/(π |v|³) over the disc is the irradiance from a disc of radiance 1/π: the product of n and a vector
    // whose components normal to the plane and along it are known [Howell, configuration factors B-12 and B-13].
    const Vec3 m = frame_.to_local(n);
    const double H = height_, R2 = radius_ * radius_;
    const double along = double(center_.x) * double(m.x) + double(center_.y) * double(m.y),
                 down = H * double(m.z);
    const double across = std::hypot(double(m.x), double(m.y));
    if (!(down + along > radius_ * across)) return 0;
    const double X = H * H + foot_ * foot_ - R2, Y = X + 2 * R2;
    const double S = std::sqrt(Y * Y - 4 * foot_ * foot_ * R2);
    return 2 * R2 * H / S * (down / (S + X) + along / (S + Y));
}

SeenBand::SeenBand(const SlabView& v) : frame_(v.frame) {
    const float r = v.radius, h = v.half_height, nearest = std::max(0.0f, v.foot - r);
    // Depths from height - h to height + h, between two distances along the plane.
    const auto elevation = [&](float depth, float nearer, float farther) {
        return std::atan2(depth, depth > 0 ? nearer : farther);
    };
    float lowest = elevation(v.height - h, v.foot + r, nearest),
          highest = elevation(v.height + h, nearest, v.foot + r);
    const float dist = std::hypot(v.height, v.foot);
    if (r < dist) {
        const float middle = std::atan2(v.height, v.foot), angle = std::asin(r / dist);
        lowest = std::max(lowest, middle - angle);
        highest = std::min(highest, middle + angle);
    }
    lo_.x = std::sin(lowest);
    size_.x = std::max(0.0f, std::sin(highest) - lo_.x);
    const float half = r < v.foot ? std::asin(r / v.foot) : kPi;
    lo_.y = std::atan2(v.center.y, v.center.x) - half;
    size_.y = 2 * half;
}

Vec3 SeenBand::direction(Vec2 u) const {
    const float sin = lo_.x + u.x * size_.x, azimuth = lo_.y + u.y * size_.y;
    const float cos = safe_sqrt(1 - sin * sin);
    return {cos * std::cos(azimuth), cos * std::sin(azimuth), sin};
}

RegionPart SeenBand::part(Vec2 lo, Vec2 size) const {
    const auto elevation = [&](float x) {
        return std::asin(std::clamp(lo_.x + x * size_.x, -1.0f, 1.0f));
    };
    const float middle = elevation(lo.x + size.x / 2);
    // Largest angle from the middle: along its parallel, then along a meridian.
    const float azimuth = std::cos(middle) * size_.y * size.y / 2;
    const float up = std::max(elevation(lo.x + size.x) - middle, middle - elevation(lo.x));
    return {{frame_.to_world(direction(lo + size * 0.5f)), std::min(kPi, azimuth + up)},
            1,
            up > azimuth};
}

size_t BoundedCells::sum_up() {
    size_t largest = 0;
    mass_ = 0;
    for (size_t i = 0; i < count_; ++i) {
        mass_ += cells_[i].mass;
        if (cells_[i].mass > cells_[largest].mass) largest = i;
    }
    return largest;
}

BoundedCells::Choice BoundedCells::choose(float u_cell, Vec2 u) const {
    double left = double(u_cell) * mass_;
    size_t i = 0;
    while (i + 1 < count_ && left >= cells_[i].mass) left -= cells_[i++].mass;
    const Cell& c = cells_[i];
    return {{c.lo.x + c.size.x * u.x, c.lo.y + c.size.y * u.y}, c.bound};
}

}  // namespace etendue
