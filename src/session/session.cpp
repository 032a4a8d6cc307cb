#include "session/session.h"

#include <time.h>

#include <algorithm>
#include <future>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "film/thread_arena.h"
#include "render/method_choice.h"
#include "render/render_report.h"
#include "render/render_request.h"
#include "render/warnings.h"
#include "session/run.h"
#include "system/failure.h"
#include "system/memory_limit.h"

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

int fitting_depth(const Scene& scene, int depth) {
    while (!technique_images_fit(scene, depth)) --depth;
    return depth;
}

/// The statistics of a run that is looked at.
nlohmann::json report_of(const RenderTotals& totals, const Scene& scene, const RunStatus& run) {
    nlohmann::json j = statistics(*totals.film, totals.stats, totals.seconds, run.error);
    j["scene"] = scene.file();
    j["integrator"] = run.request.integrator;
    j["estimator"] = to_string(run.estimator);
    j["seed"] = run.request.seed;
    j["stopped_by"] = "studio";
    for (const auto& [name, value] : run.figures) j[name] = value;
    return j;
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

IntervalKind interval_kind(Estimator estimator, SamplerKind sampler, bool has_groups, int seeds) {
    if (has_groups || seeds > 1) return IntervalKind::None;
    if (estimator != Estimator::Unbiased) return IntervalKind::NoiseOnly;
    return sampler == SamplerKind::Sobol ? IntervalKind::Upper : IntervalKind::Confidence;
}

Estimator estimator_named(const std::string& name) {
    for (const Estimator e : {Estimator::Unbiased, Estimator::Consistent, Estimator::Biased})
        if (name == to_string(e)) return e;
    throw std::runtime_error(fmt::format("\"{}\" is no kind of estimator", name));
}

Session::Session(Load load, int threads, RunKeeping keeping)
    : load_(std::move(load)), threads_(threads),
      folder_(keeping.folder.empty() ? std::nullopt : std::optional<RunFolder>(keeping.folder)),
      pace_(WritingPace::of_checkpoints(keeping.every)) {
    thread_ = std::thread([this] { work(); });
    try {
        loader_ = std::thread([this] { load_scenes(); });
    } catch (...) {
        end();
        throw;
    }
}

Session::~Session() {
    end();
}

void Session::end() {
    close(true);
    post([this] { is_ended_ = true; });
    thread_.join();
    if (loader_.joinable()) loader_.join();
}

void Session::post(std::function<void()> command) {
    {
        const std::lock_guard lock(mutex_);
        commands_.push_back(std::move(command));
        turn_over_ = true;
    }
    wake_.notify_all();
}

void Session::post(const std::shared_ptr<Run>& run, std::function<void(Run&)> work) {
    post([this, run, work = std::move(work)] { guard(*run, [&] { work(*run); }); });
}

template <class Work>
void Session::guard(Run& run, const Work& work) noexcept {
    try {
        work();
    } catch (...) {
        finish_turn(run, RunState::Failed, caught());
    }
}

// -- The thread that loads.

void Session::load_scenes() {
    while (true) {
        {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, [&] { return must_load_ || is_closed_; });
            if (is_closed_) return;
            must_load_ = false;
            is_loading_ = true;
        }
        load_scene();
        const std::lock_guard lock(mutex_);
        is_loading_ = false;
    }
}

void Session::load_scene() {
    std::string error = failure_of([&] {
        renew_memory_limit();
        auto scene = std::make_shared<const LoadedScene>(load_());
        const std::lock_guard lock(mutex_);
        load_error_.clear();
        for (const auto& run : runs_) request_stop(run);
        scene_.store(std::move(scene));
        ++scene_version_;
    });
    if (!error.empty()) {
        const std::lock_guard lock(mutex_);
        load_error_.swap(error);
    }
    look_into_folder();
    changed();
}

// -- The session's thread.

