#include "film/film.h"

#include "film/parallel_chunks.h"
#include "math/statistics.h"
#include "system/make_room.h"

namespace etendue {
namespace {

/// The pixels of a process in a pass of any of the processes.
struct ExchangedPass {
    std::span<const Rgb> pixels;
    uint64_t first;

    void eye(uint64_t begin, std::span<Rgb> to) const {
        std::copy_n(pixels.begin() + std::ptrdiff_t(begin - first), to.size(), to.begin());
    }
    void add_splats(uint64_t, std::span<Rgb>) const {}  // are in the pixels
};

}  // namespace

Film::Film(const FilmGeometry& geometry, const ReconstructionFilter& filter,
           double typical_radiance, FilterMode mode)
    : geometry_(geometry), filter_(filter),
      spreads_(mode == FilterMode::Spread && filter.is_wide()),
      grid_(geometry, filter, {0.5f, 0.5f}),
      pass_(geometry_, filter_, typical_radiance, sample_count()), moments_(geometry.pixel_count()),
      expected_(geometry), previous_(geometry.pixel_count()) {
    set_ranks(kAlone);
}

void Film::set_ranks(const Ranks& ranks) {
    const uint64_t pixels = geometry_.pixel_count(), chunks = film_chunks(pixels),
                   count = uint64_t(ranks.count());
    ranks_ = &ranks;
    chunk_begins_.clear(), pixel_begins_.clear();
    for (uint64_t r = 0; r <= count; ++r) {
        chunk_begins_.push_back(chunks * r / count);
        pixel_begins_.push_back(std::min(pixels, chunk_begins_.back() * kFilmChunk));
    }
    if (count == 1) return;
    finished_.resize(pixels);
    exchanged_.resize(size_t(count * (own_end() - own_begin())));
}

void Film::begin_pass(uint64_t light_paths, Vec2 offset, uint64_t key) {
    if (spreads_) grid_ = SampleGrid(geometry_, filter_, offset);
    pass_.begin(light_paths, spreads_ ? &grid_ : nullptr, key);
    if (pass_.has_splats() && expected_.blocks_.empty()) expected_.average_blocks();
}

void ExpectedLuminance::average_blocks() {
    const int width = geometry_.crop_width, height = geometry_.crop_height;
    const int rows = (height + kBlock - 1) / kBlock;
    blocks_.assign(blocks_across() * uint64_t(rows), 0);
    parallel_for(rows, [&](int row) {
        float* const blocks = blocks_.data() + uint64_t(row) * blocks_across();
        const int begin = row * kBlock, end = std::min(begin + kBlock, height);
        for (int y = begin; y < end; ++y)
            for (int x = 0; x < width; ++x) {
                const int columns = std::min(kBlock, width - x / kBlock * kBlock);
                blocks[x / kBlock] +=
                    pixels_[uint64_t(y) * width + x] / float(columns * (end - begin));
            }
    });
}

void Film::set_groups(int count) {
    previous_ = std::vector<float>();
    group_sums_.assign(size_t(count), std::vector<float>(geometry_.pixel_count()));
    group_passes_.assign(size_t(count), 0);
}

bool Film::has_all_groups() const {
    return std::find(group_passes_.begin(), group_passes_.end(), 0) == group_passes_.end();
}

void Film::end_pass(double splat_factor) {
    pass_.finish();
    fold(pass_, splat_factor);
    rejected_ += pass_.rejected();
    pass_.clear_after_splats();
}

void Film::finish_pass() {
    pass_.finish();
    for_film_chunks(finished_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        const std::span<Rgb> to(&finished_[begin], size_t(end - begin));
        pass_.eye(begin, to);
        pass_.add_splats(begin, to);
    });
}

void Film::exchange(int passes) {
    ranks_->distribute(finished_.data(), passes, sizeof(Rgb), pixel_begins_, exchanged_.data());
    pass_.clear();
}

void Film::add_pass(int rank, uint64_t rejected) {
    const size_t own = size_t(own_end() - own_begin());
    ExchangedPass pass{std::span(exchanged_).subspan(size_t(rank) * own, own), own_begin()};
    fold(pass, 1);
    rejected_ += rejected;
}

