#pragma once
// The film: integrators add contributions to it pass by pass. It computes the image and its variance, and does all
// normalisation (number of light paths, crop, filter).

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "color/rgb.h"
#include "film/expected_luminance.h"
#include "film/pass_image.h"
#include "film/pixel_moments.h"
#include "system/ranks.h"

namespace etendue {

class SectionReader;
class SectionWriter;

/// The image's error, estimated from the differences between passes.
struct ErrorEstimate {
    double relative_rms =
        0;  ///< sqrt(mean over pixels of variance / (I² + 0.01·mean(I)²)), of the mean of all passes.
    double low = 0, high = 0;  ///< 95 % confidence interval.
    bool valid = false;        ///< False until there are enough passes.
};

/// The pass in which a pixel was brightest, counted from the first one of the film; 0 if it was black in all of them.
struct LargestPass {
    float luminance = 0;  ///< Of the pixel in this pass.
    uint32_t pass = 0;
};

/// Accumulates passes. The image of the current pass is separate from the totals, so that the pass can be discarded. A
/// finished pass is added to the totals. Within a pass, the eye contributions of a pixel come from one thread at a
/// time; splats may come from any thread.
class Film {
public:
    /// `typical_radiance`: an estimate of the scene's radiance within a factor of about 1000. The absolute precision of
    /// splats is 2^-40 of it.
    Film(const FilmGeometry& geometry, const ReconstructionFilter& filter,
         double typical_radiance = 1, FilterMode mode = FilterMode::Sample);
    Film(const Film&) = delete;
    Film& operator=(const Film&) = delete;

    /// Memory of a film, by pixel. What a grid needs for the samples of its margin, and a SplatBuffer for large splats, comes
    /// on top. `groups`: see set_groups(). `has_ranks`: whether several processes render the image.
    static uint64_t bytes_per_pixel(bool has_splats, int groups, bool has_ranks = false) {
        return sizeof(PixelMoments) + sizeof(Rgb) +
               (1 + uint64_t(std::max(groups, 1))) * sizeof(float) +
               (has_splats ? 3 * sizeof(int64_t) : 0) + (has_ranks ? 2 * sizeof(Rgb) : 0);
    }

    const FilmGeometry& geometry() const { return geometry_; }
    const ReconstructionFilter& filter() const { return filter_; }

    /// Whether the film points of a pass are a grid, and eye paths contribute to all pixels that the filter reaches.
    bool spreads() const { return spreads_; }
    /// Number of samples of a pass, each with one eye path: one per pixel, and those of the grid's margin.
    uint64_t sample_count() const { return spreads_ ? grid_.count() : geometry_.pixel_count(); }
    /// Film point of the eye path of sample `index`, and the factor of its contribution. Sample i is that of pixel i;
    /// those from pixel_count() on lie outside the crop. `u` is not used if the film spreads().
    struct PixelSample {
        Vec2 point;
        float weight;
    };
    PixelSample sample_pixel(uint64_t index, Vec2 u) const {
        return spreads_ ? PixelSample{grid_.point(index), 1} : sample_alone(index, u);
    }
    /// Film point of an eye path that contributes to a pixel alone.
    PixelSample sample_alone(uint64_t pixel, Vec2 u) const {
        const auto s = filter_.sample(u);
        return {geometry_.pixel_center(pixel) + s.offset, s.weight};
    }
    /// The variance of a pixel of a pass, on average over the film points, if all samples have the variance 1.
    double variance_of_pixels() const;
    /// Calls `use(index, h)` for the samples of the current pass that contribute to a pixel; h is their factor.
    template <class Use>
    void for_each_sample_of(uint64_t pixel, const Use& use) const;

    /// A film point, uniformly distributed in the crop enlarged by the filter's radius. The weight is the area of this
    /// region, in pixels. It applies to splats, which are distributed to all pixels whose filter reaches the point.
    PixelSample sample_anywhere(Vec2 u) const {
        const FilmRegion r = reached_region(geometry_, filter_);
        return {{r.low.x + u.x * r.size.x, r.low.y + u.y * r.size.y}, r.area()};
    }