void Session::work() {
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

void Session::execute_commands() {
    while (true) {
        std::function<void()> command;
        {
            const std::lock_guard lock(mutex_);
            if (commands_.empty()) return;
            command = std::move(commands_.front());
            commands_.pop_front();
        }
        try {
            command();
        } catch (...) {
            // The work of runs is guarded. What is left are answers, such as one for which there is no memory.
        }
        changed();
    }
}

void Session::ask(std::function<void()> question) {
    {
        const std::lock_guard lock(mutex_);
        questions_.push_back(std::move(question));
        has_questions_ = true;
    }
    post([this] { answer_questions(); });
}

void Session::answer_questions() noexcept {
    while (has_questions_.load(std::memory_order_relaxed)) {
        std::function<void()> question;
        {
            const std::lock_guard lock(mutex_);
            if (questions_.empty()) return;
            question = std::move(questions_.front());
            questions_.pop_front();
            has_questions_ = !questions_.empty();
        }
        try {
            question();
        } catch (...) {
            // An answer for which there is no memory.
        }
    }
}

RenderSettings Session::settings_of_run(RenderSettings settings, int seeds) {
    settings.meanwhile = [this] { answer_questions(); };
    settings.keeps_largest = settings.keeps_generations = seeds == 1;
    return settings;
}

std::shared_ptr<Session::Run> Session::next_run() const {
    std::shared_ptr<Run> next;
    for (const auto& run : runs_)
        if (run->status.state == RunState::Rendering && (!next || run->last_turn < next->last_turn))
            next = run;
    return next;
}

void Session::make_renderer(Run& run) {
    run.renderer.reset();
    run.is_counted = false;
    run.error = {};
    run.settings.seed = run.status.request.seed + uint64_t(run.seeds.count());
    std::unique_ptr<Integrator> integrator = std::move(run.integrator);
    if (is_chosen_by_pilots(run.settings.integrator)) integrator = chosen_method(run);
    if (!integrator) integrator = make_integrator(run.settings.integrator);
    RenderSettings own = run.settings;
    // The pilots of a series are part of the time of its first seed.
    if (run.seeds.count() > 0) own.choice = nullptr;
    run.renderer = std::make_unique<Renderer>(run.scene(), own, std::move(integrator));
    {
        std::vector<std::string> warnings = memory_warnings(*run.renderer);
        const std::lock_guard lock(mutex_);
        run.status.warnings = std::move(warnings);
    }
    run.log = {};
    if (!folder_) return;
    run.conditions = conditions_of(*run.renderer, run.scene(), run.loaded->source, run.settings);
    // The seeds of a run have one pace together.
    if (run.next_file == Clock::time_point{}) wait_for_next_file(run, 0);
}

std::unique_ptr<Integrator> Session::chosen_method(Run& run) {
    {
        const std::lock_guard lock(mutex_);
        if (run.status.state != RunState::Rendering) throw PassDropped();
        run.is_choosing = true;
    }
    run.settings = with_chosen_method(run.scene(), run.settings, drop_);
    std::unique_ptr<Integrator> integrator = make_integrator(run.settings.integrator);
    const std::lock_guard lock(mutex_);
    run.is_choosing = false;
    RunStatus& s = run.status;
    s.request.integrator = run.settings.choice->chosen;
    s.choice = run.settings.choice;
    s.estimator = integrator->estimator();
    s.interval =
        interval_kind(s.estimator, run.settings.sampler, integrator->error_groups() > 0, s.seeds);
    return integrator;
}

void Session::take_turn(Run& run) {
    run.last_turn = ++turns_;
    const auto begin = Clock::now();
    guard(run, [&] {
        try {
            if (!run.renderer || run.is_counted) make_renderer(run);
        } catch (const PassDropped&) {
            return finish_turn(run, RunState::Rendering);  // It was stopped while pilots rendered.
        }
        const StopReason reason = run.renderer->run(
            run.settings,
            [&](const Progress& progress) {
                try {
                    after_pass(run, progress);
                } catch (const std::exception&) {
                    // The pass is made, though some of its figures may be missing.
                }
                const std::chrono::duration<double> elapsed = Clock::now() - begin;
                if (elapsed.count() > kTurn) turn_over_ = true;
            },
            turn_over_, drop_);
        const bool is_rendering =
            reason == StopReason::Interrupted || (run.has_seeds() && finish_seed(run));
        finish_turn(run, is_rendering ? RunState::Rendering : RunState::Finished);
    });
}

bool Session::finish_seed(Run& run) {
    const Renderer& renderer = *run.renderer;
    const std::vector<Rgb> image = renderer.film().image();
    SeedSeries::Image luminances;
    luminances.reserve(image.size());
    for (const Rgb c : image) luminances.push_back(luminance(c));
    auto series = std::make_shared<SeedSeries>(*run.series.load());
    series->add(std::move(luminances), renderer.seconds(), renderer.integrator().figures());
    auto figures = series->figures;
    const auto count = int(series->luminance.size());
    run.seeds.add(image, renderer.film().passes());
    // Nothing fails from here on, so that an image is neither lost nor counted twice.
    run.is_counted = true;
    run.series.store(std::move(series));
    bool is_last = false;
    {
        const std::lock_guard lock(mutex_);
        RunStatus& s = run.status;
        s.finished_seeds = count;
        s.figures.swap(figures);
        is_last = count >= s.seeds;
    }
    // The last one is shown and kept at the end of the turn.
    if (!is_last) {
        show(run);
        if (Clock::now() >= run.next_file) keep(run);
    }
    return !is_last;
}

void Session::finish_turn(Run& run, RunState state, std::string message) noexcept {
    // The last image of a run is shown whatever the budget, since no other follows.
    if (state != RunState::Rendering) show(run);
    {
        const std::lock_guard lock(mutex_);
        if (turn_of_ == run.status.id) turn_of_ = 0;
        if (state != RunState::Rendering) run.status.state = state;
        run.status.message.swap(message);
    }
    if (state != RunState::Rendering) keep(run);
    changed();
}

void Session::request_stop(const std::shared_ptr<Run>& run) {
    if (run->status.state != RunState::Rendering) return;
    commands_.push_back([this, run] { finish_stop(*run); });
    run->status.state = RunState::Stopping;
    changed();
    if (run->is_choosing && turn_of_ == run->status.id) drop_ = true;
    turn_over_ = true;
    wake_.notify_all();
}

void Session::finish_stop(Run& run) {
    show(run);
    {
        const std::lock_guard lock(mutex_);
        if (run.status.state != RunState::Stopping) return;
        run.status.state = RunState::Stopped;
        run.status.message.clear();
    }
    keep(run);
}

void Session::after_pass(Run& run, const Progress& p) {
    const ErrorEstimate error = run.error.update(p);
    bool shows = false;
    {
        const std::lock_guard lock(mutex_);
        RunStatus& s = run.status;
        s.passes = run.passes();
        const double earlier = run.series.load()->total_seconds();
        run.pass_seconds = earlier + p.seconds - s.seconds;
        s.seconds = earlier + p.seconds;
        s.rays_per_second = p.rays_per_second;
        s.fraction = p.fraction;
        shows = (run.is_wanted || run.wants_techniques) && budget_.allows(Clock::now());
        if (run.has_seeds()) {
            if (s.fraction) *s.fraction = (s.finished_seeds + *s.fraction) / s.seeds;
        } else {
            s.error = error;
            s.figures = run.renderer->integrator().figures();
            constexpr double kSpacing = 1.05;
            if (error.valid &&
                (s.history.empty() || p.seconds > kSpacing * s.history.back().seconds))
                s.history.push_back({p.passes, p.seconds, error});
        }
    }
    run.log.add(p.seconds, p.renderer.stats().pairs);
    // The first picture does not wait. Long passes are shown unasked, so that saving need not wait for the next one.
    constexpr double kLong = 0.5;
    const bool is_long =
        run.pass_seconds > kLong && run.shown_seconds < SnapshotBudget::kShare * run.pass_seconds;
    if (shows || is_long || run.passes() == 1) show(run);
    if (p.fraction.value_or(0) < 1 && Clock::now() >= run.next_file) keep(run);
    changed();
}

void Session::fill(Run& run, Snapshot& snapshot) {
    const Film* film = run.film();
    snapshot.run = run.status.id;
    snapshot.width = run.scene().film().crop_width;
    snapshot.height = run.scene().film().crop_height;
    if (run.seeds.count() > 0)
        run.seeds.fill(film, snapshot);
    else
        fill_snapshot(*film, snapshot);
    snapshot.report = nullptr;
    if (!run.renderer && !run.totals) return;
    // Lists, such as the times of passes, are not stored in images.
    auto report = std::make_shared<nlohmann::json>(
        run.totals
            ? report_of(*run.totals, run.scene(), run.status)
            : to_json(*run.renderer, run.scene(), run.settings, "studio", {}, &run.status.error));
    if (run.has_seeds()) {
        (*report)["spp"] = snapshot.passes;
        (*report)["seed"] = run.status.request.seed;
        (*report)["seeds"] = run.seeds.count() + (film ? 1 : 0);
    }
    snapshot.report = std::move(report);
}

void Session::show(Run& run) noexcept {
    if (run.passes() == 0) return;
    const double before = process_cpu_seconds();
    publish(run);
    run.shown_seconds = process_cpu_seconds() - before;
    const std::lock_guard lock(mutex_);
    budget_.taken(Clock::now(), run.shown_seconds);
}

void Session::publish(Run& run) noexcept {
    const uint64_t passes = run.passes();
    if (passes == 0) return;
    run.is_wanted = false;
    try {
        ThreadArena arena(threads_);
        if (const auto last = run.snapshot.load();
            !last || last->passes != passes || run.shown_seeds != run.seeds.count()) {
            const std::shared_ptr<Snapshot> snapshot = run.pool.take();
            arena.execute([&] { fill(run, *snapshot); });
            run.snapshot.store(snapshot);
            run.shown_seeds = run.seeds.count();
        }
        {
            const std::lock_guard lock(mutex_);
            run.status.snapshot_passes = passes;
        }
        if (run.technique_images() && run.wants_techniques.exchange(false)) {
            const FilmGeometry& g = run.scene().film();
            run.techniques.store(std::make_shared<const TechniqueSnapshot>(TechniqueSnapshot{
                passes, g.crop_width, g.crop_height, run.technique_images()->images()}));
        }
    } catch (const std::exception&) {
        // No memory: the earlier picture stays, and the run goes on.
    }
}

// -- From any thread.

std::string Session::load_error() const {
    const std::lock_guard lock(mutex_);
    return load_error_;
}

bool Session::is_loading() const {
    const std::lock_guard lock(mutex_);
    return is_loading_;
}

void Session::reload() {
    {
        const std::lock_guard lock(mutex_);
        must_load_ = true;
    }
    wake_.notify_all();
}

std::shared_ptr<Session::Run> Session::find(int id) const {
    for (const auto& run : runs_)
        if (run->status.id == id) return run;
    throw std::runtime_error(fmt::format("there is no run {}", id));
}

std::shared_ptr<Session::Run> Session::found(int id) const {
    const std::lock_guard lock(mutex_);
    return find(id);
}

int Session::start(const RunRequest& request) {
    const std::shared_ptr<const LoadedScene> loaded = scene_.load();
    if (!loaded) throw std::runtime_error("the scene is not loaded yet");
    renew_memory_limit();
    const Scene& scene = loaded->scene;
    auto run = std::make_shared<Run>();
    run->loaded = loaded;
    RunStatus& s = run->status;
    s.request = request;
    s.request.threads = threads_;
    s.request.technique_depth =
        request.seeds > 1 ? 0 : fitting_depth(scene, request.technique_depth);
    RenderSettings& settings = run->settings;
    settings = settings_of_run(settings_of(s.request, scene), request.seeds);
    if (!request.user_paths.empty()) settings.integrator.params["user_paths"] = request.user_paths;
    s.request.integrator = settings.integrator.to_string();
    run->integrator = make_integrator(settings.integrator);
    s.seeds = request.seeds;
    s.estimator = run->integrator->estimator();
    s.interval = interval_kind(s.estimator, settings.sampler, run->integrator->error_groups() > 0,
                               request.seeds);
    {
        const std::lock_guard lock(mutex_);
        if (is_closed_) throw std::runtime_error("the program is about to end");
        // Otherwise another scene was loaded in the meantime.
        if (scene_.load() == loaded) {
            s.id = last_id_ + 1;
            runs_.push_back(run);
            ++last_id_;
        }
    }
    if (s.id == 0) return start(request);
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
        if (is_closed_) throw std::runtime_error("the program is about to end");
        auto found = find(id);
        if (found->has_seeds() && (limits.spp || limits.seconds || limits.error))
            throw std::runtime_error(fmt::format(
                "run {} has several seeds and goes on with more of them; it takes no limit", id));
        if (const std::string& why = found->status.why_look_only; !why.empty())
            throw std::runtime_error(fmt::format("run {} can only be looked at: {}", id, why));
        return found;
    }();
    post(run, [this, limits](Run& r) {
        const std::lock_guard lock(mutex_);
        if (is_closed_) return;
        RunStatus& s = r.status;
        // What failed in its first pass begins anew.
        if (s.state == RunState::Failed && r.renderer && r.renderer->film().passes() == 0)
            r.renderer.reset();
        if (r.has_seeds()) {
            // A run with several seeds continues with more of them.
            if (s.state == RunState::Finished) s.seeds *= 2;
        } else {
            if (limits.spp || limits.seconds || limits.error)
                static_cast<RenderLimits&>(r.settings) = limits;
            static_cast<RenderLimits&>(s.request) = r.settings;
        }
        s.message.clear();
        s.state = RunState::Rendering;
    });
}

