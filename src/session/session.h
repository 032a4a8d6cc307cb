#pragma once
// An interactive session: a thread that loads a scene and renders runs, one per method. Other threads start and stop runs,
// and read snapshots. The images are bit-identical to those of `etendue render`, however often a run is stopped or shown.
// Runs can be kept in a folder, and go on in another session.

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "render/render_request.h"
#include "render/writing_pace.h"
#include "session/largest_passes.h"
#include "session/loaded_scene.h"
#include "session/replay.h"
#include "session/run_folder.h"
#include "session/seed_series.h"
#include "session/shared_slot.h"
#include "session/snapshot.h"
#include "session/workers.h"

namespace etendue {

/// Without any limit, the run ends when it is stopped. The technique depth is reduced until the images fit into
/// kTechniqueBytes, and the number of threads is that of the session.
struct RunRequest : RenderRequest {
    /// Value of the integrator's parameter `user_paths`; empty: not given.
    std::string user_paths;
    /// Number of renderings, with the seeds `seed`, `seed` + 1, …; the limits apply to each. The run then shows the mean
    /// of all their passes, and has a SeedSeries.
    int seeds = 1;
};

/// `Stopping`: until the pass in flight is complete and its image is shown.
enum class RunState { Rendering, Stopping, Stopped, Finished, Failed };
const char* to_string(RunState state);

/// Meaning of the interval of a pixel that is computed from the spread of a run's passes.
enum class IntervalKind {
    Confidence,  ///< 95 % confidence interval.
    Upper,       ///< Upper bound: passes of a Sobol' sampler are negatively correlated.
    NoiseOnly,   ///< Without the bias of a consistent or biased method.
    None,        ///< No interval: the passes belong to Markov chains, or the run has several seeds.
};
const char* to_string(IntervalKind kind);
IntervalKind interval_kind(Estimator estimator, SamplerKind sampler, bool has_groups, int seeds);
/// The kind of which to_string() gives this name. Throws std::runtime_error if there is none.
Estimator estimator_named(const std::string& name);

struct ConvergencePoint {
    uint64_t passes;
    double seconds;
    ErrorEstimate error;
};

struct RunStatus {
    int id = 0;
    RenderRequest request;  ///< As it is rendered.
    int seeds = 1, finished_seeds = 0;
    RunState state = RunState::Rendering;
    std::string message;                       ///< Why the run failed.
    uint64_t passes = 0, snapshot_passes = 0;  ///< With several seeds: of all of them.
    double seconds = 0, rays_per_second = 0;
    std::optional<double> fraction;
    ErrorEstimate error;
    Estimator estimator = Estimator::Unbiased;
    IntervalKind interval = IntervalKind::Confidence;
    std::shared_ptr<const MethodChoice> choice;  ///< Where `auto` has chosen the method.
    std::vector<std::string> warnings;           ///< Of the memory that the passes need.
    std::vector<std::pair<std::string, double>> figures;
    std::vector<ConvergencePoint> history;  ///< Points that are about equally spaced in log time.
    bool is_of_this_scene = true;           ///< False after the scene was loaded again.

    // Of runs that are kept in a folder.
    std::string file;            ///< Name of its file there; empty: there is none.
    uint64_t file_passes = 0;    ///< Of the file.
    uint64_t opened_passes = 0;  ///< Of the file from which it was opened; 0: it was started.
    std::string file_problem;    ///< Why a later state could not be saved; empty if it could.
    std::string why_look_only;   ///< Why the run cannot go on; empty if it can.
};

/// The technique images of a run after a number of passes.
struct TechniqueSnapshot {
    uint64_t passes;
    int width, height;
    std::vector<TechniqueImages::Entry> images;
};

/// What became of an image that was to be saved.
struct Saved {
    std::string error;    ///< Empty: it was saved.
    uint64_t passes = 0;  ///< Of the image.
};

/// The file that was to be opened as a run.
struct Opened {
    std::string error;  ///< Empty: it was.
    int run = 0;
};

/// How runs are kept.
struct RunKeeping {
    std::string folder;  ///< Empty: they are not.
    double every = 60;   ///< Seconds between two states that are saved while a run renders.
};

class Session {
public:
    using Load = std::function<LoadedScene()>;
    static constexpr size_t kTechniqueBytes = size_t(512) << 20;

