#pragma once
// Passes over the film: the parallel loop, when to stop, statistics.

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "integrator/integrator.h"
#include "render/contribution_observer.h"
#include "render/technique_images.h"

namespace etendue {

/// When to stop: at whichever comes first. At least one pass is made.
struct RenderLimits {
    std::optional<uint64_t> spp;
    std::optional<double> seconds;
    std::optional<double> error;  ///< Relative RMS error of the image, see ErrorEstimate.
};

struct RenderSettings : RenderLimits {
    IntegratorSpec integrator{"path", {}};
    SamplerKind sampler = SamplerKind::Independent;
    uint64_t seed = 0;
    int threads = 0;  ///< 0: all. Each renderer has its own, whatever others have.
    /// Technique images up to this many edges; 0 for none.
    int technique_depth = 0;
    PathSelection shown;                       ///< Others are made, but do not reach the image.
    ContributionObserver* observer = nullptr;  ///< Must outlive the rendering.
};

struct Progress {
    uint64_t passes;
    double seconds;                  ///< As Renderer::seconds().
    std::optional<double> fraction;  ///< Of the work, where that can be told.
    double rays_per_second;
    ErrorEstimate error;
};

/// Why a rendering ended.
enum class StopReason { Samples, Time, Error, Interrupted };
const char* to_string(StopReason reason);
const char* to_string(Estimator estimator);

class Renderer {
public:
    /// Throws std::runtime_error if the integrator's parameters are wrong. The scene must outlive the renderer.
    Renderer(const Scene& scene, const RenderSettings& settings);
    /// With this integrator instead of the settings'.
    Renderer(const Scene& scene, const RenderSettings& settings,
             std::unique_ptr<Integrator> integrator);
    ~Renderer();

    /// Renders until a limit is reached or `interrupted` is set. The current pass is finished, unless `drop` is set too. `progress` is called after every pass, from the calling thread.
    ///
    /// A pass is dropped if `drop` is set or if it throws an exception, which the caller receives. Film, technique images
    /// and statistics are then as they were after the pass before.
    StopReason run(const std::function<void(const Progress&)>& progress,
                   const std::atomic<bool>& interrupted,
                   const std::atomic<bool>& drop = kNeverDrop) {
        return run(settings_, progress, interrupted, drop);
    }
    /// The same with other limits. Limits count from the first pass on. Several calls render the same image as one call:
    /// each continues where the last one stopped.
    StopReason run(const RenderLimits& limits, const std::function<void(const Progress&)>& progress,
                   const std::atomic<bool>& interrupted,
                   const std::atomic<bool>& drop = kNeverDrop);

    const Film& film() const { return film_; }
    const Integrator& integrator() const { return *integrator_; }
    const RenderStats& stats() const { return stats_; }  ///< Of the finished passes.
    double seconds() const { return seconds_; }          ///< Spent in run() on them.
    const TechniqueImages* techniques() const { return techniques_.get(); }

private:
    static inline const std::atomic<bool> kNeverDrop{false};

    void pass(const std::atomic<bool>& drop);
    void trace_pass(const std::atomic<bool>& drop);
    std::optional<StopReason> reached(const RenderLimits& limits, const ErrorEstimate& error) const;

    const Scene& scene_;
    RenderSettings settings_;
    std::unique_ptr<Integrator> integrator_;
    uint64_t light_paths_;  ///< Of a pass.
    Film film_;
    std::unique_ptr<TechniqueImages> techniques_;
    struct Workers;
    std::unique_ptr<Workers> workers_;
    uint64_t learned_passes_ = 0;  ///< That the integrator has learned for.
    RenderStats stats_;
    double seconds_ = 0;
};

}  // namespace etendue