void Session::remove(int id) {
    discard(id);
    post([this, id] {
        {
            const std::lock_guard lock(mutex_);
            std::erase_if(runs_, [&](const auto& run) { return run->status.id == id; });
        }
        look_into_folder();
    });
}

void Session::write(const std::shared_ptr<const Snapshot>& snapshot, const std::string& file,
                    bool replaces, const std::function<void(const Saved&)>& done) {
    const bool is_taken = writer_.post([snapshot, file, replaces, done] {
        std::string error = failure_of([&] { etendue::save(*snapshot, file, replaces); });
        const uint64_t passes = error.empty() ? snapshot->passes : 0;
        done({std::move(error), passes});
    });
    if (!is_taken) done({"too many images wait to be saved; try again", 0});
}

void Session::save(int id, const std::string& file, bool replaces,
                   std::function<void(const Saved&)> done) {
    std::shared_ptr<Run> run;
    std::shared_ptr<const Snapshot> latest;
    {
        const std::lock_guard lock(mutex_);
        run = find(id);
        latest = run->snapshot.load();
        if (latest && latest->passes != run->status.passes) latest = nullptr;
    }
    if (latest) return write(latest, file, replaces, done);
    post([this, run, file, replaces, done = std::move(done)] {
        show(*run);
        // Without memory for a newer image an earlier one is better than none.
        if (const auto shown = run->snapshot.load()) return write(shown, file, replaces, done);
        done({run->passes() == 0 ? "no pass is finished yet" : "not enough memory", 0});
    });
}