void Film::complete() {
    ranks_->share(moments_.data(), sizeof(PixelMoments), pixel_begins_);
    ranks_->share(previous_.data(), sizeof(float), pixel_begins_);
}

template <class Body>
void Film::for_own_chunks(const Body& body) const {
    const auto rank = size_t(ranks_->index());
    for_film_chunks(geometry_.pixel_count(), chunk_begins_[rank], chunk_begins_[rank + 1], body);
}

double Film::sum_of_chunks(std::vector<double>& sums) const {
    ranks_->share(sums.data(), sizeof(double), chunk_begins_);
    double sum = 0;
    for (const double s : sums) sum += s;
    return sum;
}

template <class Pass>
void Film::fold(Pass& pass, double splat_factor) {
    const uint64_t n = geometry_.pixel_count(), chunks = film_chunks(n);
    const bool second = !has_groups() && passes_ % 2 == 1;
    const size_t g = has_groups() ? passes_ % group_sums_.size() : 0;
    float* const group = has_groups() ? group_sums_[g].data() : nullptr;
    const bool keeps_largest = !largest_.empty();
    const auto index = uint32_t(passes_);
    // All memory is allocated before anything changes, so that a failure leaves the totals unchanged. From then on nothing
    // throws, apart from the exchange with other processes, which end then.
    std::vector<double> luminance_sum(chunks), total(chunks), pair_sum(chunks), pass_sum(chunks);
    make_room(pass_means_), make_room(pair_errors_);
    const double passes_before = double(passes_);
    ++passes_;
    if (group) ++group_passes_[g];
    const auto mean_of = [&](uint64_t i) { return moments_[i].luminance_sum() / float(passes_); };
    for_own_chunks([&](uint64_t chunk, uint64_t begin, uint64_t end) noexcept {
        std::array<Rgb, kFilmChunk> values;
        std::array<float, kFilmChunk> of_eye;  // luminance
        const auto to = std::span(values).first(size_t(end - begin));
        pass.eye(begin, to);
        if (group)
            for (size_t k = 0; k < to.size(); ++k) of_eye[k] = luminance(to[k]);
        pass.add_splats(begin, to);
        // Not in the vectors, where other threads write beside it.
        double luminances = 0, means = 0;
        for (uint64_t i = begin; i < end; ++i) {
            const Rgb v = values[size_t(i - begin)];
            moments_[i].add(v, passes_before);
            const float y = luminance(v);
            luminances += double(y);
            if (keeps_largest && y > largest_[i].luminance) largest_[i] = {y, index};
            if (second) means += double(mean_of(i));
            if (group)
                group[i] += float((1 - splat_factor) * double(of_eye[size_t(i - begin)]) +
                                  splat_factor * double(y));
            else
                previous_[i] = second ? previous_[i] - y : y;
        }
        luminance_sum[chunk] = luminances, total[chunk] = means;
    });
    pass_means_.push_back(sum_of_chunks(luminance_sum) / double(n));
    if (!second) return;
    const double mean = sum_of_chunks(total) / double(n);
    for_own_chunks([&](uint64_t chunk, uint64_t begin, uint64_t end) noexcept {
        double pairs = 0, errors = 0;
        for (uint64_t i = begin; i < end; ++i) {
            // Half the squared difference of two passes estimates the variance of one pass, even if its samples are
            // correlated.
            const double scale2 = sqr(double(mean_of(i))) + 0.01 * mean * mean;
            if (scale2 > 0) pairs += 0.5 * sqr(double(previous_[i])) / scale2;
            errors += error2_of_pass(i, mean);
        }
        pair_sum[chunk] = pairs, pass_sum[chunk] = errors;
    });
    pair_errors_.push_back(sum_of_chunks(pair_sum) / double(n));
    count_last_pair();
    error2_of_pass_ = sum_of_chunks(pass_sum) / double(n);
}

void Film::renew_expected() {
    if (passes_ == 0) return;
    const uint64_t n = geometry_.pixel_count();
    std::vector<double> total(film_chunks(n));
    std::vector<float>& expected = expected_.pixels_;
    for_film_chunks(n, [&](uint64_t chunk, uint64_t begin, uint64_t end) noexcept {
        double sum = 0;
        for (uint64_t i = begin; i < end; ++i) {
            expected[i] = moments_[i].luminance_sum() / float(passes_);
            sum += double(expected[i]);
        }
        total[chunk] = sum;
    });
    double mean = 0;
    for (const double t : total) mean += t;
    mean /= double(n);
    for_film_chunks(n, [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i)
            expected[i] = std::max(expected[i], float(0.1 * mean));
    });
    expected_.average_blocks();
}