    /// Declares that passes depend on each other, as those of Markov chains do: pass i belongs to group i mod `count`,
    /// and groups are independent. error(), variance() and the error of the mean are then computed from groups, and are
    /// unknown until every group has had a pass. `count` must be even. To be called before the first pass.
    void set_groups(int count);
    /// Declares that several processes render the image, all of which have such a film. Each of them adds up a part of the
    /// pixels. The film must have no groups. To be called before the first pass.
    void set_ranks(const Ranks& ranks);
    /// From now on, notes for every pixel the pass in which it is brightest; of several processes, each for its own pixels.
    void keep_largest() { largest_.assign(geometry_.pixel_count(), {}); }

    // -- The current pass.

    /// `light_paths`: number of light paths of this pass, by which splats are divided; 0 if there are none. `offset`: of
    /// the film points in their pixels if the film spreads(), uniformly distributed in [0, 1)². `key`: differs from those of
    /// other passes; seeds the choice of one pixel for a splat.
    void begin_pass(uint64_t light_paths, Vec2 offset = {0.5f, 0.5f}, uint64_t key = 0);
    /// Adds the eye path's value (already times PixelSample::weight) of a sample.
    void add_eye(uint64_t index, Rgb value) { pass_.add_eye(index, value); }
    /// Adds the contribution of a light path at a film point, distributed to all pixels whose filter reaches it.
    /// `value` is for one light path; it is divided by the number of light paths.
    void add_splat(Vec2 point, Rgb value) { pass_.add_splat(point, value); }
    /// Hints that a splat at `point` may follow.
    void prefetch_splat(Vec2 point) const { pass_.prefetch_splat(point); }
    /// Adds the pass to the totals. `splat_factor`: the factor of splats in the groups' sums, from which errors are
    /// estimated. If this throws, for want of memory, the totals are unchanged.
    void end_pass(double splat_factor = 1);
    /// Discards the pass; the totals are unchanged.
    void drop_pass() { pass_.clear(); }

    // -- The same with several processes, each of which makes another pass.

    /// Ends the pass that this process has made; its image is kept.
    void finish_pass();
    /// Values of the finished pass that were not finite and were left out.
    uint64_t rejected_in_pass() const { return pass_.rejected(); }
    /// Exchanges the images of the finished passes of the first `passes` processes, and discards the pass of this one.
    void exchange(int passes);
    /// Adds the pass of process `rank` to the totals, of which it has `rejected` values; after exchange().
    void add_pass(int rank, uint64_t rejected);
    /// Makes totals complete, of which each process has a part.
    void complete();

    // -- Totals of the finished passes; they do not include the current pass.

    uint64_t passes() const { return passes_; }
    /// What samples know of the passes that were finished at the last call of renew_expected().
    const ExpectedLuminance& expected() const { return expected_; }
    /// The pixel of a sample; the nearest one for samples outside the crop.
    uint64_t pixel_of(uint64_t index) const {
        return index < geometry_.pixel_count() ? index : geometry_.pixel_at(grid_.point(index));
    }
    /// Mean of all passes.
    std::vector<Rgb> image() const;
    /// The same of the pixels from `first` on, as many as `to` has.
    void image(uint64_t first, std::span<Rgb> to) const;
    /// Variance of that mean, per pixel and channel; zero with fewer than two passes.
    std::vector<Rgb> variance() const;
    void variance(uint64_t first, std::span<Rgb> to) const;
    /// Reads the sums of all groups if there are any; otherwise only one number for each pair of passes.
    ErrorEstimate error() const;
    bool has_groups() const { return !group_sums_.empty(); }
    int groups() const { return int(group_sums_.size()); }
    /// Mean luminance of the crop, and its standard error.
    struct MeanEstimate {
        double mean = 0;
        /// Empty with fewer than two passes, and until every group has had one.
        std::optional<double> standard_error;
        /// Number of independent values from whose spread the error is estimated: passes, or groups.
        int64_t count = 0;
    };
    MeanEstimate mean_luminance() const;
    /// Contributions that were not finite and were left out.
    uint64_t rejected() const { return rejected_; }

    /// The sums of all pixels, row by row.
    std::span<const PixelMoments> moments() const { return moments_; }
    /// The brightest pass of every pixel since keep_largest(); empty if that was not called. Passes that were loaded or merged
    /// are not among them.
    std::span<const LargestPass> largest() const { return largest_; }

    // -- Between passes.