void Session::stop_all(bool drop) {
    const std::lock_guard lock(mutex_);
    for (const auto& run : runs_) request_stop(run);
    if (drop && turn_of_ != 0) drop_ = true;
}

void Session::close(bool drop) {
    {
        const std::lock_guard lock(mutex_);
        is_closed_ = true;
    }
    wake_.notify_all();
    stop_all(drop);
}

void Session::settle() {
    std::promise<void> reached;
    post([&] { reached.set_value(); });
    reached.get_future().wait();
    std::vector<std::shared_future<void>> files;
    {
        const std::lock_guard lock(mutex_);
        for (const auto& run : runs_)
            if (run->file_written.valid()) files.push_back(run->file_written);
    }
    for (const auto& file : files) file.wait();
}

RunStatus Session::status_of(const Run& run) const {
    RunStatus status = run.status;
    status.is_of_this_scene = run.loaded == scene_.load();
    return status;
}

RunStatus Session::status(int id) const {
    const std::lock_guard lock(mutex_);
    return status_of(*find(id));
}

std::vector<RunStatus> Session::runs() const {
    const std::lock_guard lock(mutex_);
    std::vector<RunStatus> all;
    for (const auto& run : runs_) all.push_back(status_of(*run));
    return all;
}

std::shared_ptr<const Scene> Session::scene_of(int id) const {
    const std::lock_guard lock(mutex_);
    const std::shared_ptr<const LoadedScene> loaded = find(id)->loaded;
    return {loaded, &loaded->scene};
}

