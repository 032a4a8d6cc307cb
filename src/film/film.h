#pragma once
// The film: what integrators add to, pass by pass, and what the image and its variance are read from. All normalisation
// (number of light paths, crop, filter) is here.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "color/rgb.h"
#include "film/filter.h"
#include "math/vec.h"

namespace etendue {

/// Size of the image and the part of it that is rendered. Film points are in pixels, (0, 0) at the top left corner.
struct FilmGeometry {
    int width = 0, height = 0;  ///< Of the whole image.
    int crop_x = 0, crop_y = 0, crop_width = 0, crop_height = 0;

    uint64_t pixel_count() const { return uint64_t(crop_width) * uint64_t(crop_height); }
    /// Centre of the crop's pixel `index` (row by row).
    Vec2 pixel_center(uint64_t index) const {
        return {float(crop_x + int(index % crop_width)) + 0.5f,
                float(crop_y + int(index / crop_width)) + 0.5f};
    }
    /// The crop's pixel that a film point lies in, or the one nearest to it.
    uint64_t pixel_at(Vec2 point) const {
        const int x = std::clamp(int(point.x) - crop_x, 0, crop_width - 1);
        const int y = std::clamp(int(point.y) - crop_y, 0, crop_height - 1);
        return uint64_t(y) * uint64_t(crop_width) + uint64_t(x);
    }
};

/// Calls `use(pixel index, h)` for every pixel of the crop whose filter reaches the film point.
template <class Use>
void for_each_pixel(const FilmGeometry& g, const ReconstructionFilter& filter, Vec2 point,
                    const Use& use) {
    const float r = filter.radius();
    const int x0 = std::max(int(std::ceil(point.x - r - 0.5f)), g.crop_x);
    const int y0 = std::max(int(std::ceil(point.y - r - 0.5f)), g.crop_y);
    const int x1 = std::min(int(std::floor(point.x + r - 0.5f)), g.crop_x + g.crop_width - 1);
    const int y1 = std::min(int(std::floor(point.y + r - 0.5f)), g.crop_y + g.crop_height - 1);
    for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x) {
            const float h = filter.eval({point.x - (float(x) + 0.5f), point.y - (float(y) + 0.5f)});
            if (h != 0) use(uint64_t(y - g.crop_y) * g.crop_width + (x - g.crop_x), h);
        }
}

/// Order-independent sums: one pass's splats, in 64-bit fixed point, so that the result does not depend on the threads.
/// Values too large for the fixed point are kept in a list and folded in a fixed order: there is no clamp.
class SplatBuffer {
public:
    explicit SplatBuffer(uint64_t pixels);
    void add(uint64_t pixel, Rgb value);
    void prefetch(uint64_t pixel) const { __builtin_prefetch(&sums_[pixel * 3], 1); }
    /// Adds everything to `sums`, in an order that does not depend on the threads, and clears the buffer.
    void fold_into(std::span<Rgb> sums);

private:
    // 2^-40 resolves 1e-12; one value may reach 2^13, so that 2^10 of them at least fit into 63 bits.
    static constexpr double kScale = 0x1p40;
    static constexpr float kLarge = 0x1p13f;

    std::vector<std::atomic<int64_t>> sums_;
    struct Large {
        uint64_t pixel;
        Rgb value;
    };
    std::mutex large_mutex_;
    std::vector<Large> large_;
};

/// Statistics of the passes' spread.
struct ErrorEstimate {
    double relative_rms =
        0;  ///< sqrt(mean over pixels of variance / (I² + 0.01·mean(I)²)), of the mean of all passes.
    double low = 0, high = 0;  ///< 95 % confidence interval.
    bool valid = false;        ///< False until there are enough passes.
};

/// Accumulates passes. Within a pass, eye contributions of a pixel come from one thread at a time; splats from any.
class Film {
public:
    Film(const FilmGeometry& geometry, const ReconstructionFilter& filter);

