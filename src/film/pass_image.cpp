#include "film/pass_image.h"

#include "film/parallel_chunks.h"

namespace etendue {

void PassImage::begin(uint64_t light_paths) {
    if (light_paths > 0 && !splats_)
        splats_ = std::make_unique<SplatBuffer>(geometry_.pixel_count(), typical_radiance_);
    splat_scale_ = light_paths > 0 ? float(1.0 / double(light_paths)) : 0.0f;
}

void PassImage::add_splat(Vec2 point, Rgb value) {
    if (!is_finite(value)) {
        rejected_.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    value *= splat_scale_;
    for_each_pixel(geometry_, filter_, point,
                   [&](uint64_t pixel, float h) { splats_->add(pixel, value * h); });
}

std::span<const Rgb> PassImage::finish() {
    if (splats_) splats_->fold_into(pixels_);
    for_film_chunks(pixels_.size(), [&](uint64_t, uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i)
            if (!is_finite(pixels_[i])) {
                rejected_.fetch_add(1, std::memory_order_relaxed);
                pixels_[i] = Rgb();
            }
    });
    return pixels_;
}

void PassImage::clear() {
    if (splats_) splats_->clear();
    for_film_chunks(pixels_.size(), [&](uint64_t, uint64_t begin, uint64_t end) {
        std::fill(pixels_.begin() + ptrdiff_t(begin), pixels_.begin() + ptrdiff_t(end), Rgb());
    });
    rejected_.store(0, std::memory_order_relaxed);
}

}  // namespace etendue
