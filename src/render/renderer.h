#pragma once
// Renders pass by pass: the parallel loop, limits, statistics.

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "integrator/integrator.h"
#include "render/contribution_observer.h"
#include "render/cost_limit.h"
#include "render/technique_images.h"
#include "system/ranks.h"

namespace etendue {

/// Limits of a rendering; the first one that is reached ends it. At least one pass is made.
struct RenderLimits {
    std::optional<uint64_t> spp;
    std::optional<double> seconds;
    std::optional<double> error;  ///< Relative RMS error of the image, see ErrorEstimate.
};

/// Random numbers are addressed by the index of the pass, which has 32 bits.
constexpr uint64_t kMostPasses = uint64_t(1) << 32;
/// Throws std::runtime_error if a limit is beyond what can be rendered.
void check_limits(const RenderLimits& limits, uint64_t first_pass = 0);

/// How an image is rendered, apart from the method.
struct RenderOptions : RenderLimits {
    SamplerKind sampler = SamplerKind::Independent;
    FilterMode filter_mode = FilterMode::Spread;
    uint64_t seed = 0;
    /// Index of the first pass, so that several renderings can share the passes of a seed. Methods that learn from earlier
    /// passes, and chains, then start anew with other random numbers.
    uint64_t first_pass = 0;
    int threads =
        0;  ///< Number of threads of this renderer; 0: one per core. Renderers share no threads.
    /// Technique images up to this many edges; 0 for none.
    int technique_depth = 0;
};

struct MethodChoice;

struct RenderSettings : RenderOptions {
    IntegratorSpec integrator{"path", {}};
    /// How `integrator` was chosen, if pilots did it; see with_chosen_method().
    std::shared_ptr<const MethodChoice> choice = nullptr;
    PathSelection
        shown;  ///< Paths that are added to the image. Other paths are sampled, but not added.
    ContributionObserver* observer = nullptr;  ///< Must outlive the rendering.
    /// If not empty, called by the threads of a pass again and again while its samples are traced. It may call
    /// Renderer::sample_again(), and must not throw exceptions.
    std::function<void()> meanwhile;
    /// Whether the film notes the brightest pass of every pixel, see Film::largest(). Passes of chains are not noted.
    bool keeps_largest = false;
    /// Whether what was learned is kept for integrators of which only whole passes can be traced again, see generation_of().
    /// At most kGenerationBytes are, or those of one generation; what was learned first is given up first. None where there is
    /// no memory for it.
    bool keeps_generations = false;
    /// run() then ends as if it were interrupted, and the pass is discarded. For pilots.
    std::optional<CostLimit> cost_limit = {};
    /// The processes that render the image together, each of them by a Renderer with these settings. They must outlive it.
    const Ranks* ranks = &kAlone;
};

class Renderer;

/// What the passes of a generation (Integrator::learn()) are made from, beside the scene and their random numbers.
struct Generation {
    uint32_t number = 0;
    std::vector<std::byte> learned;
    ExpectedLuminance expected;
};
constexpr size_t kGenerationBytes = size_t(256) << 20;

struct Progress {
    const Renderer& renderer;
    uint64_t passes;
    double seconds;                  ///< See Renderer::seconds().
    std::optional<double> fraction;  ///< Finished fraction of the work; empty if it is unknown.
    double rays_per_second;
    /// Whether the state can be saved and the image read now. Not if other processes have finished later passes.
    bool ends_round = true;

    /// The image's error, which is computed by this call; for methods with groups of passes, from all pixels.
    ErrorEstimate error() const;
};

/// The error for those who are told of every pass, but do not need it of every pass: where it takes time, it is up to a
/// second old. Of the pass that reaches a limit, it is not.
class RecentError {
public:
    const ErrorEstimate& update(const Progress& progress);

private:
    ErrorEstimate last_;
    double seconds_ = 0;
};

/// Why a rendering ended.
enum class StopReason { Samples, Time, Error, Interrupted };
const char* to_string(StopReason reason);
const char* to_string(Estimator estimator);

/// Offset of the film points of a pass in their pixels: a point of one sequence over the passes.
Vec2 film_offset(SamplerKind kind, uint64_t seed, uint32_t pass);

class Renderer {
public:
    /// Throws std::runtime_error if the integrator's parameters are wrong. The scene must outlive the renderer. If the
    /// integrator is one that pilots choose, and none is chosen yet, it is chosen here, see with_chosen_method().
    Renderer(const Scene& scene, const RenderSettings& settings);
    /// Uses `integrator` instead of settings.integrator, unless it is nullptr.
    Renderer(const Scene& scene, const RenderSettings& settings,
             std::unique_ptr<Integrator> integrator);
    ~Renderer();

    /// Renders until a limit is reached or `interrupted` is set. The current pass is finished, unless `drop` is also
    /// set. `progress` is called after every pass, by the calling thread.
    ///
    /// A pass is discarded if `drop` is set or if it throws an exception, which is passed to the caller. Film,
    /// technique images and statistics are then the same as after the previous pass.
    ///
    /// Several processes share the passes of a generation (Integrator::learn()); the bits are the same for any number. All of
    /// them must call this function, and get the same calls of `progress` and the same result: it ends if any of them is
    /// interrupted or fails.
    StopReason run(const std::function<void(const Progress&)>& progress,
                   const std::atomic<bool>& interrupted,
                   const std::atomic<bool>& drop = kNeverDrop) {
        return run(settings_, progress, interrupted, drop);
    }
    /// The same with other limits. Limits count from the first pass. Each call continues where the previous one
    /// stopped, so several calls render the same image as a single call.
    StopReason run(const RenderLimits& limits, const std::function<void(const Progress&)>& progress,
                   const std::atomic<bool>& interrupted,
                   const std::atomic<bool>& drop = kNeverDrop);

