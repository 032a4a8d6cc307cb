#pragma once
// The image of one pass.

#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include "film/sample_grid.h"
#include "film/splat_buffer.h"

namespace etendue {

/// What the sample of an eye path contributes to.
enum class FilterMode {
    /// To all pixels that the filter reaches from its film point. The film points of a pass are a grid with one common
    /// offset. The error of the image is smaller, and the errors of neighbouring pixels are correlated.
    Spread,
    /// To its own pixel alone: film points are drawn from the pixel's filter [Ernst et al. 2006]. The errors of pixels
    /// are independent, which denoisers expect.
    Sample,
};

/// The image of the current pass, separate from the film's totals, so that the pass can be discarded. The eye
/// contributions of a sample come from one thread at a time; splats may come from any thread. `geometry` and `filter`
/// must outlive it.
class PassImage {
public:
    /// `samples`: number of eye paths of a pass, those of a grid's margin included.
    PassImage(const FilmGeometry& geometry, const ReconstructionFilter& filter,
              double typical_radiance, uint64_t samples)
        : geometry_(geometry), filter_(filter), typical_radiance_(typical_radiance),
          samples_(samples) {}

    /// `light_paths`: number of light paths of the pass; 0 if there are none. `grid`: the film points of the eye paths,
    /// if their contributions are spread by the filter. `key`: of the pass; otherwise the pixels of splats depend on it.
    void begin(uint64_t light_paths, const SampleGrid* grid, uint64_t key = 0);
    /// Adds to the sample `index`: a point of the grid, or else a pixel.
    void add_eye(uint64_t index, Rgb value) {
        samples_[grid_ ? grid_->place(index) : index] += value;
    }
    void add_splat(Vec2 point, Rgb value);
    void prefetch_splat(Vec2 point) const;
    bool has_splats() const { return splats_ != nullptr; }

    /// Ends the pass. Eye paths whose values are not finite become black and are counted as rejected.
    void finish();
    /// Sets `to` to what the eye paths contribute to the pixels from `begin` on; after finish().
    void eye(uint64_t begin, std::span<Rgb> to) const;
    /// Adds the splats of these pixels, once each. Values that are not finite then become 0 and are counted as rejected.
    void add_splats(uint64_t begin, std::span<Rgb> to);
    /// Number of values that were not finite and were left out.
    uint64_t rejected() const {
        return rejected_.load(std::memory_order_relaxed) + (splats_ ? splats_->rejected() : 0);
    }
    /// Resets the image to black.
    void clear();
    /// The same after add_splats() of all pixels, which leaves no splats.
    void clear_after_splats();

private:
    void clear_samples();
    void reject_if_not_finite(Rgb& value);
    /// Sets `to` to the pixels of a row of the crop from `column` on.
    void convolve(int row, int column, std::span<Rgb> to) const;

    const FilmGeometry& geometry_;
    const ReconstructionFilter& filter_;
    double typical_radiance_;
    const SampleGrid* grid_ = nullptr;
    std::vector<Rgb> samples_;             ///< Of the grid, or else of the pixels, row by row.
    std::unique_ptr<SplatBuffer> splats_;  ///< Made by the first pass that has light paths.
    float splat_scale_ = 0;                ///< 1 / N_L
    uint64_t key_ = 0;
    std::atomic<uint64_t> rejected_{0};
};

}  // namespace etendue
