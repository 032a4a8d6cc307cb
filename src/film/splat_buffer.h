#pragma once
// Sums of splats that do not depend on the order of the additions or on the threads.

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <tbb/spin_mutex.h>

#include "color/rgb.h"

namespace etendue {

/// The splats of one pass. Sums are integers, so that the result does not depend on the order of the additions.
///
/// A sum consists of digits in base 2^26, each in 64 bits: digit j counts multiples of unit·2^(26j), where the unit is
/// a power of two, 2^-40 of a typical radiance. A value below 2^50 units is rounded to the nearest unit and added to
/// digit 0. A larger value is added to the digit that can represent all its bits. Before a digit overflows, most of its
/// value is carried to the next digit. Therefore no value is too large, and no sum overflows.
///
/// A pixel belongs to a tile, which one thread at a time adds to: a splat of many pixels needs one lock for each tile. Digits
/// above 0 are allocated when they are needed, for the pixels of a tile.
class SplatBuffer {
public:
    /// Values may have any magnitude; the precision of small ones is relative to `typical_radiance`.
    SplatBuffer(int width, int height, double typical_radiance);

    /// Adds value·x[i]·y[j] to the pixels (column + i, row + j), all of which are in the image; there are at most kMostTaps of
    /// each. Thread-safe. A pixel whose value is not finite is left out and counted as rejected.
    void add(int column, int row, Rgb value, std::span<const float> x, std::span<const float> y);
    /// The same for one pixel.
    void add(uint64_t pixel, Rgb value) {
        const auto width = uint64_t(width_);
        add_to_pixel(int(pixel % width), int(pixel / width), value);
    }
    static constexpr size_t kMostTaps = 32;
    /// Hints that such a splat may follow.
    void prefetch(int column, int row, int columns, int rows) const;
    /// Number of values that were left out since the buffer was made or cleared.
    uint64_t rejected() const { return rejected_.load(std::memory_order_relaxed); }
    /// The tiles, and the memory that one of them needs for a digit of large splats.
    static constexpr int kTileWidth = 64, kTileHeight = 16;
    static constexpr size_t kTileCells = size_t(3) * kTileWidth * kTileHeight,
                            kBytesOfLargeSplats = kTileCells * sizeof(int64_t);
    /// Adds the sums of the pixels from `first` on to `to`, and sets them to 0.
    void fold_into(uint64_t first, std::span<Rgb> to) { fold(first, to); }
    /// Adds every sum to the sums of many passes, in parallel, and clears the buffer.
    using Sum = std::array<double, 3>;
    void fold_into(std::span<Sum> sums);
    void clear();
    /// The same after all sums have been folded.
    void forget_rejected() { rejected_.store(0, std::memory_order_relaxed); }

private:
    static constexpr int kDigitBits = 26;
    /// Enough for the largest float over the smallest: 2^128/2^-149 = 2^277 = 2^(26·9 + 43).
    static constexpr size_t kDigits = 11;
    /// Largest value, in units, that is added to digit 0.
    static constexpr double kLarge = 0x1p50;
    /// A digit that reaches this is carried. Until then a value of 2^50 does not overflow it.
    static constexpr int64_t kFull = int64_t(1) << 61;
    /// In cache lines of its own, so that threads at neighbouring tiles do not wait for each other.
    struct alignas(64) Tile {
        tbb::spin_mutex mutex;
        std::array<std::unique_ptr<int64_t[]>, kDigits - 1> higher;  ///< Digits above 0.
    };
    /// A cell, or the first of adjacent ones of a row of a tile, whose lock is held.
    struct Cells {
        Tile& tile;
        uint64_t lowest;  ///< In lowest_,
        size_t higher;    ///< and in Tile::higher.

        Cells operator+(size_t k) const { return {tile, lowest + k, higher + k}; }
    };

    Tile& tile_of(int column, int row) const {
        return tiles_[size_t(row / kTileHeight) * size_t(tiles_across_) +
                      size_t(column / kTileWidth)];
    }
    Cells cells_of(Tile& tile, int column, int row) const {
        return {tile, (uint64_t(row) * uint64_t(width_) + uint64_t(column)) * 3,
                3 * size_t(row % kTileHeight * kTileWidth + column % kTileWidth)};
    }
    void add_to_pixel(int column, int row, Rgb value);
    /// Adds colours[k]·weights[k]·y to `count` cells.
    void add_row(const Cells& cells, const float* colours, const float* weights, size_t count,
                 float y);
    /// Values, in units, some of which may be large or not finite.
    void add_large(const Cells& cells, const double* units, size_t pixels);
    /// Adds n, which is at most 2^61, to a digit of the first cell.
    void add(size_t digit, const Cells& cell, int64_t n);
    /// Returns the sum of the first cell in units, rounded after every digit, and sets it to 0.
    double take(const Cells& cell);
    template <class To>
    void fold(uint64_t first, std::span<To> to);

    int width_, tiles_across_;
    double unit_, units_per_radiance_;
    std::vector<int64_t> lowest_;
    mutable std::vector<Tile> tiles_;
    std::atomic<uint64_t> rejected_{0};
};

}  // namespace etendue