    const FilmGeometry& geometry() const { return geometry_; }
    const ReconstructionFilter& filter() const { return filter_; }

    /// Film point of the eye path of pixel `index`, and the factor of its contribution.
    struct PixelSample {
        Vec2 point;
        float weight;
    };
    PixelSample sample_pixel(uint64_t index, Vec2 u) const {
        const auto s = filter_.sample(u);
        return {geometry_.pixel_center(index) + s.offset, s.weight};
    }

    /// Adds the eye path's value (already times PixelSample::weight) to its own pixel.
    void add_eye(uint64_t pixel, Rgb value) { eye_[pixel] += value; }
    /// Adds a light path's measurement at a film point: every pixel whose filter reaches it gets its share. `value`
    /// is for one light path; it is divided by the number that begin_pass() was told.
    void add_splat(Vec2 point, Rgb value);

    /// Light paths that this pass traces (splats are divided by it); 0 where there are none.
    void begin_pass(uint64_t light_paths);
    /// Folds the pass into the totals.
    void end_pass();
    uint64_t passes() const { return passes_; }

    /// Luminance that earlier passes lead to expect of a pixel, at least a tenth of the image's mean; 0 in the first pass.
    /// It does not depend on the pass in flight.
    float expected_luminance(uint64_t pixel) const { return expected_[pixel]; }
    /// The same about a film point (clamped to the crop): the mean of a block of pixels, since splats land anywhere and
    /// would wait for the memory of single ones.
    float expected_luminance(Vec2 point) const {
        const auto [x, y] = clamped(point);
        return expected_blocks_[uint64_t(y / kBlock) * blocks_across() + uint64_t(x / kBlock)];
    }
    /// Hints that a splat at `point` may follow.
    void prefetch_splat(Vec2 point) const {
        const auto [x, y] = clamped(point);
        splats_->prefetch(uint64_t(y) * geometry_.crop_width + uint64_t(x));
    }

    /// Mean of all passes.
    std::vector<Rgb> image() const;
    /// Variance of that mean, per pixel and channel; zero with fewer than two passes.
    std::vector<Rgb> variance() const;
    ErrorEstimate error() const;
    /// Mean of the luminance over the crop, and the standard error of it.
    struct MeanEstimate {
        double mean = 0, standard_error = 0;
    };
    MeanEstimate mean_luminance() const;
    /// Contributions that were not finite and were left out.
    uint64_t rejected() const { return rejected_.load(std::memory_order_relaxed); }

private:
    struct Moments {
        double sum[3] = {0, 0, 0}, square[3] = {0, 0, 0};
    };

    static constexpr int kBlock = 4;

    /// Pixel within the crop.
    std::pair<int, int> clamped(Vec2 point) const {
        return {std::clamp(int(point.x) - geometry_.crop_x, 0, geometry_.crop_width - 1),
                std::clamp(int(point.y) - geometry_.crop_y, 0, geometry_.crop_height - 1)};
    }
    uint64_t blocks_across() const { return uint64_t(geometry_.crop_width + kBlock - 1) / kBlock; }
    void average_blocks();

    FilmGeometry geometry_;
    ReconstructionFilter filter_;
    std::vector<Rgb> eye_;
    std::unique_ptr<SplatBuffer> splats_;  ///< Made by the first pass that has light paths.
    float splat_scale_ = 0;
    std::vector<Moments> moments_;
    std::vector<float> expected_;
    std::vector<float> expected_blocks_;  ///< Means of kBlock × kBlock pixels.
    std::vector<float>
        previous_;  ///< Luminance of the last even pass, for the spread between neighbours.
    std::vector<double>
        pair_errors_;  ///< Relative squared error of one pass, from each pair of passes.
    std::vector<double> pass_means_;
    uint64_t passes_ = 0;
    std::atomic<uint64_t> rejected_{0};
};

}  // namespace etendue
