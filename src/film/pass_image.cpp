#include "film/pass_image.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "film/parallel_chunks.h"
#include "math/hash.h"

namespace etendue {
namespace {

/// Calls `use(pixel, factor)` for one of the pixels whose filter reaches `point`, drawn with probability |h| / Σ|h|. The
/// factor is Σ|h| with the sign of h, so that each pixel receives h on average. The number that draws it is a hash of
/// the point and of the pass: light paths without a random choice reach the same point in all passes.
template <class Use>
void for_one_pixel(const FilmGeometry& g, const ReconstructionFilter& filter, Vec2 point,
                   uint64_t key, const Use& use) {
    float sum = 0;
    for_each_pixel(g, filter, point, [&](uint64_t, float h) { sum += std::abs(h); });
    const uint64_t bits =
        uint64_t(std::bit_cast<uint32_t>(point.x)) << 32 | std::bit_cast<uint32_t>(point.y);
    float left = to_unit_float(uint32_t(hash_combine(key, bits))) * sum;
    uint64_t chosen = 0;
    float sign = 0;
    for_each_pixel(g, filter, point, [&](uint64_t pixel, float h) {
        if (left < 0) return;
        chosen = pixel;
        sign = h;
        left -= std::abs(h);
    });
    if (sign != 0) use(chosen, std::copysign(sum, sign));
}

}  // namespace

void PassImage::begin(uint64_t light_paths, const SampleGrid* grid, uint64_t key) {
    if (light_paths > 0 && !splats_)
        splats_ = std::make_unique<SplatBuffer>(geometry_.crop_width, geometry_.crop_height,
                                                typical_radiance_);
    splat_scale_ = light_paths > 0 ? float(1.0 / double(light_paths)) : 0.0f;
    grid_ = grid;
    key_ = key;
}

void PassImage::add_splat(Vec2 point, Rgb value) {
    if (!is_finite(value)) {
        rejected_.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    value *= splat_scale_;
    if (grid_ || !filter_.is_wide()) {
        const ReachedPixels reached(geometry_, filter_, point);
        splats_->add(reached.column(), reached.row(), value, reached.x(), reached.y());
    } else {
        for_one_pixel(geometry_, filter_, point, key_,
                      [&](uint64_t pixel, float h) { splats_->add(pixel, value * h); });
    }
}

void PassImage::prefetch_splat(Vec2 point) const {
    const int taps = filter_.tap_count();
    const float before = 0.5f * float(taps - 1);
    const auto [column, row] = geometry_.pixel_near({point.x - before, point.y - before});
    splats_->prefetch(column, row, std::min(taps, geometry_.crop_width - column),
                      std::min(taps, geometry_.crop_height - row));
}

void PassImage::reject_if_not_finite(Rgb& value) {
    if (is_finite(value)) return;
    rejected_.fetch_add(1, std::memory_order_relaxed);
    value = Rgb();
}

void PassImage::finish() {
    for_film_chunks(samples_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i) reject_if_not_finite(samples_[i]);
    });
}

void PassImage::eye(uint64_t begin, std::span<Rgb> to) const {
    if (!grid_) {
        std::copy_n(samples_.begin() + std::ptrdiff_t(begin), to.size(), to.begin());
        return;
    }
    const auto width = size_t(geometry_.crop_width);
    for (size_t done = 0; done < to.size();) {
        const size_t pixel = size_t(begin) + done, column = pixel % width,
                     count = std::min(to.size() - done, width - column);
        convolve(int(pixel / width), int(column), to.subspan(done, count));
        done += count;
    }
}

void PassImage::convolve(int row, int column, std::span<Rgb> to) const {
    // All points have the same offset in their pixels, so all have the same weights: a separable convolution. Pixel
    // (i, j) has the weights in reverse order on the points (i, j) … (i + taps - 1, j + taps - 1) of the grid.
    const ReconstructionFilter::Taps x = filter_.taps(grid_->offset().x),
                                     y = filter_.taps(grid_->offset().y);
    constexpr size_t kRun = 256;
    std::array<Rgb, kRun + ReconstructionFilter::kMostTaps> line;
    for (size_t done = 0; done < to.size();) {
        const size_t count = std::min(to.size() - done, kRun), points = count + size_t(x.count) - 1;
        const Rgb* from = &samples_[size_t(row) * size_t(grid_->columns()) + size_t(column) + done];
        std::fill_n(line.begin(), points, Rgb());
        for (int k = 0; k < y.count; ++k, from += grid_->columns()) {
            const float h = y.weight[size_t(y.count - 1 - k)];
            for (size_t i = 0; i < points; ++i) line[i] += from[i] * h;
        }
        std::fill_n(to.begin() + std::ptrdiff_t(done), count, Rgb());
        for (int k = 0; k < x.count; ++k) {
            const float h = x.weight[size_t(x.count - 1 - k)];
            for (size_t i = 0; i < count; ++i) to[done + i] += line[i + size_t(k)] * h;
        }
        done += count;
    }
}

void PassImage::add_splats(uint64_t begin, std::span<Rgb> to) {
    if (!splats_) return;
    splats_->fold_into(begin, to);
    for (Rgb& value : to) reject_if_not_finite(value);
}

void PassImage::clear() {
    if (splats_) splats_->clear();
    clear_samples();
}

void PassImage::clear_after_splats() {
    if (splats_) splats_->forget_rejected();
    clear_samples();
}

void PassImage::clear_samples() {
    for_film_chunks(samples_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        std::fill(samples_.begin() + std::ptrdiff_t(begin), samples_.begin() + std::ptrdiff_t(end),
                  Rgb());
    });
    rejected_.store(0, std::memory_order_relaxed);
}

}  // namespace etendue
