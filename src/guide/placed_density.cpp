#include "guide/placed_density.h"

#include <algorithm>

namespace etendue {

PlacedDensity::PlacedDensity(std::vector<PlacedWeight> weights) {
    if (weights.empty()) return;
    nodes_.resize(1);
    split(0, weights.data(), weights.data() + weights.size());
}

void PlacedDensity::split(uint32_t node, PlacedWeight* begin, PlacedWeight* end) {
    constexpr ptrdiff_t kMost = 32;
    Box box;
    for (const PlacedWeight* w = begin; w != end; ++w) box.bounds.extend(w->p);
    const Vec3 d = box.bounds.hi - box.bounds.lo;
    const int axis = d.x >= d.y && d.x >= d.z ? 0 : d.y >= d.z ? 1 : 2;
    if (end - begin > kMost && d[axis] > 0) {
        PlacedWeight* middle = begin + (end - begin) / 2;
        std::nth_element(begin, middle, end, [&](const PlacedWeight& a, const PlacedWeight& b) {
            return a.p[axis] < b.p[axis];
        });
        const auto child = uint32_t(nodes_.size());
        nodes_.resize(child + 2);
        nodes_[node] = {middle->p[axis], uint32_t(axis) & 3, child & 0x3fffffffu};
        split(child, begin, middle);
        split(child + 1, middle, end);
        return;
    }
    // A surface ends a little beyond its outermost places.
    const float margin = end - begin > 1 ? d[axis] / (2 * float(end - begin - 1)) : 0.0f;
    box.bounds.lo = box.bounds.lo - Vec3{margin, margin, margin};
    box.bounds.hi = box.bounds.hi + Vec3{margin, margin, margin};
    // Most surfaces are flat: the largest side of the box is about the surface in it.
    const Vec3 size = box.bounds.hi - box.bounds.lo;
    const double area =
        std::max({double(size.x) * size.y, double(size.y) * size.z, double(size.z) * size.x});
    if (area > 0)
        for (const PlacedWeight* w = begin; w != end; ++w)
            box.density[octant(w->n)] += double(w->weight) / area;
    nodes_[node] = {0, 3, uint32_t(boxes_.size()) & 0x3fffffffu};
    boxes_.push_back(box);
}

double PlacedDensity::operator()(Vec3 p, Vec3 n) const {
    if (nodes_.empty()) return 0;
    uint32_t i = 0;
    while (nodes_[i].axis < 3) i = nodes_[i].child + (p[int(nodes_[i].axis)] >= nodes_[i].split);
    const Box& box = boxes_[nodes_[i].child];
    for (int axis = 0; axis < 3; ++axis)
        if (!(p[axis] >= box.bounds.lo[axis] && p[axis] <= box.bounds.hi[axis])) return 0;
    return box.density[octant(n)];
}

}  // namespace etendue
