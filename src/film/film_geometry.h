#pragma once
// Pixels of the film, and the pixels that a film point contributes to.

#include <algorithm>
#include <cmath>
#include <cstdint>
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

/// Calls `use(pixel index, h)` for every pixel of the crop whose filter reaches the film point.
template <class Use>
void for_each_pixel(const FilmGeometry& g, const ReconstructionFilter& filter, Vec2 point,
                    const Use& use) {
    // Pixels i with |point - (i + 1/2)| ≤ r, clamped before the conversion, because an integer cannot represent every
    // float.
    const float r = filter.radius();
    const auto first = [r](float at, int begin, int end) {
        return int(std::min(std::max(float(begin), std::ceil(at - r - 0.5f)), float(end)));
    };
    const auto last = [r](float at, int begin, int end) {
        return int(std::min(std::max(float(begin - 1), std::floor(at + r - 0.5f)), float(end - 1)));
    };
    const int left = g.crop_x, right = g.crop_x + g.crop_width;
    const int top = g.crop_y, bottom = g.crop_y + g.crop_height;
    const int x0 = first(point.x, left, right), x1 = last(point.x, left, right);
    const int y0 = first(point.y, top, bottom), y1 = last(point.y, top, bottom);
    for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x) {
            const float h = filter.eval({point.x - (float(x) + 0.5f), point.y - (float(y) + 0.5f)});
            if (h != 0) use(g.pixel_index(x - g.crop_x, y - g.crop_y), h);
        }
}

}  // namespace etendue