void Session::show_if_idle(const std::shared_ptr<Run>& run) {
    const RunState state = run->status.state;
    if (run->status.passes == 0 || state == RunState::Rendering || state == RunState::Stopping)
        return;
    commands_.push_back([this, run] { show(*run); });
    turn_over_ = true;
    wake_.notify_all();
}

std::shared_ptr<const Snapshot> Session::snapshot(int id) {
    const std::lock_guard lock(mutex_);
    const std::shared_ptr<Run> run = find(id);
    run->is_wanted = true;
    const auto shown = run->snapshot.load();
    if (!shown || shown->passes != run->status.passes) show_if_idle(run);
    return shown;
}

std::shared_ptr<const TechniqueSnapshot> Session::techniques(int id) {
    const std::lock_guard lock(mutex_);
    const std::shared_ptr<Run> run = find(id);
    if (run->status.request.technique_depth == 0) return nullptr;
    run->wants_techniques = true;
    const auto shown = run->techniques.load();
    if (!shown || shown->passes != run->status.passes) show_if_idle(run);
    return shown;
}

std::shared_ptr<const SeedSeries> Session::seed_series(int id) const {
    const std::lock_guard lock(mutex_);
    return find(id)->series.load();
}

void Session::ask_largest(int id, std::function<void(const LargestPasses&)> done) {
    const std::shared_ptr<Run> run = found(id);
    ask([run, done = std::move(done)] {
        done({run->renderer ? &run->renderer->film() : nullptr, run->opened});
    });
}

void Session::replay_last(int id, uint64_t pixel, size_t most_paths,
                          std::function<void(const Replay&, const std::string&)> done) {
    const std::shared_ptr<Run> run = found(id);
    ask([run, pixel, most_paths, done = std::move(done)] {
        Replay replay;
        const std::string error = failure_of([&] {
            if (run->totals) throw std::runtime_error("the run can only be looked at");
            if (!run->renderer) throw std::runtime_error("no pass is finished yet");
            replay = etendue::replay_last(*run->renderer, pixel, most_paths);
        });
        done(replay, error);
    });
}

void Session::ask_pass(int id, uint32_t pass,
                       std::function<void(const std::optional<PassOfRun>&)> done) {
    const std::shared_ptr<Run> run = found(id);
    ask([run, pass, done = std::move(done)] {
        if (!run->renderer) return done({});
        auto generation = run->renderer->generation_of(pass);
        if (!generation) return done({});
        done(PassOfRun{std::shared_ptr<const Scene>(run->loaded, &run->loaded->scene),
                       run->renderer->settings(), pass, std::move(generation)});
    });
}

void Session::spent(double cpu_seconds) {
    const std::lock_guard lock(mutex_);
    budget_.spent(cpu_seconds);
}

}  // namespace etendue