std::vector<Rgb> Film::image() const {
    std::vector<Rgb> out(moments_.size());
    image(0, out);
    return out;
}

void Film::image(uint64_t first, std::span<Rgb> to) const {
    for (size_t k = 0; k < to.size(); ++k) to[k] = moments_[first + k].mean(double(passes_));
}

std::vector<Rgb> Film::variance() const {
    std::vector<Rgb> out(moments_.size());
    variance(0, out);
    return out;
}

void Film::variance(uint64_t first, std::span<Rgb> to) const {
    const size_t pairs = group_sums_.size() / 2;
    for (size_t k = 0; k < to.size(); ++k) {
        const size_t i = size_t(first) + k;
        to[k] = Rgb(0);
        if (!has_groups()) {
            to[k] = moments_[i].variance_of_mean(double(passes_));
        } else if (has_all_groups()) {
            // Groups have only sums of luminance. All channels get the relative variance of the luminance.
            const Rgb mean = moments_[i].mean(double(passes_));
            const double y = double(luminance(mean));
            if (!(y > 0)) continue;
            double error2 = 0;
            for (size_t pair = 0; pair < pairs; ++pair)
                error2 += group_error2(pair, i) / double(pairs);
            for (int c = 0; c < 3; ++c) to[k][c] = float(error2 * sqr(double(mean[c]) / y));
        }
    }
}

double Film::group_error2(size_t pair, size_t pixel) const {
    const size_t a = 2 * pair, b = a + 1;
    const double difference = double(group_sums_[a][pixel]) / double(group_passes_[a]) -
                              double(group_sums_[b][pixel]) / double(group_passes_[b]);
    // Half the squared difference estimates the variance of one group; the image is the mean of all groups.
    return 0.5 * sqr(difference) / double(group_sums_.size());
}

ErrorEstimate Film::group_error() const {
    ErrorEstimate e;
    if (!has_all_groups()) return e;
    const uint64_t n = moments_.size(), chunks = film_chunks(n);
    const size_t pairs = group_sums_.size() / 2;
    std::vector<double> luminance_sum(chunks), error_sum(chunks * pairs);
    for_film_chunks(n, [&](uint64_t chunk, uint64_t begin, uint64_t end) noexcept {
        double sum = 0;
        for (uint64_t i = begin; i < end; ++i) sum += double(moments_[i].luminance_sum());
        luminance_sum[chunk] = sum;
    });
    double mean = 0;
    for (const double sum : luminance_sum) mean += sum;
    mean /= double(passes_) * double(n);
    for_film_chunks(n, [&](uint64_t chunk, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i) {
            const double y = double(moments_[i].luminance_sum()) / double(passes_);
            const double scale2 = y * y + 0.01 * mean * mean;
            if (!(scale2 > 0)) continue;
            for (size_t pair = 0; pair < pairs; ++pair)
                error_sum[chunk * pairs + pair] += group_error2(pair, i) / scale2;
        }
    });
    etendue::Moments errors;
    for (size_t pair = 0; pair < pairs; ++pair) {
        double sum = 0;
        for (uint64_t c = 0; c < chunks; ++c) sum += error_sum[c * pairs + pair];
        errors.add(sum / double(n));
    }
    if (errors.count() < 2) return e;
    const double half =
        student_quantile(0.05, double(errors.count() - 1)) * std::sqrt(errors.squared_error());
    e.relative_rms = std::sqrt(errors.mean());
    e.low = std::sqrt(std::max(0.0, errors.mean() - half));
    e.high = std::sqrt(errors.mean() + half);
    e.valid = true;
    return e;
}

double Film::variance_of_pixels() const {
    if (!spreads_) return 1;
    constexpr int kSteps = 1024;
    double squares = 0;  // Σ h² of one axis
    for (int i = 0; i < kSteps; ++i) {
        const ReconstructionFilter::Taps t = filter_.taps((float(i) + 0.5f) / kSteps);
        for (int k = 0; k < t.count; ++k) squares += sqr(double(t.weight[size_t(k)])) / kSteps;
    }
    return sqr(squares);
}

