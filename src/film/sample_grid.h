#pragma once
// The film points of the eye paths of one pass.

#include <cstdint>
#include <utility>

#include "film/film_geometry.h"

namespace etendue {

/// A grid of film points, one per pixel, with a common offset within the pixels. It extends beyond the crop by a margin,
/// so that every pixel of the crop receives all points that its filter reaches; a box needs no margin.
///
/// Point `i` is that of the crop's pixel `i` for i < pixel_count(); the points of the margin follow.
class SampleGrid {
public:
    SampleGrid() = default;
    /// `offset`: position of the points in their pixels, in [0, 1)².
    SampleGrid(const FilmGeometry& g, const ReconstructionFilter& filter, Vec2 offset)
        : film_(g), offset_(offset) {
        // The taps of a point in column i are the columns first + i …; column 0 is reached from -first - count + 1 on.
        const ReconstructionFilter::Taps x = filter.taps(offset.x), y = filter.taps(offset.y);
        first_column_ = 1 - x.first - x.count, first_row_ = 1 - y.first - y.count;
        columns_ = g.crop_width + x.count - 1, rows_ = g.crop_height + y.count - 1;
    }

    uint64_t count() const { return uint64_t(columns_) * uint64_t(rows_); }
    int columns() const { return columns_; }
    int rows() const { return rows_; }
    Vec2 offset() const { return offset_; }

    /// Column and row of a point, relative to the crop.
    std::pair<int, int> cell(uint64_t i) const {
        const auto width = uint64_t(film_.crop_width);
        if (i < film_.pixel_count()) return {int(i % width), int(i / width)};
        // Above the crop, below it, then left and right of each row.
        i -= film_.pixel_count();
        const auto columns = uint64_t(columns_);
        const auto outside = uint64_t(rows_ - film_.crop_height), above = uint64_t(-first_row_);
        if (i < outside * columns) {
            const int row = int(i / columns), column = first_column_ + int(i % columns);
            return {column,
                    row < int(above) ? row + first_row_ : row - int(above) + film_.crop_height};
        }
        i -= outside * columns;
        const auto sides = uint64_t(columns_ - film_.crop_width);
        const int side = int(i % sides);
        return {side < -first_column_ ? side + first_column_
                                      : side + first_column_ + film_.crop_width,
                int(i / sides)};
    }
    /// Index of the point in a column and row; the inverse of cell().
    uint64_t index(int column, int row) const {
        const uint64_t pixels = film_.pixel_count();
        const auto columns = uint64_t(columns_);
        if (row < 0)
            return pixels + uint64_t(row - first_row_) * columns + uint64_t(column - first_column_);
        if (row >= film_.crop_height)
            return pixels + uint64_t(row - film_.crop_height - first_row_) * columns +
                   uint64_t(column - first_column_);
        if (column >= 0 && column < film_.crop_width) return film_.pixel_index(column, row);
        const auto sides = uint64_t(columns_ - film_.crop_width);
        const int side =
            column < 0 ? column - first_column_ : column - first_column_ - film_.crop_width;
        return pixels + uint64_t(rows_ - film_.crop_height) * columns + uint64_t(row) * sides +
               uint64_t(side);
    }
    /// Place of a point in an array of rows of the grid.
    size_t place(uint64_t i) const {
        const auto [column, row] = cell(i);
        return size_t(row - first_row_) * size_t(columns_) + size_t(column - first_column_);
    }
    Vec2 point(uint64_t i) const {
        const auto [column, row] = cell(i);
        return {float(film_.crop_x + column) + offset_.x, float(film_.crop_y + row) + offset_.y};
    }

private:
    FilmGeometry film_;
    Vec2 offset_;
    int first_column_ = 0, first_row_ = 0, columns_ = 0, rows_ = 0;
};

}  // namespace etendue
