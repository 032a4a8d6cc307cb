#include "guide/placed_density.h"

#include <algorithm>

namespace etendue {

PlacedDensity::PlacedDensity(std::vector<PlacedWeight> weights) {
    if (!weights.empty()) split(KdSplits::kRoot, weights.data(), weights.data() + weights.size());
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
        const uint32_t below = splits_.divide(node, axis, middle->p[axis]);
        split(below, begin, middle);
        split(below + 1, middle, end);
        return;
    }
    // A surface ends a little beyond its outermost places.
    const float margin = end - begin > 1 ? d[axis] / (2 * float(end - begin - 1)) : 0.0f;
    box.bounds.lo = box.bounds.lo - Vec3{margin, margin, margin};
    box.bounds.hi = box.bounds.hi + Vec3{margin, margin, margin};
    const double area = surface_area(box.bounds);
    if (area > 0)
        for (const PlacedWeight* w = begin; w != end; ++w)
            if (w->weight < kInf) box.density[surface_side(w->n)] += double(w->weight) / area;
    splits_.set_leaf(node, boxes_.size());
    boxes_.push_back(box);
}

double PlacedDensity::operator()(Vec3 p, Vec3 n) const {
    if (boxes_.empty()) return 0;
    const Box& box = boxes_[splits_.leaf(p)];
    for (int axis = 0; axis < 3; ++axis)
        if (!(p[axis] >= box.bounds.lo[axis] && p[axis] <= box.bounds.hi[axis])) return 0;
    return box.density[surface_side(n)];
}

}  // namespace etendue
