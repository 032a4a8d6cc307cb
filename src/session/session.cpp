#include "session/session.h"

#include <time.h>

#include <algorithm>
#include <future>
#include <new>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <tbb/task_arena.h>

#include "image/image_io.h"
#include "render/defaults.h"

namespace etendue {
namespace {

using Clock = std::chrono::steady_clock;

/// Runs that are rendered at the same time take turns of this length, in seconds.
constexpr double kTurn = 2;

double process_cpu_seconds() {
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

IntervalKind interval_kind(const Integrator& integrator, SamplerKind sampler, int seeds) {
    if (integrator.error_groups() > 0 || seeds > 1) return IntervalKind::None;
    if (integrator.estimator() != Estimator::Unbiased) return IntervalKind::NoiseOnly;
    return sampler == SamplerKind::Sobol ? IntervalKind::Upper : IntervalKind::Confidence;
}

int fitting_depth(const Scene& scene, int depth) {
    const uint64_t pixels = scene.film().pixel_count();
    while (depth > 0 && TechniqueImages::memory_bytes(pixels, depth) > Session::kTechniqueBytes)
        --depth;
    return depth;
}

}  // namespace

const char* to_string(RunState state) {
    switch (state) {
    case RunState::Rendering: return "rendering";
    case RunState::Stopping: return "stopping";
    case RunState::Stopped: return "stopped";
    case RunState::Finished: return "finished";
    case RunState::Failed: return "failed";
    }
    return "";
}

const char* to_string(IntervalKind kind) {
    switch (kind) {
    case IntervalKind::Confidence: return "confidence";
    case IntervalKind::Upper: return "upper";
    case IntervalKind::NoiseOnly: return "noise only";
    case IntervalKind::None: return "none";
    }
    return "";
}

struct Session::Run {
    RunStatus status;  ///< Guarded by the session's mutex.
    SharedSlot<const Snapshot> snapshot;
    SharedSlot<const TechniqueSnapshot> techniques;
    SharedSlot<const SeedSeries> series{std::make_shared<const SeedSeries>()};
    std::atomic<bool> is_wanted{true}, wants_techniques{false};

    bool has_seeds() const { return status.seeds > 1; }

