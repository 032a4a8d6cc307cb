#include "film/pass_image.h"

#include <bit>
#include <cmath>

#include <tbb/enumerable_thread_specific.h>

#include "film/parallel_chunks.h"
#include "math/hash.h"

namespace etendue {
namespace {

/// Calls `use(pixel, factor)` for one of the pixels whose filter reaches `point`, drawn with probability |h| / Σ|h|. The
/// factor is Σ|h| with the sign of h, so that each pixel receives h on average. The number that draws it is a hash of
/// the point, which is random itself.
template <class Use>
void for_one_pixel(const FilmGeometry& g, const ReconstructionFilter& filter, Vec2 point,
                   const Use& use) {
    float sum = 0;
    for_each_pixel(g, filter, point, [&](uint64_t, float h) { sum += std::abs(h); });
    const uint64_t bits =
        uint64_t(std::bit_cast<uint32_t>(point.x)) << 32 | std::bit_cast<uint32_t>(point.y);
    float left = to_unit_float(uint32_t(mix64(bits))) * sum;
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

void PassImage::begin(uint64_t light_paths, const SampleGrid* grid) {
    if (light_paths > 0 && !splats_)
        splats_ = std::make_unique<SplatBuffer>(geometry_.pixel_count(), typical_radiance_);
    splat_scale_ = light_paths > 0 ? float(1.0 / double(light_paths)) : 0.0f;
    grid_ = grid;
    if (grid_) samples_.resize(grid_->count());
}

void PassImage::add_splat(Vec2 point, Rgb value) {
    if (!is_finite(value)) {
        rejected_.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    value *= splat_scale_;
    const auto add = [&](uint64_t pixel, float h) { splats_->add(pixel, value * h); };
    if (grid_ || !filter_.is_wide())
        for_each_pixel(geometry_, filter_, point, add);
    else
        for_one_pixel(geometry_, filter_, point, add);
}

void PassImage::reject_if_not_finite(Rgb& value) {
    if (is_finite(value)) return;
    rejected_.fetch_add(1, std::memory_order_relaxed);
    value = Rgb();
}

std::span<const Rgb> PassImage::finish_eye() {
    std::vector<Rgb>& values = grid_ ? samples_ : pixels_;
    for_film_chunks(values.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i) reject_if_not_finite(values[i]);
    });
    if (grid_) spread();
    return pixels_;
}

void PassImage::spread() {
    // All points have the same offset in their pixels, so all have the same weights: a separable convolution. Pixel
    // (i, j) has the weights in reverse order on the points (i, j) … (i + taps - 1, j + taps - 1) of the grid.
    const ReconstructionFilter::Taps x = filter_.taps(grid_->offset().x),
                                     y = filter_.taps(grid_->offset().y);
    const auto columns = size_t(grid_->columns()), width = size_t(geometry_.crop_width);
    tbb::enumerable_thread_specific<std::vector<Rgb>> lines;
    tbb::parallel_for(0, geometry_.crop_height, [&](int j) {
        std::vector<Rgb>& line = lines.local();
        line.assign(columns, Rgb());
        for (int k = 0; k < y.count; ++k) {
            const float h = y.weight[size_t(y.count - 1 - k)];
            const Rgb* row = &samples_[size_t(j + k) * columns];
            for (size_t i = 0; i < columns; ++i) line[i] += row[i] * h;
        }
        Rgb* pixels = &pixels_[size_t(j) * width];
        for (int k = 0; k < x.count; ++k) {
            const float h = x.weight[size_t(x.count - 1 - k)];
            for (size_t i = 0; i < width; ++i) pixels[i] += line[i + size_t(k)] * h;
        }
    });
}

std::span<const Rgb> PassImage::finish() {
    if (!splats_) return pixels_;
    splats_->fold_into(pixels_);
    for_film_chunks(pixels_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i) reject_if_not_finite(pixels_[i]);
    });
    return pixels_;
}

void PassImage::clear() {
    const auto clear = [](std::vector<Rgb>& values) {
        for_film_chunks(values.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
            std::fill(values.begin() + ptrdiff_t(begin), values.begin() + ptrdiff_t(end), Rgb());
        });
    };
    if (splats_) splats_->clear();
    clear(samples_);
    clear(pixels_);
    rejected_.store(0, std::memory_order_relaxed);
}

}  // namespace etendue
