#pragma once
// Copies of a film between passes, for readers in other threads, and the time that they may take.

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "film/film.h"
#include "system/section_file.h"

namespace etendue {

/// The image of a run after a number of passes.
struct Snapshot {
    int run = 0;
    uint64_t passes = 0;
    int width = 0, height = 0;
    std::vector<Rgb> mean;
    std::vector<Rgb> variance;  ///< Of the mean; zero below two passes, empty of an image file.
    std::shared_ptr<const nlohmann::json> report;  ///< For the file that the image is saved in.
};

/// Saves the image with its report. Throws std::runtime_error; also where a file has the name, unless it is to be
/// replaced. Only regular files are.
void save(const Snapshot& snapshot, const std::string& file, bool replaces);

/// Half-width of the 95 % confidence interval of a mean of `passes` ≥ 2 passes, whose variance was estimated from their
/// spread.
double interval_half_width(double variance, uint64_t passes);

/// Reuses the memory of snapshots that no reader holds any more, because new pages cost more time than the copy.
class SnapshotPool {
public:
    /// A snapshot with undefined contents, which returns to the pool when its last owner releases it.
    std::shared_ptr<Snapshot> take();

private:
    struct Shelf {
        std::mutex mutex;
        std::array<std::unique_ptr<Snapshot>, 2> free;
    };
    std::shared_ptr<Shelf> shelf_ = std::make_shared<Shelf>();
};

/// Copies the film's mean and variance. Must not run during Film::end_pass().
void fill_snapshot(const Film& film, Snapshot& to);

/// The images of renderings that are finished, each with another seed.
class SeedMean {
public:
    void add(std::span<const Rgb> image, uint64_t passes);
    int count() const { return count_; }
    uint64_t passes() const { return passes_; }
    /// Mean and variance of these images, and of `film`, which is one more that is not finished; nullptr: none.
    void fill(const Film* film, Snapshot& to) const;
    void save(SectionWriter& to) const;
    /// `pixels`: of each image. Throws std::runtime_error if the file has another number of them.
    void load(SectionReader& from, uint64_t pixels);

private:
    std::vector<PixelMoments> moments_;
    uint64_t passes_ = 0;
    int32_t count_ = 0;
};

/// Keeps the processor time of snapshots, and of sending them, at or below 2 % of the time of a rendering.
class SnapshotBudget {
public:
    using Clock = std::chrono::steady_clock;
    static constexpr double kShare = 0.02;

    bool allows(Clock::time_point now) const { return now >= next_; }
    /// Notes that a snapshot was finished at `now` and took `cpu_seconds`.
    void taken(Clock::time_point now, double cpu_seconds) {
        next_ = std::max(next_, now);
        spent(cpu_seconds);
    }
    /// Adds processor time, such as that of encoding and sending.
    void spent(double cpu_seconds) {
        next_ += std::chrono::duration_cast<Clock::duration>(
            std::chrono::duration<double>(cpu_seconds / kShare));
    }

private:
    Clock::time_point next_{};
};

}  // namespace etendue
