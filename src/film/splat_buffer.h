#pragma once
// Sums of splats that do not depend on the order of the additions or on the threads.

#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "color/rgb.h"

namespace etendue {

/// The splats of one pass. Sums are integers, so that the result does not depend on the order of the additions.
///
/// A sum consists of digits in base 2^26, each in 64 bits: digit j counts multiples of unit·2^(26j), where the unit is
/// a power of two, 2^-40 of a typical radiance. A value below 2^50 units is rounded to the nearest unit and added to
/// digit 0. A larger value is added to the digit that can represent all its bits. Before a digit overflows, most of its
/// value is carried to the next digit. Therefore no value is too large, and no sum overflows. Digits above 0 are
/// allocated when they are needed.
class SplatBuffer {
public:
    /// Values may have any magnitude; the precision of small ones is relative to `typical_radiance`.
    SplatBuffer(uint64_t pixels, double typical_radiance);

    /// Thread-safe. A value that is not finite is left out and counted as rejected.
    void add(uint64_t pixel, Rgb value) {
        const double units[] = {double(value.r) * units_per_radiance_,
                                double(value.g) * units_per_radiance_,
                                double(value.b) * units_per_radiance_};
        if (!(is_small(units[0]) && is_small(units[1]) && is_small(units[2]))) [[unlikely]]
            return add_large(pixel, units);
        for (uint64_t c = 0; c < 3; ++c) add_small(pixel * 3 + c, units[c]);
    }
    /// Number of values that were left out since the buffer was made or cleared.
    uint64_t rejected() const { return rejected_.load(std::memory_order_relaxed); }
    void prefetch(uint64_t pixel) const { __builtin_prefetch(&lowest_[pixel * 3], 1); }
    /// Adds the sums of the pixels from `first` on to `to`, rounded once, and sets them to 0.
    void fold_into(uint64_t first, std::span<Rgb> to) { fold(first, to); }
    /// Adds every sum to the sums of many passes, in parallel, and clears the buffer.
    using Sum = std::array<double, 3>;
    void fold_into(std::span<Sum> sums);
    void clear();

private:
    using Cell = std::atomic<int64_t>;

    static constexpr int kDigitBits = 26;
    /// Enough for the largest float over the smallest: 2^128/2^-149 = 2^277 = 2^(26·9 + 43).
    static constexpr size_t kDigits = 11;
    /// Largest value, in units, that is added to digit 0. A cell never leaves (-2^63, 2^63): it can exceed kFull only
    /// by the values that up to 2^12 threads, 2^50 each, add before it is carried.
    static constexpr double kLarge = 0x1p50;
    static constexpr int64_t kFull = int64_t(1) << 61;

    static bool is_small(double units) { return std::fabs(units) < kLarge; }
    void add_small(uint64_t cell, double units) {
        if (const int64_t n = std::llrint(units)) add(0, cell, n);
    }
    void add(size_t digit, uint64_t cell, int64_t n) {
        Cell& at = digit == 0 ? lowest_[cell] : higher(digit)[cell];
        const int64_t sum = at.fetch_add(n, std::memory_order_relaxed) + n;
        if (sum >= kFull || sum <= -kFull) [[unlikely]]
            carry(digit, cell, at);
    }
    /// A value with a channel that is large or not finite.
    void add_large(uint64_t pixel, const double (&units)[3]);
    void carry(size_t digit, uint64_t cell, Cell& from);
    /// The cells of a digit above 0; allocated on first use.
    Cell* higher(size_t digit);
    /// Returns the sum in units, rounded once, and sets the cell to 0.
    double take(uint64_t cell, size_t digits);
    template <class To>
    void fold(uint64_t first, std::span<To> to);

    double unit_, units_per_radiance_;
    std::vector<Cell> lowest_;
    std::array<std::unique_ptr<Cell[]>, kDigits> owned_;
    std::array<std::atomic<Cell*>, kDigits> higher_{};
    std::mutex making_;
    std::atomic<uint64_t> rejected_{0};
};

}  // namespace etendue