    /// Loads the scene in a thread of its own, while runs of an earlier one go on. `threads`: number of threads of each
    /// rendering; 0: one per core.
    Session(Load load, int threads, RunKeeping keeping = {});
    /// Discards the current pass. Images that are to be saved are, and runs are kept.
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    // -- From any thread.

    /// nullptr while the first scene is being loaded, or if it could not be loaded.
    std::shared_ptr<const Scene> scene() const {
        const std::shared_ptr<const LoadedScene> loaded = scene_.load();
        return loaded ? std::shared_ptr<const Scene>(loaded, &loaded->scene) : nullptr;
    }
    /// Number of times that a scene was loaded; runs of earlier ones keep them.
    uint64_t scene_version() const { return scene_version_.load(); }
    /// The reason why the scene could not be loaded; empty otherwise.
    std::string load_error() const;
    /// Whether a scene is being loaded. After close(), no more are.
    bool is_loading() const;
    /// Loads the scene again. Runs of the earlier version are stopped; they keep their scene.
    void reload();

    /// Returns the run's id. Throws std::runtime_error with the integrator's own message.
    int start(const RunRequest& request);
    /// Finishes the current pass, then stops.
    void stop(int run);
    /// Discards the current pass, and stops.
    void discard(int run);
    /// Continues a run that was stopped or has finished, up to `limits` if any are given. Throws std::runtime_error if it
    /// can only be looked at.
    void resume(int run, const RenderLimits& limits);
    /// Removes the run and its image.
    void remove(int run);
    /// Saves the image of the latest pass, without waiting for the pass in flight where that image is shown already; see
    /// etendue::save(). Then calls `done` once, in a thread of the session.
    void save(int run, const std::string& file, bool replaces,
              std::function<void(const Saved&)> done);
    /// Stops all runs; with `drop`, discards the current pass.
    void stop_all(bool drop);
    /// The same, and from now on no run is started or continued.
    void close(bool drop);
    /// Waits until the current pass and all commands so far are finished, and the files of the runs are written.
    void settle();

    // Runs are kept in the folder when they end or are stopped, and from time to time while they render.

    /// The folder; empty if runs are not kept.
    std::string runs_folder() const { return folder_ ? folder_->path() : ""; }
    /// The runs of the scene there that are not open, and what cannot be read, as of the last look into the folder. That is
    /// after a scene was loaded or a run was removed, and at a call of list_kept(), which does not wait for it.
    std::vector<KeptRun> kept() const;
    void list_kept();
    /// A number that changes whenever kept() does, apart from runs that are opened and removed.
    uint64_t kept_version() const { return kept_version_.load(); }
    /// Opens a file of the folder, unless it is open, and calls `done` in a thread of the session. The run goes on with the
    /// same bits; where they would be others, it can only be looked at.
    void open(const std::string& name, std::function<void(const Opened&)> done);

    /// Throws std::runtime_error for an unknown run, as do all functions that take one.
    RunStatus status(int run) const;
    std::vector<RunStatus> runs() const;
    /// The scene that the run was started with, or opened.
    std::shared_ptr<const Scene> scene_of(int run) const;
    /// A number that changes whenever the status of a run changes.
    uint64_t revision() const { return revision_.load(); }

