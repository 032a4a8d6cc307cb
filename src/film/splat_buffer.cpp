#include "film/splat_buffer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "film/parallel_chunks.h"

namespace etendue {
namespace {

/// Binary exponent of the unit. No float has bits below 2^-149.
int unit_exponent(double typical_radiance) {
    constexpr int kBits = 40;
    if (!(typical_radiance > 0) || !std::isfinite(typical_radiance)) return -kBits;
    return std::clamp(std::ilogb(typical_radiance) - kBits, -149, 127);
}

/// The nearest integer of a value below 2^50, by the digits of a sum that has no others.
int64_t nearest(double x) {
    constexpr double kShift = 0x1.8p52;
    return std::bit_cast<int64_t>(x + kShift) - std::bit_cast<int64_t>(kShift);
}

void add_to(Rgb& sum, int channel, double value) {
    sum[channel] += float(value);
}
void add_to(SplatBuffer::Sum& sum, int channel, double value) {
    sum[size_t(channel)] += value;
}

}  // namespace

SplatBuffer::SplatBuffer(int width, int height, double typical_radiance)
    : width_(width), tiles_across_((width + kTileWidth - 1) / kTileWidth),
      unit_(std::ldexp(1.0, unit_exponent(typical_radiance))), units_per_radiance_(1 / unit_),
      lowest_(size_t(width) * size_t(height) * 3),
      tiles_(size_t(tiles_across_) * size_t((height + kTileHeight - 1) / kTileHeight)) {}

void SplatBuffer::add(int column, int row, Rgb value, std::span<const float> x,
                      std::span<const float> y) {
    if (x.size() == 1 && y.size() == 1) return add_to_pixel(column, row, value * (x[0] * y[0]));
    float weights[3 * kMostTaps], colours[3 * kMostTaps];  // of the cells of a row
    for (size_t i = 0; i < x.size(); ++i)
        for (size_t c = 0; c < 3; ++c)
            weights[3 * i + c] = x[i], colours[3 * i + c] = value[int(c)];
    const int right = column + int(x.size()), bottom = row + int(y.size());
    for (int top = row, next = 0; top < bottom; top = next) {
        next = std::min(bottom, (top / kTileHeight + 1) * kTileHeight);
        for (int left = column, end = 0; left < right; left = end) {
            end = std::min(right, (left / kTileWidth + 1) * kTileWidth);
            const size_t first = 3 * size_t(left - column), cells = 3 * size_t(end - left);
            Tile& tile = tile_of(left, top);
            const tbb::spin_mutex::scoped_lock lock(tile.mutex);
            for (int j = top; j < next; ++j)
                add_row(cells_of(tile, left, j), colours + first, weights + first, cells,
                        y[size_t(j - row)]);
        }
    }
}

void SplatBuffer::add_to_pixel(int column, int row, Rgb value) {
    const double units[3] = {double(value.r) * units_per_radiance_,
                             double(value.g) * units_per_radiance_,
                             double(value.b) * units_per_radiance_};
    Tile& tile = tile_of(column, row);
    const tbb::spin_mutex::scoped_lock lock(tile.mutex);
    const Cells cells = cells_of(tile, column, row);
    for (size_t c = 0; c < 3; ++c) {
        if (!(std::fabs(units[c]) < kLarge)) [[unlikely]]
            return add_large(cells, units, 1);
    }
    for (size_t c = 0; c < 3; ++c) add(0, cells + c, nearest(units[c]));
}

void SplatBuffer::add_row(const Cells& cells, const float* colours, const float* weights,
                          size_t count, float y) {
    double units[3 * kMostTaps];
    int large = 0;
    for (size_t k = 0; k < count; ++k) {
        units[k] = double(colours[k] * (weights[k] * y)) * units_per_radiance_;
        large |= int(!(std::fabs(units[k]) < kLarge));
    }
    if (large) [[unlikely]]
        return add_large(cells, units, count / 3);
    int64_t* const lowest = &lowest_[cells.lowest];
    int full = 0;
    for (size_t k = 0; k < count; ++k) {
        lowest[k] += nearest(units[k]);
        full |= int(lowest[k] >= kFull || lowest[k] <= -kFull);
    }
    if (full) [[unlikely]]
        for (size_t k = 0; k < count; ++k) add(0, cells + k, 0);
}

void SplatBuffer::add_large(const Cells& cells, const double* units, size_t pixels) {
    for (size_t i = 0; i < pixels; ++i, units += 3) {
        if (!std::all_of(units, units + 3, [](double u) { return std::isfinite(u); })) {
            rejected_.fetch_add(1, std::memory_order_relaxed);
            continue;
        }
        for (size_t c = 0; c < 3; ++c) {
            const Cells cell = cells + (3 * i + c);
            if (std::fabs(units[c]) < kLarge) {
                add(0, cell, nearest(units[c]));
                continue;
            }
            // A float has 24 bits. The lowest of them is 2^(26·digit) units or more.
            const int digit = (std::ilogb(units[c]) - 23) / kDigitBits;
            add(size_t(digit), cell, int64_t(std::ldexp(units[c], -kDigitBits * digit)));
        }
    }
}

void SplatBuffer::add(size_t digit, const Cells& cell, int64_t n) {
    const auto higher = [&]() -> int64_t& {
        auto& cells = cell.tile.higher[digit - 1];
        if (!cells) cells = std::make_unique<int64_t[]>(kTileCells);
        return cells[cell.higher];
    };
    int64_t& sum = digit == 0 ? lowest_[cell.lowest] : higher();
    sum += n;
    if (sum < kFull && sum > -kFull) return;
    const int64_t carried = sum >> kDigitBits;
    sum -= carried << kDigitBits;
    add(digit + 1, cell, carried);
}

double SplatBuffer::take(const Cells& cell) {
    size_t digits = kDigits;
    while (digits > 1 && !cell.tile.higher[digits - 2]) --digits;
    // Carries until all digits except the last lie in [0, 2^26). This representation is unique.
    constexpr int64_t kMask = (int64_t(1) << kDigitBits) - 1;
    std::array<int64_t, kDigits> sum{};
    int64_t passed = std::exchange(lowest_[cell.lowest], 0);
    for (size_t j = 0; j < digits; ++j) {
        if (j > 0)
            if (int64_t* const higher = cell.tile.higher[j - 1].get())
                passed += std::exchange(higher[cell.higher], 0);
        sum[j] = j + 1 < digits ? passed & kMask : passed;
        passed >>= kDigitBits;
    }
    double units = 0;
    for (size_t j = digits; j-- > 0;) units = units * (int64_t(1) << kDigitBits) + double(sum[j]);
    return units;
}

void SplatBuffer::prefetch(int column, int row, int columns, int rows) const {
    constexpr size_t kLine = 64 / sizeof(int64_t);
    __builtin_prefetch(&tile_of(column, row), 1);
    for (int j = row; j < row + rows; ++j) {
        const size_t first = (size_t(j) * size_t(width_) + size_t(column)) * 3;
        for (size_t k = 0; k < 3 * size_t(columns) + kLine - 1; k += kLine)
            __builtin_prefetch(lowest_.data() + first + k, 1);  // also beyond the end
    }
}

template <class To>
void SplatBuffer::fold(uint64_t first, std::span<To> to) {
    const auto width = uint64_t(width_);
    for (size_t k = 0; k < to.size();) {
        // The pixels of a row of a tile.
        const uint64_t pixel = first + k;
        const int column = int(pixel % width), row = int(pixel / width);
        const int end = std::min((column / kTileWidth + 1) * kTileWidth, width_);
        Tile& tile = tile_of(column, row);
        const bool has_large = std::any_of(tile.higher.begin(), tile.higher.end(),
                                           [](const auto& digit) { return digit != nullptr; });
        Cells cells = cells_of(tile, column, row);
        for (const size_t last = std::min(to.size(), k + size_t(end - column)); k < last; ++k)
            for (int c = 0; c < 3; ++c) {
                add_to(to[k], c,
                       unit_ * (has_large ? take(cells)
                                          : double(std::exchange(lowest_[cells.lowest], 0))));
                ++cells.lowest, ++cells.higher;
            }
    }
}
template void SplatBuffer::fold(uint64_t, std::span<Rgb>);

void SplatBuffer::fold_into(std::span<Sum> sums) {
    for_film_chunks(sums.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        fold(begin, sums.subspan(begin, end - begin));
    });
}

void SplatBuffer::clear() {
    for_film_chunks(lowest_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        std::fill(&lowest_[begin], &lowest_[begin] + (end - begin), 0);
    });
    for (Tile& tile : tiles_) tile.higher = {};
    forget_rejected();
}

}  // namespace etendue
