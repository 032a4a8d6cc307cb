#pragma once
// The denoised image of one run at a time, which a thread beside the rendering computes. It is only shown: the images that
// are saved, compared with and measured against are those of the run.

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "image/denoiser.h"
#include "session/session.h"

namespace etendue {

class DenoisedImages {
public:
    /// While a run renders, the thread rests this many times as long as an image took.
    static constexpr double kRest = 4;

    /// `threads`: of an image while no run renders; 0: one per core. While one renders, it is one.
    DenoisedImages(Session& session, int threads);
    /// Cancels what is under way.
    ~DenoisedImages();
    DenoisedImages(const DenoisedImages&) = delete;
    DenoisedImages& operator=(const DenoisedImages&) = delete;

    // From any thread.

    /// The latest denoised image of the run, or nullptr; has a newer one computed if the run has one with more than `after`
    /// passes. Throws ApiError with the reason if the last attempt failed, and for an unknown run.
    std::shared_ptr<const Snapshot> ask(int run, uint64_t after);
    /// The latest one, or nullptr.
    std::shared_ptr<const Snapshot> of_run(int run) const;
    /// Cancels the work on a run that is removed, and releases its image.
    void forget(int run);
    /// A number that changes with each image and each failure.
    uint64_t version() const { return version_.load(); }

    /// The run of a view named denoised:RUN; empty for other views.
    static std::optional<int> run_of(std::string_view view);

private:
    void work();
    /// Makes the image of a run; nullptr if the run has none that is newer.
    std::shared_ptr<const Snapshot> denoised(int run);
    bool renders() const;
    bool goes_on() const { return !is_ended_ && !is_cancelled_; }
    void make_guides(const std::shared_ptr<const Scene>& scene, int threads);

    Session& session_;
    const int threads_;
    std::atomic<bool> is_ended_{false}, is_cancelled_{false};
    std::atomic<uint64_t> version_{0};

    // Of the thread.
    std::unique_ptr<const Denoiser> denoiser_;  ///< From the first image on.
    std::weak_ptr<const Scene> scene_of_guides_;
    std::vector<Rgb> albedo_, normal_;

    mutable std::mutex mutex_;  ///< Guards the members below.
    std::condition_variable wake_;
    std::optional<int> wanted_;
    int under_way_ = 0;      ///< The run; 0: none.
    std::set<int> removed_;  ///< The session removes a run after its current pass.
    std::shared_ptr<const Snapshot> image_;
    std::string problem_;  ///< Of the last attempt, until it was told.
    int problem_run_ = 0;
    std::chrono::steady_clock::time_point next_{};

    std::thread thread_;
};

}  // namespace etendue
