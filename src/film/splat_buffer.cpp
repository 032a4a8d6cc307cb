#include "film/splat_buffer.h"

#include <algorithm>

#include "film/parallel_chunks.h"

namespace etendue {
namespace {

/// Binary exponent of the unit. No float has bits below 2^-149.
int unit_exponent(double typical_radiance) {
    constexpr int kBits = 40;
    if (!(typical_radiance > 0) || !std::isfinite(typical_radiance)) return -kBits;
    return std::clamp(std::ilogb(typical_radiance) - kBits, -149, 127);
}

/// Value of a cell that no other thread uses; sets it to 0.
int64_t empty(std::atomic<int64_t>& cell) {
    const int64_t n = cell.load(std::memory_order_relaxed);
    cell.store(0, std::memory_order_relaxed);
    return n;
}

void add_to(Rgb& sum, int channel, double value) {
    sum[channel] += float(value);
}
void add_to(SplatBuffer::Sum& sum, int channel, double value) {
    sum[size_t(channel)] += value;
}

}  // namespace

SplatBuffer::SplatBuffer(uint64_t pixels, double typical_radiance)
    : unit_(std::ldexp(1.0, unit_exponent(typical_radiance))), units_per_radiance_(1 / unit_),
      lowest_(pixels * 3) {}

void SplatBuffer::add_large(uint64_t pixel, const double (&units)[3]) {
    if (!std::all_of(units, units + 3, [](double u) { return std::isfinite(u); })) {
        rejected_.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    for (uint64_t c = 0; c < 3; ++c) {
        const uint64_t cell = pixel * 3 + c;
        if (is_small(units[c])) {
            add_small(cell, units[c]);
            continue;
        }
        // A float has 24 bits. The lowest of them is 2^(26·digit) units or more.
        const int digit = (std::ilogb(units[c]) - 23) / kDigitBits;
        add(size_t(digit), cell, int64_t(std::ldexp(units[c], -kDigitBits * digit)));
    }
}

void SplatBuffer::carry(size_t digit, uint64_t cell, Cell& from) {
    // Another thread may have carried the value already; then little is left.
    const int64_t taken = from.exchange(0, std::memory_order_relaxed);
    const int64_t passed = taken >> kDigitBits;
    add(digit, cell, taken - (passed << kDigitBits));
    if (passed != 0) add(digit + 1, cell, passed);
}

SplatBuffer::Cell* SplatBuffer::higher(size_t digit) {
    if (Cell* cells = higher_[digit].load(std::memory_order_acquire)) return cells;
    const std::scoped_lock lock(making_);
    if (!owned_[digit]) {
        owned_[digit] = std::make_unique<Cell[]>(lowest_.size());
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
        if (Cell* cells = j == 0 ? lowest_.data() : owned_[j].get()) passed += empty(cells[cell]);
        sum[j] = j + 1 < digits ? passed & kMask : passed;
        passed >>= kDigitBits;
    }
    double units = 0;
    for (size_t j = digits; j-- > 0;) units = units * (int64_t(1) << kDigitBits) + double(sum[j]);
    return units;
}

template <class To>
void SplatBuffer::fold(uint64_t first, std::span<To> to) {
    size_t digits = kDigits;
    while (digits > 1 && !owned_[digits - 1]) --digits;
    for (size_t k = 0; k < to.size(); ++k)
        for (int c = 0; c < 3; ++c) {
            const uint64_t cell = (first + k) * 3 + uint64_t(c);
            const double units = digits == 1 ? double(empty(lowest_[cell])) : take(cell, digits);
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
    const auto clear = [&](Cell* cells) {
        for_film_chunks(lowest_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
            for (uint64_t i = begin; i < end; ++i) cells[i].store(0, std::memory_order_relaxed);
        });
    };
    clear(lowest_.data());
    for (const auto& cells : owned_)
        if (cells) clear(cells.get());
    rejected_.store(0, std::memory_order_relaxed);
}

}  // namespace etendue