    // Of the session's thread.
    std::shared_ptr<const Scene> scene;
    RenderSettings settings;
    std::unique_ptr<Integrator> integrator;  ///< Until the renderer is made.
    std::unique_ptr<Renderer> renderer;
    PassLog log;
    SnapshotPool pool;
    std::vector<Rgb> sum_of_seeds;
    uint64_t passes_of_seeds = 0;
    uint64_t last_turn = 0;
};

Session::Session(Load load, int threads) : load_(std::move(load)), threads_(threads) {
    thread_ = std::thread([this] { work(); });
}

Session::~Session() {
    stop_all(true);
    post([this] { is_ended_ = true; });
    thread_.join();
}

void Session::post(std::function<void()> command) {
    {
        const std::lock_guard lock(mutex_);
        commands_.push_back(std::move(command));
        turn_over_ = true;
    }
    wake_.notify_all();
}

// -- The session's thread.

void Session::work() {
    load_scene();
    while (true) {
        execute_commands();
        if (is_ended_) return;
        std::shared_ptr<Run> run;
        {
            std::unique_lock lock(mutex_);
            run = next_run();
            if (!run) wake_.wait(lock, [&] { return !commands_.empty(); });
            if (!commands_.empty()) continue;
            turn_over_ = drop_ = false;
            turn_of_ = run->status.id;
        }
        take_turn(*run);
    }
}

void Session::load_scene() {
    std::string error;
    try {
        auto scene = std::make_shared<const Scene>(load_());
        const std::lock_guard lock(mutex_);
        load_error_.clear();
        for (const auto& run : runs_) {
            run->status.is_of_this_scene = false;
            request_stop(run);
        }
        scene_.store(std::move(scene));
        ++scene_version_;
    } catch (const std::bad_alloc&) {
        error = "not enough memory";
    } catch (const std::exception& e) {
        error = e.what();
    }
    if (!error.empty()) {
        const std::lock_guard lock(mutex_);
        load_error_ = error;
    }
    changed();
}

void Session::execute_commands() {
    while (true) {
        std::function<void()> command;
        {
            const std::lock_guard lock(mutex_);
            if (commands_.empty()) return;
            command = std::move(commands_.front());
            commands_.pop_front();
        }
        command();
        changed();
    }
}

std::shared_ptr<Session::Run> Session::next_run() const {
    std::shared_ptr<Run> next;
    for (const auto& run : runs_)
        if (run->status.state == RunState::Rendering && (!next || run->last_turn < next->last_turn))
            next = run;
    return next;
}

void Session::take_turn(Run& run) {
    run.last_turn = ++turns_;
    const auto begin = Clock::now();
    try {
        if (run.integrator) {
            run.renderer.reset();
            run.renderer =
                std::make_unique<Renderer>(*run.scene, run.settings, std::move(run.integrator));
            run.log = {};
        }
        const StopReason reason = run.renderer->run(
            run.settings,
            [&](const Progress& progress) {
                after_pass(run, progress);
                const std::chrono::duration<double> elapsed = Clock::now() - begin;
                if (elapsed.count() > kTurn) turn_over_ = true;
            },
            turn_over_, drop_);
        const bool is_rendering =
            reason == StopReason::Interrupted || (run.has_seeds() && finish_seed(run));
        finish_turn(run, is_rendering ? RunState::Rendering : RunState::Finished);
    } catch (const std::bad_alloc&) {
        finish_turn(run, RunState::Failed, "not enough memory");
    } catch (const std::exception& e) {
        finish_turn(run, RunState::Failed, e.what());
    }
}

bool Session::finish_seed(Run& run) {
    const Renderer& renderer = *run.renderer;
    const std::vector<Rgb> image = renderer.film().image();
    SeedSeries::Image luminances;
    run.sum_of_seeds.resize(image.size());
    for (size_t i = 0; i < image.size(); ++i) {
        luminances.push_back(luminance(image[i]));
        run.sum_of_seeds[i] += image[i];
    }
    run.passes_of_seeds += renderer.film().passes();
    auto series = std::make_shared<SeedSeries>(*run.series.load());
    series->add(std::move(luminances), renderer.seconds(), renderer.integrator().figures());

    const std::shared_ptr<Snapshot> snapshot = run.pool.take();
    const auto count = int(series->luminance.size());
    *snapshot = {.run = run.status.id,
                 .passes = run.passes_of_seeds,
                 .width = run.scene->film().crop_width,
                 .height = run.scene->film().crop_height,
                 .mean = run.sum_of_seeds,
                 .variance = std::vector<Rgb>(image.size())};
    for (Rgb& c : snapshot->mean) c *= 1 / float(count);
    run.snapshot.store(snapshot);

    const std::lock_guard lock(mutex_);
    RunStatus& s = run.status;
    s.finished_seeds = count;
    s.snapshot_passes = run.passes_of_seeds;
    s.figures = series->figures;
    run.series.store(std::move(series));
    if (count >= s.seeds) return false;
    ++run.settings.seed;
    run.integrator = make_integrator(run.settings.integrator);
    return true;
}

void Session::finish_turn(Run& run, RunState state, const std::string& message) {
    // The last image of a run is shown whatever the budget, since no other follows.
    if (state != RunState::Rendering && run.renderer && run.renderer->film().passes() > 0)
        show(run);
    {
        const std::lock_guard lock(mutex_);
        turn_of_ = 0;
        if (state != RunState::Rendering) run.status.state = state;
        run.status.message = message;
    }
    changed();
}

void Session::request_stop(const std::shared_ptr<Run>& run) {
    if (run->status.state != RunState::Rendering) return;
    run->status.state = RunState::Stopping;
    commands_.push_back([this, run] { finish_stop(*run); });
    changed();
    turn_over_ = true;
    wake_.notify_all();
}

void Session::finish_stop(Run& run) {
    std::string message;
    try {
        if (run.renderer && run.renderer->film().passes() > 0) show(run);
    } catch (const std::bad_alloc&) {
        message = "not enough memory";
    }
    const std::lock_guard lock(mutex_);
    if (run.status.state != RunState::Stopping) return;
    run.status.state = message.empty() ? RunState::Stopped : RunState::Failed;
    run.status.message = message;
}

void Session::after_pass(Run& run, const Progress& p) {
    run.log.add(p.seconds, run.renderer->stats().pairs);
    bool shows = false;
    {
        const std::lock_guard lock(mutex_);
        RunStatus& s = run.status;
        s.passes = run.passes_of_seeds + p.passes;
        s.seconds = run.series.load()->total_seconds() + p.seconds;
        s.rays_per_second = p.rays_per_second;
        s.fraction = p.fraction;
        // What follows belongs to one seed.
        if (run.has_seeds()) {
            if (s.fraction) *s.fraction = (s.finished_seeds + *s.fraction) / s.seeds;
            return changed();
        }
        s.error = p.error;
        s.figures = run.renderer->integrator().figures();
        constexpr double kSpacing = 1.05;
        if (p.error.valid && (s.history.empty() || p.seconds > kSpacing * s.history.back().seconds))
            s.history.push_back({p.passes, p.seconds, p.error});
        shows = (run.is_wanted || run.wants_techniques) && budget_.allows(Clock::now());
    }
    // The first picture does not wait.
    if (shows || p.passes == 1) show(run);
    changed();
}

void Session::show(Run& run) {
    if (run.has_seeds()) return;
    const double before = process_cpu_seconds();
    tbb::task_arena arena(threads_ > 0 ? threads_ : tbb::task_arena::automatic);
    run.is_wanted = false;
    const uint64_t passes = run.renderer->film().passes();
    if (const auto last = run.snapshot.load(); !last || last->passes != passes) {
        const std::shared_ptr<Snapshot> snapshot = run.pool.take();
        snapshot->run = run.status.id;
        const bool has_groups = run.renderer->integrator().error_groups() > 0;
        arena.execute([&] { fill_snapshot(run.renderer->film(), has_groups, *snapshot); });
        run.snapshot.store(snapshot);
    }
    if (run.renderer->techniques() && run.wants_techniques.exchange(false))
        run.techniques.store(std::make_shared<const TechniqueSnapshot>(
            TechniqueSnapshot{passes, run.renderer->techniques()->images()}));
    const std::lock_guard lock(mutex_);
    run.status.snapshot_passes = passes;
    budget_.taken(Clock::now(), process_cpu_seconds() - before);
}

// -- From any thread.

std::string Session::load_error() const {
    const std::lock_guard lock(mutex_);
    return load_error_;
}

void Session::reload() {
    post([this] { load_scene(); });
}

std::shared_ptr<Session::Run> Session::find(int id) const {
    for (const auto& run : runs_)
        if (run->status.id == id) return run;
    throw std::runtime_error(fmt::format("there is no run {}", id));
}

int Session::start(const RunRequest& request) {
    const std::shared_ptr<const Scene> scene = this->scene();
    if (!scene) throw std::runtime_error("the scene is not loaded yet");
    auto run = std::make_shared<Run>();
    run->scene = scene;
    RenderSettings& settings = run->settings;
    static_cast<RenderLimits&>(settings) = request.limits;
    settings.integrator = choose_integrator(*scene, request.integrator);
    if (!request.user_paths.empty()) settings.integrator.params["user_paths"] = request.user_paths;
    settings.sampler = request.sampler;
    settings.seed = request.seed;
    settings.threads = threads_;
    settings.technique_depth =
        request.seeds > 1 ? 0 : fitting_depth(*scene, request.technique_depth);
    run->integrator = make_integrator(settings.integrator);
    RunStatus& s = run->status;
    s.integrator = settings.integrator.to_string();
    s.sampler = settings.sampler;
    s.seed = settings.seed;
    s.limits = settings;
    s.technique_depth = settings.technique_depth;
    s.seeds = request.seeds;
    s.estimator = run->integrator->estimator();
    s.interval = interval_kind(*run->integrator, settings.sampler, request.seeds);
    {
        const std::lock_guard lock(mutex_);
        s.id = ++last_id_;
        runs_.push_back(run);
    }
    post([] {});
    return s.id;
}

void Session::stop(int id) {
    const std::lock_guard lock(mutex_);
    stop(find(id));
}

void Session::stop(const std::shared_ptr<Run>& run) {
    if (run->status.state == RunState::Rendering) return request_stop(run);
    commands_.push_back([this, run] {
        const std::lock_guard lock(mutex_);
        request_stop(run);
    });
    turn_over_ = true;
    wake_.notify_all();
}

void Session::discard(int id) {
    const std::lock_guard lock(mutex_);
    stop(find(id));
    if (turn_of_ == id) drop_ = true;
}

void Session::resume(int id, const RenderLimits& limits) {
    const std::shared_ptr<Run> run = [&] {
        const std::lock_guard lock(mutex_);
        return find(id);
    }();
    post([this, run, limits] {
        // A run with several seeds continues with more of them.
        if (run->has_seeds()) {
            const std::lock_guard lock(mutex_);
            RunStatus& s = run->status;
            if (s.state == RunState::Finished) {
                s.seeds *= 2;
                ++run->settings.seed;
                run->integrator = make_integrator(run->settings.integrator);
            }
            if (s.state != RunState::Failed) s.state = RunState::Rendering;
            return;
        }
        if (limits.spp || limits.seconds || limits.error)
            static_cast<RenderLimits&>(run->settings) = limits;
        const std::lock_guard lock(mutex_);
        run->status.limits = run->settings;
        if (run->status.state != RunState::Failed) run->status.state = RunState::Rendering;
    });
}

void Session::remove(int id) {
    discard(id);
    post([this, id] {
        const std::lock_guard lock(mutex_);
        std::erase_if(runs_, [&](const auto& run) { return run->status.id == id; });
    });
}

void Session::save(int id, const std::string& file, std::function<void(std::string)> done) {
    const std::shared_ptr<Run> run = [&] {
        const std::lock_guard lock(mutex_);
        return find(id);
    }();
    post([this, run, file, done = std::move(done)] {
        if (!run->renderer || run->renderer->film().passes() == 0)
            return done("no pass is finished yet");
        try {
            const nlohmann::json report =
                to_json(*run->renderer, *run->scene, run->settings, "studio", run->log);
            write_image(file, image_with_layers(*run->renderer, *run->scene, run->settings.seed,
                                                threads_, {}, report));
            done({});
        } catch (const std::exception& e) {
            done(e.what());
        }
    });
}

void Session::stop_all(bool drop) {
    const std::lock_guard lock(mutex_);
    for (const auto& run : runs_) request_stop(run);
    if (drop && turn_of_ != 0) drop_ = true;
}

void Session::settle() {
    std::promise<void> reached;
    post([&] { reached.set_value(); });
    reached.get_future().wait();
}

RunStatus Session::status(int id) const {
    const std::lock_guard lock(mutex_);
    return find(id)->status;
}

std::vector<RunStatus> Session::runs() const {
    const std::lock_guard lock(mutex_);
    std::vector<RunStatus> all;
    for (const auto& run : runs_) all.push_back(run->status);
    return all;
}

std::shared_ptr<const Snapshot> Session::snapshot(int id) {
    const std::lock_guard lock(mutex_);
    const std::shared_ptr<Run> run = find(id);
    run->is_wanted = true;
    return run->snapshot.load();
}

std::shared_ptr<const TechniqueSnapshot> Session::techniques(int id) {
    std::shared_ptr<Run> run;
    bool is_idle = false;
    {
        const std::lock_guard lock(mutex_);
        run = find(id);
        run->wants_techniques = true;
        is_idle = run->status.state != RunState::Rendering;
    }
    const auto shown = run->techniques.load();
    // No pass will follow that would show them.
    if (is_idle && (!shown || shown->passes != run->status.passes))
        post([this, run] {
            if (run->renderer && run->renderer->film().passes() > 0) show(*run);
        });
    return shown;
}

std::shared_ptr<const SeedSeries> Session::seed_series(int id) const {
    const std::lock_guard lock(mutex_);
    return find(id)->series.load();
}

void Session::replay_last(int id, uint64_t pixel, size_t most_paths,
                          std::function<void(const Replay&, const std::string&)> done) {
    const std::shared_ptr<Run> run = [&] {
        const std::lock_guard lock(mutex_);
        return find(id);
    }();
    post([run, pixel, most_paths, done = std::move(done)] {
        if (!run->renderer) return done({}, "no pass is finished yet");
        try {
            done(etendue::replay_last(*run->renderer, pixel, most_paths), {});
        } catch (const std::exception& e) {
            done({}, e.what());
        }
    });
}

void Session::spent(double cpu_seconds) {
    const std::lock_guard lock(mutex_);
    budget_.spent(cpu_seconds);
}

}  // namespace etendue
