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
    if (snapshot.report) image.attributes = attributes_of(*snapshot.report);
    write_image(file, image, {.links = Links::Replace});
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

void fill_snapshot(const Film& film, Snapshot& to) {
    const uint64_t pixels = film.moments().size();
    to.passes = film.passes();
    to.mean.resize(pixels), to.variance.resize(pixels);
    for_film_chunks(pixels, [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        film.image(begin, std::span(to.mean).subspan(begin, end - begin));
        film.variance(begin, std::span(to.variance).subspan(begin, end - begin));
    });
}

void SeedMean::add(std::span<const Rgb> image, uint64_t passes) {
    moments_.resize(image.size());
    for_film_chunks(image.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i) moments_[i].add(image[i], double(count_));
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
    const float share = float(double(more) / double(to.passes));
    for_film_chunks(moments_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i) {
            to.mean[i] = moments_[i].mean(double(count_));
            to.variance[i] = moments_[i].variance_of_mean(double(count_));
            if (more > 0)
                to.mean[i] =
                    to.mean[i] * (1 - share) + film->moments()[i].mean(double(more)) * share;
        }
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
