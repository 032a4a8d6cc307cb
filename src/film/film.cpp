#include "film/film.h"

#include <tuple>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "math/statistics.h"

namespace etendue {
namespace {

/// Pixels in a chunk of parallel work; fixed, so that sums over chunks do not depend on the threads.
constexpr uint64_t kChunk = 4096;

template <class Body>
void for_chunks(uint64_t count, const Body& body) {
    tbb::parallel_for(uint64_t(0), (count + kChunk - 1) / kChunk, [&](uint64_t chunk) {
        body(chunk, chunk * kChunk, std::min(count, (chunk + 1) * kChunk));
    });
}

}  // namespace

SplatBuffer::SplatBuffer(uint64_t pixels) : sums_(pixels * 3) {}

void SplatBuffer::add(uint64_t pixel, Rgb value) {
    if (std::max({std::fabs(value.r), std::fabs(value.g), std::fabs(value.b)}) > kLarge) {
        const std::scoped_lock lock(large_mutex_);
        large_.push_back({pixel, value});
        return;
    }
    for (int c = 0; c < 3; ++c)
        if (const int64_t v = int64_t(double(value[c]) * kScale))
            sums_[pixel * 3 + c].fetch_add(v, std::memory_order_relaxed);
}

void SplatBuffer::fold_into(std::span<Rgb> sums) {
    for_chunks(sums.size(), [&](uint64_t, uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i)
            for (int c = 0; c < 3; ++c) {
                std::atomic<int64_t>& s = sums_[i * 3 + c];
                sums[i][c] += float(double(s.load(std::memory_order_relaxed)) / kScale);
                s.store(0, std::memory_order_relaxed);
            }
    });
    std::sort(large_.begin(), large_.end(), [](const Large& a, const Large& b) {
        return std::tie(a.pixel, a.value.r, a.value.g, a.value.b) <
               std::tie(b.pixel, b.value.r, b.value.g, b.value.b);
    });
    for (const Large& l : large_) sums[l.pixel] += l.value;
    large_.clear();
}

Film::Film(const FilmGeometry& geometry, const ReconstructionFilter& filter)
    : geometry_(geometry), filter_(filter), eye_(geometry.pixel_count()),
      moments_(geometry.pixel_count()), expected_(geometry.pixel_count()),
      previous_(geometry.pixel_count()) {}

void Film::add_splat(Vec2 point, Rgb value) {
    if (!is_finite(value)) {
        rejected_.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    value *= splat_scale_;
    for_each_pixel(geometry_, filter_, point,
                   [&](uint64_t pixel, float h) { splats_->add(pixel, value * h); });
}

void Film::begin_pass(uint64_t light_paths) {
    if (light_paths > 0 && !splats_) {
        splats_ = std::make_unique<SplatBuffer>(geometry_.pixel_count());
        average_blocks();
    }
    splat_scale_ = light_paths > 0 ? float(1.0 / double(light_paths)) : 0.0f;
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
    if (splats_) splats_->fold_into(eye_);
    const uint64_t n = geometry_.pixel_count();
    const bool second = passes_ % 2 == 1;
    ++passes_;
    const uint64_t chunks = (n + kChunk - 1) / kChunk;
    std::vector<double> luminance_sum(chunks), total(chunks), pair_sum(chunks);
    for_chunks(n, [&](uint64_t chunk, uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i) {
            Rgb v = eye_[i];
            eye_[i] = Rgb();
            if (!is_finite(v)) {
                rejected_.fetch_add(1, std::memory_order_relaxed);
                v = Rgb();
            }
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
            if (!second)
                previous_[i] = y;
            else
                previous_[i] = sqr(previous_[i] - y);
        }
    });
    double sum = 0, mean = 0;
    for (uint64_t c = 0; c < chunks; ++c) sum += luminance_sum[c], mean += total[c];
    pass_means_.push_back(sum / double(n));
    mean /= double(n);
    for_chunks(n, [&](uint64_t chunk, uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i) {
            // Half the squared difference of two passes estimates the variance of one, whatever they share within.
            if (second)
                pair_sum[chunk] +=
                    0.5 * previous_[i] / (sqr(double(expected_[i])) + 0.01 * mean * mean + 1e-30);
            expected_[i] = std::max(expected_[i], float(0.1 * mean));
        }
    });
    if (splats_) average_blocks();
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
