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
      locks_(size_t(tiles_across_) * size_t((height + kTileHeight - 1) / kTileHeight)) {}

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
            const tbb::spin_mutex::scoped_lock lock(lock_of(left, top).mutex);
            for (int j = top; j < next; ++j)
                add_row((uint64_t(j) * uint64_t(width_) + uint64_t(left)) * 3, colours + first,
                        weights + first, cells, y[size_t(j - row)]);
        }
    }
}

void SplatBuffer::add_to_pixel(int column, int row, Rgb value) {
    const uint64_t first_cell = (uint64_t(row) * uint64_t(width_) + uint64_t(column)) * 3;
    const double units[3] = {double(value.r) * units_per_radiance_,
                             double(value.g) * units_per_radiance_,
                             double(value.b) * units_per_radiance_};
    const tbb::spin_mutex::scoped_lock lock(lock_of(column, row).mutex);
    for (uint64_t c = 0; c < 3; ++c) {
        if (!(std::fabs(units[c]) < kLarge)) [[unlikely]]
            return add_large(first_cell, units, 1);
    }
    for (uint64_t c = 0; c < 3; ++c) add(0, first_cell + c, nearest(units[c]));
}

void SplatBuffer::add_row(uint64_t first_cell, const float* colours, const float* weights,
                          size_t count, float y) {
    double units[3 * kMostTaps];
    int large = 0;
    for (size_t k = 0; k < count; ++k) {
        units[k] = double(colours[k] * (weights[k] * y)) * units_per_radiance_;
        large |= int(!(std::fabs(units[k]) < kLarge));
    }
    if (large) [[unlikely]]
        return add_large(first_cell, units, count / 3);
    int64_t* const cells = &lowest_[first_cell];
    int full = 0;
    for (size_t k = 0; k < count; ++k) {
        cells[k] += nearest(units[k]);
        full |= int(cells[k] >= kFull || cells[k] <= -kFull);
    }
    if (full) [[unlikely]]
        for (size_t k = 0; k < count; ++k) add(0, first_cell + k, 0);
}

void SplatBuffer::add_large(uint64_t first_cell, const double* units, size_t pixels) {
    for (size_t i = 0; i < pixels; ++i, units += 3, first_cell += 3) {
        if (!std::all_of(units, units + 3, [](double u) { return std::isfinite(u); })) {
            rejected_.fetch_add(1, std::memory_order_relaxed);
            continue;
        }
        for (uint64_t c = 0; c < 3; ++c) {
            if (std::fabs(units[c]) < kLarge) {
                add(0, first_cell + c, nearest(units[c]));
                continue;
            }
            // A float has 24 bits. The lowest of them is 2^(26·digit) units or more.
            const int digit = (std::ilogb(units[c]) - 23) / kDigitBits;
            add(size_t(digit), first_cell + c, int64_t(std::ldexp(units[c], -kDigitBits * digit)));
        }
    }
}

void SplatBuffer::add(size_t digit, uint64_t cell, int64_t n) {
    int64_t& sum = (digit == 0 ? lowest_.data() : higher(digit))[cell];
    sum += n;
    if (sum < kFull && sum > -kFull) return;
    const int64_t carried = sum >> kDigitBits;
    sum -= carried << kDigitBits;
    add(digit + 1, cell, carried);
}

int64_t* SplatBuffer::higher(size_t digit) {
    if (int64_t* cells = higher_[digit].load(std::memory_order_acquire)) return cells;
    const std::scoped_lock lock(making_);
    if (!owned_[digit]) {
        owned_[digit] = std::make_unique<int64_t[]>(lowest_.size());
        higher_[digit].store(owned_[digit].get(), std::memory_order_release);
    }
    return owned_[digit].get();
}

double SplatBuffer::take(uint64_t cell, size_t digits) {
    // Carries until all digits except the last lie in [0, 2^26). This representation is unique.
    constexpr int64_t kMask = (int64_t(1) << kDigitBits) - 1;
    std::array<int64_t, kDigits> sum{};
    int64_t passed = 0;
    for (size_t j = 0; j < digits; ++j) {
        if (int64_t* cells = j == 0 ? lowest_.data() : owned_[j].get())
            passed += std::exchange(cells[cell], 0);
        sum[j] = j + 1 < digits ? passed & kMask : passed;
        passed >>= kDigitBits;
    }
    double units = 0;
    for (size_t j = digits; j-- > 0;) units = units * (int64_t(1) << kDigitBits) + double(sum[j]);
    return units;
}

void SplatBuffer::prefetch(int column, int row, int columns, int rows) const {
    constexpr size_t kLine = 64 / sizeof(int64_t);
    __builtin_prefetch(&lock_of(column, row), 1);
    for (int j = row; j < row + rows; ++j) {
        const size_t first = (size_t(j) * size_t(width_) + size_t(column)) * 3;
        for (size_t k = 0; k < 3 * size_t(columns) + kLine - 1; k += kLine)
            __builtin_prefetch(lowest_.data() + first + k, 1);  // also beyond the end
    }
}

template <class To>
void SplatBuffer::fold(uint64_t first, std::span<To> to) {
    size_t digits = kDigits;
    while (digits > 1 && !owned_[digits - 1]) --digits;
    for (size_t k = 0; k < to.size(); ++k)
        for (int c = 0; c < 3; ++c) {
            const uint64_t cell = (first + k) * 3 + uint64_t(c);
            const double units =
                digits == 1 ? double(std::exchange(lowest_[cell], 0)) : take(cell, digits);
            add_to(to[k], c, units * unit_);
        }
}
template void SplatBuffer::fold(uint64_t, std::span<Rgb>);

void SplatBuffer::fold_into(std::span<Sum> sums) {
    for_film_chunks(sums.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        fold(begin, sums.subspan(begin, end - begin));
    });
}

void SplatBuffer::clear() {
    const auto clear = [&](int64_t* cells) {
        for_film_chunks(lowest_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
            std::fill(cells + begin, cells + end, 0);
        });
    };
    clear(lowest_.data());
    for (const auto& cells : owned_)
        if (cells) clear(cells.get());
    rejected_.store(0, std::memory_order_relaxed);
}

}  // namespace etendue