size_t Film::noisy_pairs() const {
    return is_merged_ ? 0 : std::min<size_t>(pair_errors_.size() / 4, kMostNoisyPairs);
}

void Film::count_last_pair() {
    if (pair_errors_.size() <= kMostNoisyPairs) return;
    later_pairs_.sum += pair_errors_.back();
    later_pairs_.squares += sqr(pair_errors_.back());
}

double Film::error2_of_pass(uint64_t pixel, double mean) const {
    const double n = double(passes_), y = exact_luminance(moments_[pixel].sum) / n;
    const double scale2 = y * y + 0.01 * mean * mean;
    return scale2 > 0 ? sqr(double(moments_[pixel].luminance_deviation)) / (n - 1) / scale2 : 0;
}

void Film::renew_error2_of_pass() {
    const uint64_t pixels = moments_.size(), chunks = film_chunks(pixels);
    const double mean = mean_luminance().mean;
    std::vector<double> error_sum(chunks);
    for_film_chunks(pixels, [&](uint64_t chunk, uint64_t begin, uint64_t end) noexcept {
        double sum = 0;
        for (uint64_t i = begin; i < end; ++i) sum += error2_of_pass(i, mean);
        error_sum[chunk] = sum;
    });
    double error2 = 0;
    for (const double sum : error_sum) error2 += sum;
    error2_of_pass_ = error2 / double(pixels);
}

ErrorEstimate Film::error() const {
    if (has_groups()) return group_error();
    ErrorEstimate e;
    const size_t skip = noisy_pairs();
    const size_t count = pair_errors_.size() - skip;
    if (count < 4) return e;
    // Called after every pass: the sums of many pairs are at hand.
    double mean = 0, square = 0;
    const bool has_sums = skip == kMostNoisyPairs;
    if (has_sums) mean = later_pairs_.sum, square = later_pairs_.squares;
    for (size_t i = has_sums ? pair_errors_.size() : skip; i < pair_errors_.size(); ++i) {
        mean += pair_errors_[i];
        square += sqr(pair_errors_[i]);
    }
    mean /= double(count);
    const double spread =
        std::sqrt(std::max(0.0, square / double(count) - mean * mean) / double(count - 1));
    const double relative_half =
        mean > 0 ? student_quantile(0.05, double(count - 1)) * spread / mean : 0.0;
    const double error2 = error2_of_pass_ / double(passes_);
    e.relative_rms = std::sqrt(error2);
    e.low = std::sqrt(error2 * std::max(0.0, 1 - relative_half));
    e.high = std::sqrt(error2 * (1 + relative_half));
    e.valid = true;
    return e;
}

Film::MeanEstimate Film::mean_luminance() const {
    MeanEstimate m;
    if (pass_means_.empty()) return m;
    const double n = double(pass_means_.size());
    for (double v : pass_means_) m.mean += v / n;
    if (has_groups()) {
        if (!has_all_groups()) return m;
        const size_t groups = group_sums_.size();
        std::vector<double> sums(film_chunks(moments_.size()) * groups);
        for_film_chunks(moments_.size(),
                        [&](uint64_t chunk, uint64_t begin, uint64_t end) noexcept {
                            for (size_t g = 0; g < groups; ++g) {
                                double sum = 0;
                                for (uint64_t i = begin; i < end; ++i)
                                    sum += double(group_sums_[g][i]);
                                sums[chunk * groups + g] = sum;
                            }
                        });
        etendue::Moments means;
        for (size_t g = 0; g < groups; ++g) {
            double sum = 0;
            for (size_t at = g; at < sums.size(); at += groups) sum += sums[at];
            means.add(sum / (double(group_passes_[g]) * double(moments_.size())));
        }
        m.standard_error = std::sqrt(means.squared_error());
        m.count = means.count();
        return m;
    }
    if (n < 2) return m;
    double square = 0;
    for (double v : pass_means_) square += sqr(v - m.mean);
    m.standard_error = std::sqrt(square / (n * (n - 1)));
    m.count = int64_t(pass_means_.size());
    return m;
}

}  // namespace etendue