    /// The pass whose data the integrator has, such as its light paths; the first one is 0. It is the last one or, in
    /// RenderSettings::meanwhile, that in flight. Empty if no pass was made, or if the pass was discarded. Must not run
    /// during run(), except in RenderSettings::meanwhile of this or another renderer that waits for it.
    std::optional<uint32_t> kept_pass() const { return kept_pass_; }
    /// Traces sample `index` of kept_pass() again (see Film::sample_pixel()). Its contributions go to `sink`, its sub-paths
    /// to `work`. May be called where kept_pass() may. Returns false if there is no such pass.
    bool sample_again(uint64_t index, Workspace& work, ContributionSink& sink) const;

    /// What a pass that was made, or is in flight, was made from; nullptr if that is not kept. May be called where kept_pass()
    /// may.
    std::shared_ptr<const Generation> generation_of(uint32_t pass) const;
    /// Traces what the samples of a pass of another renderer share, which has the same scene and settings; then the pass is
    /// kept_pass(). An observer is told of all splats. Needs a renderer without passes, which cannot make any afterwards.
    /// Throws PassDropped if `drop` is set.
    void trace_again(uint32_t pass, std::shared_ptr<const Generation> generation,
                     const std::atomic<bool>& drop);

    /// With several processes: makes the film and the learned state of this one complete. To be called by all of them after
    /// run(), or where Progress::ends_round is true, before the image is read or the state is saved.
    void gather();

    /// Whether the last run() has ended in all processes. Otherwise it has thrown an exception in this one alone: the others
    /// wait for it in vain, so it must end.
    bool ended_together() const { return ended_together_ || settings_.ranks->count() == 1; }
    /// Where the last run() has thrown an exception: "pass 4 failed" or, if it was no pass that threw it, "after pass 3".
    std::string place_of_failure() const;

    const Scene& scene() const { return scene_; }
    const Film& film() const { return film_; }
    uint64_t light_paths() const { return light_paths_; }  ///< Number of light paths in a pass.
    const Integrator& integrator() const { return *integrator_; }
    /// As given, but with the method that `auto` has chosen.
    const RenderSettings& settings() const { return settings_; }
    const RenderStats& stats() const { return stats_; }  ///< Statistics of the finished passes.
    /// Of what Integrator::prepare() has traced, which is no part of stats(), nor of a state that was loaded.
    const RenderStats& preparation() const { return preparation_; }
    /// Whether Integrator::prepare() has ended for the last pass that was begun.
    bool is_prepared() const { return is_prepared_; }
    /// What counts for CostLimit; for renderers that have one.
    double cost() const { return settings_.cost_limit->cost_of(preparation_, stats_); }
    /// Time of the finished passes in run(), and of the choice of the method before the first.
    double seconds() const { return seconds_; }
    ErrorEstimate error() const;  ///< Of the film, computed by the threads of this renderer.
    const TechniqueImages* techniques() const { return techniques_.get(); }

    /// Between calls of run(): writes everything that later passes and the results depend on, as sections. load() reads it
    /// into a renderer of the same scene with the same settings, without passes, which then goes on with the same bits. It
    /// throws std::runtime_error if this is impossible; then the renderer cannot be used. The file must be trusted: its
    /// learned state is used as it is.
    void save(SectionWriter& to) const;
    void load(SectionReader& from);
    /// The part of save() that the results depend on.
    void save_sums(SectionWriter& to) const;

private:
    static inline const std::atomic<bool> kNeverDrop{false};

    /// Seed and pass index of the random numbers of a pass.
    struct Numbers {
        uint64_t seed;
        uint32_t pass;
    };
    /// Of the pass that follows `passes` others of this rendering.
    Numbers numbers(uint32_t passes) const;
    class Pass;
    /// Passes that the processes make at the same time: of each process at most one.
    struct Round;
    /// Traces the pass of this process, and exchanges what all of them have made.
    Round make_round(const RenderLimits& limits, const std::atomic<bool>& drop);
    void trace_own_pass(Round& round, const std::atomic<bool>& drop);
    void drop_pass();
    void exchange(Round& round);
    void add_pass(Round& round, int rank);
    void keep_generation(uint32_t number, std::vector<std::byte> learned);
    const ExpectedLuminance& expected() const {
        return replayed_ ? replayed_->expected : film_.expected();
    }
    std::vector<std::byte> learned_state() const;
    void load_learned_state(std::vector<std::byte> bytes);
    /// `error`: empty if there is no limit of the error.
    std::optional<StopReason> reached(const RenderLimits& limits,
                                      const std::optional<ErrorEstimate>& error) const;
    /// Mean time of the finished passes; 0 if there are none.
    double seconds_a_pass() const;
    /// Number of passes in the next round.
    int round_size(const RenderLimits& limits) const;

    const Scene& scene_;
    RenderSettings settings_;
    std::unique_ptr<Integrator> integrator_;
    uint64_t light_paths_;  ///< Number of light paths in a pass.
    Film film_;
    std::unique_ptr<TechniqueImages> techniques_;
    struct Workers;
    std::unique_ptr<Workers> workers_;
    uint64_t learned_steps_ = 0;  ///< Number of calls of Integrator::learn().
    bool is_prepared_ = false;    ///< Whether Integrator::prepare() has followed the last of them.
    std::optional<uint32_t> kept_pass_;
    std::vector<std::shared_ptr<const Generation>> generations_;
    std::shared_ptr<const Generation> replayed_;  ///< Of trace_again().
    int last_rank_ = -1;  ///< The process whose state is that after the last pass; -1: of each.
    bool ended_together_ = true, pass_failed_ = false;  ///< In the last run().
    RenderStats stats_, preparation_;
    double seconds_ = 0;
};

}  // namespace etendue
