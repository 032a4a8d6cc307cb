#include "session/snapshot.h"

#include <sys/stat.h>

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "film/parallel_chunks.h"
#include "image/image_io.h"
#include "math/statistics.h"
#include "render/render_report.h"

namespace etendue {
namespace {

/// Mean and variance of `n` images of one channel from its sums.
struct Estimate {
    double mean, variance;
};
Estimate estimate(const Film::Moments& m, int channel, double n) {
    if (!(n > 0)) return {0, 0};
    const double inv = 1 / n, mean = m.sum[channel] * inv;  // the same bits as Film::image()
    if (n < 2) return {mean, 0};
    return {mean, std::max(0.0, m.square[channel] * inv - mean * mean) / (n - 1)};
}

/// Calls use(pixel, channel) for all, in parallel.
template <class Use>
void for_each_channel(uint64_t pixels, const Use& use) {
    for_film_chunks(pixels, [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i)
            for (int c = 0; c < 3; ++c) use(i, c);
    });
}

}  // namespace

double interval_half_width(double variance, uint64_t passes) {
    return student_quantile(0.05, double(passes - 1)) * std::sqrt(variance);
}

void save(const Snapshot& snapshot, const std::string& file, bool replaces) {
    // Not followed: the file is in a folder that the page may write to, what a link names need not be.
    struct stat about {};
    if (::lstat(file.c_str(), &about) == 0) {
        if (!S_ISREG(about.st_mode))
            throw std::runtime_error(fmt::format("{}: is no regular file", file));
        if (!replaces) throw std::runtime_error(fmt::format("{}: exists already", file));
    }
    Image image = rgb_image(snapshot.width, snapshot.height, snapshot.mean);
    if (snapshot.report) add_attributes(*snapshot.report, image);
    write_image(file, image, ExrPrecision::Float, Links::Replace);
}

std::shared_ptr<Snapshot> SnapshotPool::take() {
    std::unique_ptr<Snapshot> snapshot;
    {
        const std::lock_guard lock(shelf_->mutex);
        for (auto& free : shelf_->free)
            if (!snapshot) snapshot = std::move(free);
    }
    if (!snapshot) snapshot = std::make_unique<Snapshot>();
    return {snapshot.release(), [shelf = shelf_](Snapshot* s) {
                std::unique_ptr<Snapshot> owned(s);
                const std::lock_guard lock(shelf->mutex);
                for (auto& free : shelf->free)
                    if (!free) return free.swap(owned);
            }};
}

void fill_snapshot(const Film& film, bool has_groups, Snapshot& to) {
    to.passes = film.passes();
    const std::span<const Film::Moments> moments = film.moments();
    to.mean.resize(moments.size());
    if (has_groups)
        to.variance = film.variance();
    else
        to.variance.resize(moments.size());
    for_each_channel(moments.size(), [&](uint64_t i, int c) {
        const Estimate e = estimate(moments[i], c, double(film.passes()));
        to.mean[i][c] = float(e.mean);
        if (!has_groups) to.variance[i][c] = float(e.variance);
    });
}

void SeedMean::add(std::span<const Rgb> image, uint64_t passes) {
    moments_.resize(image.size());
    for_each_channel(image.size(), [&](uint64_t i, int c) {
        const double value = image[i][c];
        moments_[i].sum[c] += value;
        moments_[i].square[c] += value * value;
    });
    passes_ += passes;
    ++count_;
}

void SeedMean::fill(const Film* film, Snapshot& to) const {
    const uint64_t more = film ? film->passes() : 0;
    to.passes = passes_ + more;
    to.mean.resize(moments_.size());
    to.variance.resize(moments_.size());
    // A rendering under way counts by its passes.
    const double share = double(more) / double(to.passes);
    for_each_channel(moments_.size(), [&](uint64_t i, int c) {
        const Estimate e = estimate(moments_[i], c, count_);
        const double mean =
            more > 0
                ? (1 - share) * e.mean + share * estimate(film->moments()[i], c, double(more)).mean
                : e.mean;
        to.mean[i][c] = float(mean);
        to.variance[i][c] = float(e.variance);
    });
}

void SeedMean::save(SectionWriter& to) const {
    to.put(count_);
    to.put(passes_);
    to.put(moments_);
}

void SeedMean::load(SectionReader& from, uint64_t pixels) {
    from.get(count_);
    from.get(passes_);
    from.get(moments_, count_ > 0 ? pixels : 0, "pixels");
    const bool is_possible = count_ > 0 ? passes_ >= uint64_t(count_) && passes_ <= kMostPasses
                                        : count_ == 0 && passes_ == 0;
    if (!is_possible) from.fail("the seeds of the run are damaged");
}

}  // namespace etendue
