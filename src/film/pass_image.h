#pragma once
// The image of one pass.

#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include "film/film_geometry.h"
#include "film/splat_buffer.h"

namespace etendue {

/// The image of the current pass, separate from the film's totals, so that the pass can be discarded. The eye
/// contributions of a pixel come from one thread at a time; splats may come from any thread. `geometry` and `filter`
/// must outlive it.
class PassImage {
public:
    PassImage(const FilmGeometry& geometry, const ReconstructionFilter& filter,
              double typical_radiance)
        : geometry_(geometry), filter_(filter), typical_radiance_(typical_radiance),
          pixels_(geometry.pixel_count()) {}

    /// `light_paths`: number of light paths of the pass; 0 if there are none.
    void begin(uint64_t light_paths);
    void add_eye(uint64_t pixel, Rgb value) { pixels_[pixel] += value; }
    void add_splat(Vec2 point, Rgb value);
    void prefetch_splat(Vec2 point) const { splats_->prefetch(geometry_.pixel_at(point)); }
    bool has_splats() const { return splats_ != nullptr; }

    /// The contributions of eye paths; valid until finish().
    std::span<const Rgb> eye_values() const { return pixels_; }
    /// The finished image. Pixels that are not finite become 0 and are counted as rejected.
    std::span<const Rgb> finish();
    /// Number of values that were not finite and were left out.
    uint64_t rejected() const { return rejected_.load(std::memory_order_relaxed); }
    /// Resets the image to black.
    void clear();

private:
    const FilmGeometry& geometry_;
    const ReconstructionFilter& filter_;
    double typical_radiance_;
    std::vector<Rgb> pixels_;
    std::unique_ptr<SplatBuffer> splats_;  ///< Made by the first pass that has light paths.
    float splat_scale_ = 0;                ///< 1 / N_L
    std::atomic<uint64_t> rejected_{0};
};

}  // namespace etendue
