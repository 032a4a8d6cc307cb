#pragma once
// A run of a session, for its parts.

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "session/session.h"

namespace etendue {

/// Whether technique images up to this many edges fit into Session::kTechniqueBytes.
inline bool technique_images_fit(const Scene& scene, int depth) {
    return depth == 0 || TechniqueImages::memory_bytes(scene.film().pixel_count(), depth) <=
                             Session::kTechniqueBytes;
}

struct Session::Run : std::enable_shared_from_this<Session::Run> {
    RunStatus status;  ///< Guarded by the session's mutex, as are these:
    std::string own_file,
        own_version;     ///< Its file in the folder of runs, and that which it wrote.
    int file_seeds = 0;  ///< The seeds that are finished in the file.
    std::shared_future<void> file_written;  ///< Of the last one that was begun.
    bool is_choosing =
        false;  ///< Whether pilots choose its method, which have no result of their own.

    SharedSlot<const Snapshot> snapshot;
    SharedSlot<const TechniqueSnapshot> techniques;
    SharedSlot<const SeedSeries> series{std::make_shared<const SeedSeries>()};
    const std::shared_ptr<LargestPasses> largest = std::make_shared<LargestPasses>();
    std::atomic<bool> is_wanted{true}, wants_techniques{false};
    std::shared_ptr<const LoadedScene> loaded;  ///< Constant from the start on.
    const Scene& scene() const { return loaded->scene; }

    // Of the session's thread.
    bool has_seeds() const { return status.seeds > 1; }
    /// The film whose passes are not among `seeds`; nullptr if there is none.
    const Film* film() const {
        if (is_counted) return nullptr;
        if (totals) return totals->film.get();
        return renderer ? &renderer->film() : nullptr;
    }
    const TechniqueImages* technique_images() const {
        if (totals) return totals->techniques.get();
        return renderer && !has_seeds() ? renderer->techniques() : nullptr;
    }
    uint64_t passes() const { return seeds.passes() + (film() ? film()->passes() : 0); }

    // The seeds that are finished, in a section of a checkpoint of the one under way.
    void save_seeds(SectionWriter& to) const;
    /// Throws std::runtime_error if they do not fit the scene or the record of the run.
    void load_seeds(SectionReader& from);

    RenderSettings settings;
    std::unique_ptr<Integrator> integrator;  ///< Until the first renderer is made.
    std::unique_ptr<Renderer> renderer;
    std::unique_ptr<const RenderTotals> totals;  ///< In its place, of a run that does not go on.
    Conditions conditions;                       ///< Of the renderer, if runs are kept.
    PassLog log;                                 ///< Of the renderer.
    bool is_counted = false;                     ///< Whether the renderer's image is among `seeds`.
    SeedMean seeds;
    int shown_seeds = 0;                                ///< Of them, those in the last snapshot.
    double pass_seconds = 0;                            ///< Of the last pass.
    double shown_seconds = 0;                           ///< Processor time of the last snapshot.
    std::chrono::steady_clock::time_point next_file{};  ///< When it is to be kept while it renders.
    RecentError error;
    SnapshotPool pool;
    uint64_t last_turn = 0;
};

}  // namespace etendue