    /// Returns the latest snapshot, or nullptr, and requests a newer one.
    std::shared_ptr<const Snapshot> snapshot(int run);
    std::shared_ptr<const TechniqueSnapshot> techniques(int run);
    /// The finished renderings of a run with several seeds; empty for other runs.
    std::shared_ptr<const SeedSeries> seed_series(int run) const;
    /// Calls `done` in a thread of the session with the brightest pass of each pixel, during the call. Nothing is known of
    /// runs with chains or several seeds, and of those that can only be looked at.
    void ask_largest(int run, std::function<void(const LargestPasses&)> done);
    /// Calls `done` in a thread of the session with the paths of a pixel, at most `most_paths`, or with an error. They are
    /// those of the last pass or, while its samples are traced, of the pass in flight, whose end is not waited for.
    void replay_last(int run, uint64_t pixel, size_t most_paths,
                     std::function<void(const Replay&, const std::string& error)> done);
    /// Calls `done` in a thread of the session with what a pass is traced again from; empty if that is not kept.
    void ask_pass(int run, uint32_t pass,
                  std::function<void(const std::optional<PassOfRun>&)> done);
    /// Charges processor time, in seconds, that was spent on a snapshot outside the session.
    void spent(double cpu_seconds);

private:
    struct Run;
    void end();
    void work();
    void load_scenes();
    void load_scene();
    void post(std::function<void()> command);
    /// Posts a part of the work of a run.
    void post(const std::shared_ptr<Run>& run, std::function<void(Run&)> work);
    void execute_commands();
    /// Calls `question`, which changes no run, in a thread of the session, while a pass is traced or between passes.
    void ask(std::function<void()> question);
    void answer_questions() noexcept;
    /// Settings of a rendering whose threads answer questions and which keeps its largest passes, and what they are traced
    /// again from, unless it is one of several seeds.
    RenderSettings settings_of_run(RenderSettings settings, int seeds);
    /// Carries out a part of the work of a run. An exception ends the run, which keeps its passes.
    template <class Work>
    void guard(Run& run, const Work& work) noexcept;
    RunStatus status_of(const Run& run) const;
    /// Needs the mutex.
    std::shared_ptr<Run> find(int run) const;
    /// The same without the mutex.
    std::shared_ptr<Run> found(int run) const;
    std::shared_ptr<Run> next_run() const;
    void take_turn(Run& run);
    void make_renderer(Run& run);
    /// Lets `auto` choose the method of a run.
    std::unique_ptr<Integrator> chosen_method(Run& run);
    void after_pass(Run& run, const Progress& progress);
    /// Publishes, in the session's thread, and takes the processor time from the budget.
    void show(Run& run) noexcept;
    /// Publishes a snapshot, and the technique images if they were requested. Where there is no memory for them, the
    /// earlier ones stay.
    void publish(Run& run) noexcept;
    void fill(Run& run, Snapshot& snapshot);
    void finish_turn(Run& run, RunState state, std::string message = {}) noexcept;
    /// Keeps the image of a finished seed. Returns whether another seed follows.
    bool finish_seed(Run& run);
    /// Shows the last image of a run that is to be stopped.
    void finish_stop(Run& run);
    /// Has an image shown that no pass to come would show. Needs the mutex.
    void show_if_idle(const std::shared_ptr<Run>& run);
    void write(const std::shared_ptr<const Snapshot>& snapshot, const std::string& file,
               bool replaces, const std::function<void(const Saved&)>& done);
    /// Keeps the state of a run, if it has changed and there is a folder.
    void keep(Run& run) noexcept;
    void write_state(Run& run);
    /// Sets the time of the next file of a run that renders. `seconds`: what the last one took.
    void wait_for_next_file(Run& run, double seconds) const;
    /// A run with the state of a file, which is not yet one of the session.
    std::shared_ptr<Run> load_run(const std::string& name);
    /// Returns the id of the run.
    int open_now(const std::string& name);
    /// Looks into the folder. False if too many files wait.
    bool look_into_folder() noexcept;
    /// Marks a run as stopping, and lets the session's thread do the rest. Needs the mutex.
    void request_stop(const std::shared_ptr<Run>& run);
    /// The same for a run in any state: one that does not render is stopped after the commands that wait, since one of
    /// them may resume it. Needs the mutex.
    void stop(const std::shared_ptr<Run>& run);
    void changed() { ++revision_; }

    const Load load_;
    const int threads_;
    const std::optional<RunFolder> folder_;
    const WritingPace pace_;  ///< Of the files of a run.
    SharedSlot<const LoadedScene> scene_;
    std::atomic<uint64_t> scene_version_{0}, kept_version_{0};
    std::atomic<uint64_t> revision_{1};

    mutable std::mutex mutex_;  ///< Guards all members below, and the status of runs.
    std::condition_variable wake_;
    std::string load_error_;
    std::deque<std::function<void()>> commands_, questions_;
    std::vector<std::shared_ptr<Run>> runs_;
    std::vector<KeptRun> kept_;
    SnapshotBudget budget_;
    int last_id_ = 0;
    bool must_load_ = true, is_loading_ = false;
    bool is_closed_ = false;  ///< No run is started or continued.
    bool is_ended_ = false;

    std::atomic<bool> turn_over_{false};  ///< The current turn ends after its pass.
    std::atomic<bool> drop_{false};       ///< The current pass is to be discarded.
    std::atomic<bool> has_questions_{false};
    int turn_of_ = 0;  ///< Id of the run whose turn it is; 0: none.
    uint64_t turns_ = 0;
    /// Writes files, and reads runs. Outlives the threads.
    Workers writer_{1, Workers::AtEnd::FinishAll};
    std::thread thread_, loader_;
};

}  // namespace etendue
