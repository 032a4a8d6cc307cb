#pragma once
// Pixels of the film, and the pixels that a film point contributes to.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "film/filter.h"
#include "math/vec.h"

namespace etendue {

/// Size of the image and the part of it that is rendered. Film points are in pixels, (0, 0) at the top left corner.
struct FilmGeometry {
    int width = 0, height = 0;  ///< Size of the whole image.
    int crop_x = 0, crop_y = 0, crop_width = 0, crop_height = 0;

    uint64_t pixel_count() const { return uint64_t(crop_width) * uint64_t(crop_height); }
    /// Index of the pixel at a column and row of the crop.
    uint64_t pixel_index(int column, int row) const {
        return uint64_t(row) * uint64_t(crop_width) + uint64_t(column);
    }
    /// Centre of the crop's pixel `index` (row by row).
    Vec2 pixel_center(uint64_t index) const {
        return {float(crop_x + int(index % uint64_t(crop_width))) + 0.5f,
                float(crop_y + int(index / uint64_t(crop_width))) + 0.5f};
    }
    /// Column and row, within the crop, of the pixel nearest to a film point, which may be outside the crop.
    std::pair<int, int> pixel_near(Vec2 point) const {
        return {cell(point.x - float(crop_x), crop_width),
                cell(point.y - float(crop_y), crop_height)};
    }
    /// Index of the same pixel.
    uint64_t pixel_at(Vec2 point) const {
        const auto [column, row] = pixel_near(point);
        return pixel_index(column, row);
    }

private:
    /// Clamps before the conversion, because an integer cannot represent every float.
    static int cell(float x, int count) { return x > 0 ? int(std::min(x, float(count - 1))) : 0; }
};

/// The film points that the filter of any pixel reaches.
struct FilmRegion {
    Vec2 low, size;

    float area() const { return size.x * size.y; }
    bool contains(Vec2 p) const {
        return p.x >= low.x && p.x <= low.x + size.x && p.y >= low.y && p.y <= low.y + size.y;
    }
};
inline FilmRegion reached_region(const FilmGeometry& g, const ReconstructionFilter& filter) {
    const float r = filter.radius() - 0.5f;  // beyond the pixels on the edge
    return {{float(g.crop_x) - r, float(g.crop_y) - r},
            {float(g.crop_width) + 2 * r, float(g.crop_height) + 2 * r}};
}

/// The pixels of the crop whose filter reaches a film point: columns from `column` on and rows from `row` on, with the weight
/// x[i]·y[j]; none of both if there are none.
class ReachedPixels {
public:
    ReachedPixels(const FilmGeometry& g, const ReconstructionFilter& filter, Vec2 point) {
        // Also false for what is not a number, and for what no integer can represent.
        if (!reached_region(g, filter).contains(point)) return;
        x_ = filter.taps(point.x - float(g.crop_x)), y_ = filter.taps(point.y - float(g.crop_y));
        left_ = std::max(0, -x_.first), right_ = std::min(x_.count, g.crop_width - x_.first);
        top_ = std::max(0, -y_.first), bottom_ = std::min(y_.count, g.crop_height - y_.first);
        if (left_ >= right_ || top_ >= bottom_) left_ = right_ = top_ = bottom_ = 0;
    }

    int column() const { return x_.first + left_; }
    int row() const { return y_.first + top_; }
    std::span<const float> x() const { return part(x_, left_, right_); }
    std::span<const float> y() const { return part(y_, top_, bottom_); }

private:
    static std::span<const float> part(const ReconstructionFilter::Taps& t, int begin, int end) {
        return {t.weight.data() + begin, size_t(end - begin)};
    }

    ReconstructionFilter::Taps x_, y_;
    int left_ = 0, right_ = 0, top_ = 0, bottom_ = 0;
};

/// Calls `use(pixel index, h)` for those whose weight is not 0.
template <class Use>
void for_each_pixel(const FilmGeometry& g, const ReconstructionFilter& filter, Vec2 point,
                    const Use& use) {
    const ReachedPixels reached(g, filter, point);
    for (size_t j = 0; j < reached.y().size(); ++j)
        for (size_t i = 0; i < reached.x().size(); ++i)
            if (const float h = reached.x()[i] * reached.y()[j]; h != 0)
                use(g.pixel_index(reached.column() + int(i), reached.row() + int(j)), h);
}

/// What a contribution is added to: one pixel, or all pixels that the filter reaches from a film point.
struct FilmTarget {
    Vec2 point;
    std::optional<uint64_t> pixel = {};
};
template <class Use>
void for_each_pixel(const FilmGeometry& g, const ReconstructionFilter& filter,
                    const FilmTarget& target, const Use& use) {
    if (target.pixel)
        use(*target.pixel, 1.0f);
    else
        for_each_pixel(g, filter, target.point, use);
}

}  // namespace etendue