    /// Sets expected() from the totals, which must be complete.
    void renew_expected();
    /// Writes the totals, and what later passes need, as a section "film".
    void save(SectionWriter& to) const;
    /// Replaces them with saved ones of a film of the same size, which throws std::runtime_error if it is none. Then the
    /// film cannot be used.
    void load(SectionReader& from);
    /// Adds the totals of an independent film of the same size and number of groups; otherwise throws std::runtime_error.
    /// No passes may follow.
    void merge(const Film& other);

private:
    bool has_all_groups() const;
    /// Squared error of the mean luminance of a pixel, estimated from the groups 2·pair and 2·pair + 1.
    double group_error2(size_t pair, size_t pixel) const;
    ErrorEstimate group_error() const;
    /// Relative squared error of one pass in a pixel, from the moments of all passes. `mean`: luminance of the crop.
    double error2_of_pass(uint64_t pixel, double mean) const;
    /// Sets error2_of_pass_ from the totals, of which there must be at least two passes.
    void renew_error2_of_pass();
    /// Number of pairs of passes at the beginning whose errors are relative to a mean that was still noisy. They are left
    /// out when there are others, but not in a sum of films, where all may be like that: only their spread matters.
    size_t noisy_pairs() const;
    static constexpr size_t kMostNoisyPairs = 8;
    /// Adds the last pair to later_pairs_.
    void count_last_pair();
    /// Adds the pixels of this process to the totals. A `Pass` has the functions eye() and add_splats() of PassImage.
    template <class Pass>
    void fold(Pass& pass, double splat_factor);
    /// Calls `body(chunk, begin, end)` for the chunks of the pixels of this process.
    template <class Body>
    void for_own_chunks(const Body& body) const;
    /// Sums over all chunks, from the sums of each chunk of this process.
    double sum_of_chunks(std::vector<double>& sums) const;
    uint64_t own_begin() const { return pixel_begins_[size_t(ranks_->index())]; }
    uint64_t own_end() const { return pixel_begins_[size_t(ranks_->index()) + 1]; }

    FilmGeometry geometry_;
    ReconstructionFilter filter_;
    bool spreads_;
    SampleGrid grid_;  ///< Of the current or last pass.
    PassImage pass_;
    std::vector<PixelMoments> moments_;
    ExpectedLuminance expected_;
    /// Luminance of the last pass with an even index; after the next pass, the difference of the two passes. Empty with groups.
    std::vector<float> previous_;
    /// Relative squared error of one pass, estimated from each pair of passes. The spread of these numbers gives the interval.
    /// Their mean would be too small: each is divided by the square of the image up to its pair, which is brighter where
    /// the pair is.
    std::vector<double> pair_errors_;
    /// Sums over the pairs from kMostNoisyPairs on, of a film that is not merged.
    struct {
        double sum = 0, squares = 0;
    } later_pairs_;
    /// Relative squared error of one pass, from the moments after the last pair.
    double error2_of_pass_ = 0;
    std::vector<double> pass_means_;
    std::vector<std::vector<float>> group_sums_;  ///< Sums of luminance, by group and pixel.
    std::vector<uint64_t> group_passes_;
    uint64_t passes_ = 0, rejected_ = 0;
    bool is_merged_ = false;  ///< Whether it is a sum of several films.
    std::vector<LargestPass> largest_;

    const Ranks* ranks_ = &kAlone;
    /// The first chunk and the first pixel of each process, and their numbers.
    std::vector<uint64_t> chunk_begins_, pixel_begins_;
    /// The finished pass of this process, and its pixels in the passes of all; empty if it renders alone.
    std::vector<Rgb> finished_, exchanged_;
};

template <class Use>
void Film::for_each_sample_of(uint64_t pixel, const Use& use) const {
    if (!spreads_) {
        use(pixel, 1.0f);
        return;
    }
    const auto [column, row] = grid_.cell(pixel);
    const ReconstructionFilter::Taps x = filter_.taps(grid_.offset().x),
                                     y = filter_.taps(grid_.offset().y);
    for (int j = 0; j < y.count; ++j)
        for (int i = 0; i < x.count; ++i)
            if (const float h = x.weight[size_t(i)] * y.weight[size_t(j)]; h != 0)
                use(grid_.index(column - x.first - i, row - y.first - j), h);
}

}  // namespace etendue
