#include "film/film.h"

#include "film/parallel_chunks.h"
#include "math/statistics.h"

namespace etendue {

Film::Film(const FilmGeometry& geometry, const ReconstructionFilter& filter,
           double typical_radiance)
    : geometry_(geometry), filter_(filter), pass_(geometry_, filter_, typical_radiance),
      moments_(geometry.pixel_count()), expected_(geometry.pixel_count()),
      previous_(geometry.pixel_count()) {}

void Film::begin_pass(uint64_t light_paths) {
    pass_.begin(light_paths);
    if (pass_.has_splats() && expected_blocks_.empty()) average_blocks();
}

void Film::average_blocks() {
    const int width = geometry_.crop_width, height = geometry_.crop_height;
    const int rows = (height + kBlock - 1) / kBlock;
    expected_blocks_.assign(blocks_across() * uint64_t(rows), 0);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int columns = std::min(kBlock, width - x / kBlock * kBlock),
                      lines = std::min(kBlock, height - y / kBlock * kBlock);
            expected_blocks_[uint64_t(y / kBlock) * blocks_across() + uint64_t(x / kBlock)] +=
                expected_[uint64_t(y) * width + x] / float(columns * lines);
        }
}

void Film::end_pass() {
    fold(pass_.finish());
    rejected_ += pass_.rejected();
    pass_.clear();
}

void Film::fold(std::span<const Rgb> pass) {
    const uint64_t n = geometry_.pixel_count(), chunks = film_chunks(n);
    const bool second = passes_ % 2 == 1;
    // All memory is taken before anything changes, so that what fails leaves the totals as they were.
    std::vector<double> luminance_sum(chunks), total(chunks), pair_sum(chunks);
    for (std::vector<double>* list : {&pass_means_, &pair_errors_})
        if (list->size() == list->capacity()) list->reserve(2 * list->size() + 16);
    ++passes_;
    for_film_chunks(n, [&](uint64_t chunk, uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i) {
            const Rgb v = pass[i];
            Moments& m = moments_[i];
            for (int c = 0; c < 3; ++c) {
                m.sum[c] += v[c];
                m.square[c] += double(v[c]) * v[c];
            }
            const float y = luminance(v);
            luminance_sum[chunk] += y;
            expected_[i] =
                luminance(Rgb(float(m.sum[0]), float(m.sum[1]), float(m.sum[2]))) / float(passes_);
            total[chunk] += expected_[i];
            previous_[i] = second ? previous_[i] - y : y;
        }
    });
    double sum = 0, mean = 0;
    for (uint64_t c = 0; c < chunks; ++c) sum += luminance_sum[c], mean += total[c];
    pass_means_.push_back(sum / double(n));
    mean /= double(n);
    for_film_chunks(n, [&](uint64_t chunk, uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i) {
            // Half the squared difference of two passes estimates the variance of one, whatever they share within.
            const double scale2 = sqr(double(expected_[i])) + 0.01 * mean * mean;
            if (second && scale2 > 0) pair_sum[chunk] += 0.5 * sqr(double(previous_[i])) / scale2;
            expected_[i] = std::max(expected_[i], float(0.1 * mean));
        }
    });
    if (pass_.has_splats()) average_blocks();
    if (!second) return;
    double pair = 0;
    for (double p : pair_sum) pair += p;
    pair_errors_.push_back(pair / double(n));
}

std::vector<Rgb> Film::image() const {
    std::vector<Rgb> out(moments_.size());
    const double inv = passes_ > 0 ? 1.0 / double(passes_) : 0.0;
    for (size_t i = 0; i < out.size(); ++i)
        for (int c = 0; c < 3; ++c) out[i][c] = float(moments_[i].sum[c] * inv);
    return out;
}

std::vector<Rgb> Film::variance() const {
    std::vector<Rgb> out(moments_.size());
    if (passes_ < 2) return out;
    const double n = double(passes_);
    for (size_t i = 0; i < out.size(); ++i)
        for (int c = 0; c < 3; ++c) {
            const double mean = moments_[i].sum[c] / n;
            out[i][c] = float(std::max(0.0, moments_[i].square[c] / n - mean * mean) / (n - 1));
        }
    return out;
}

ErrorEstimate Film::error() const {
    ErrorEstimate e;
    // The first pairs were weighed with a mean that was still noise; they are left out once there are others.
    const size_t skip = std::min<size_t>(pair_errors_.size() / 4, 8);
    const size_t count = pair_errors_.size() - skip;
    if (count < 4) return e;
    double mean = 0, square = 0;
    for (size_t i = skip; i < pair_errors_.size(); ++i) {
        mean += pair_errors_[i];
        square += sqr(pair_errors_[i]);
    }
    mean /= double(count);
    const double spread =
        std::sqrt(std::max(0.0, square / double(count) - mean * mean) / double(count - 1));
    const double half = student_quantile(0.05, double(count - 1)) * spread;
    const double n = double(passes_);
    e.relative_rms = std::sqrt(mean / n);
    e.low = std::sqrt(std::max(0.0, mean - half) / n);
    e.high = std::sqrt((mean + half) / n);
    e.valid = true;
    return e;
}

Film::MeanEstimate Film::mean_luminance() const {
    MeanEstimate m;
    if (pass_means_.empty()) return m;
    const double n = double(pass_means_.size());
    for (double v : pass_means_) m.mean += v / n;
    if (n < 2) return m;
    double square = 0;
    for (double v : pass_means_) square += sqr(v - m.mean);
    m.standard_error = std::sqrt(square / (n * (n - 1)));
    return m;
}

}  // namespace etendue
