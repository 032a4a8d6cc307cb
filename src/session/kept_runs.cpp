// Runs of a session that are kept in a folder.

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "film/thread_arena.h"
#include "render/method_choice.h"
#include "session/file_version.h"
#include "session/run.h"
#include "session/run_record.h"
#include "system/failure.h"

namespace etendue {
namespace {

constexpr const char* kTooMany = "too many files wait to be written; try again";

/// What was asked for, without limits.
RenderRequest request_of(const CheckpointHeader& header) {
    RenderRequest r;
    r.integrator = header.integrator;
    r.sampler = sampler_named(header.condition("sampler"), "its sampler");
    r.filter_mode = filter_mode_named(header.condition("filter mode"), "its filter mode");
    r.seed = header.ranges.front().seed;  // of the last of several
    r.first_pass = header.ranges.front().first;
    r.technique_depth = header.technique_depth;
    return r;
}

}  // namespace

void Session::Run::save_seeds(SectionWriter& to) const {
    begin_seeds(status.request.seed, is_counted, seeds, to);
    series.load()->save(to);
}

void Session::Run::load_seeds(SectionReader& from) {
    const uint64_t pixels = scene().film().pixel_count();
    auto loaded_series = std::make_shared<SeedSeries>();
    SavedSeeds saved = open_seeds(from, pixels, status.finished_seeds);
    loaded_series->load(from, pixels);
    from.finish();
    if (loaded_series->luminance.size() != size_t(status.finished_seeds))
        from.fail("the seeds of the run are damaged");
    from.close();
    status.request.seed = saved.first;
    is_counted = saved.is_counted;
    seeds = std::move(saved.mean);
    series.store(std::move(loaded_series));
}

// -- Writing, in the session's thread; files become durable in that of the writer.

void Session::wait_for_next_file(Run& run, double seconds) const {
    using Clock = std::chrono::steady_clock;
    const std::chrono::duration<double> wait(pace_.wait_after(seconds));
    run.next_file = Clock::now() + std::chrono::duration_cast<Clock::duration>(wait);
}

void Session::keep(Run& run) noexcept {
    if (!folder_ || !run.renderer || run.passes() == 0) return;
    const auto begin = std::chrono::steady_clock::now();
    try {
        write_state(run);
    } catch (...) {
        std::string problem = caught();
        const std::lock_guard lock(mutex_);
        run.status.file_problem.swap(problem);
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    wait_for_next_file(run, taken.count());
}

void Session::write_state(Run& run) {
    std::shared_future<void> earlier;
    {
        const std::lock_guard lock(mutex_);
        earlier = run.file_written;
    }
    if (earlier.valid()) earlier.wait();
    RunStatus status;
    std::string name, version;
    int file_seeds = 0;
    {
        const std::lock_guard lock(mutex_);
        status = run.status;
        file_seeds = run.file_seeds;
        name = run.own_file;
        version = run.own_version;
    }
    const uint64_t passes = run.passes();
    const int seeds = run.seeds.count();
    if (status.file_passes == passes && file_seeds == seeds && status.file_problem.empty()) return;
    // What another program has written there in the meantime stays.
    const bool is_new = name.empty() || file_version(folder_->path_of(name)) != version;
    if (is_new) name = folder_->take_name(run.scene().file(), run.settings.integrator.name);
    try {
        const std::string path = folder_->path_of(name);
        const std::shared_ptr<SectionWriter> file = written_checkpoint(
            path, *run.renderer, run.scene(), run.conditions, run.settings, run.log);
        save_record(status, *file);
        if (run.has_seeds()) run.save_seeds(*file);
        const auto written = std::make_shared<std::promise<void>>();
        {
            const std::lock_guard lock(mutex_);
            run.file_written = written->get_future().share();
        }
        const auto finish = [this, kept = run.shared_from_this(), file, written, name, path, passes,
                             seeds, is_new] {
            std::string problem, version_of_file;
            try {
                file->commit();
                version_of_file = file_version(path);
            } catch (...) {
                problem = caught();
                if (is_new) folder_->give_back(name);
            }
            {
                const std::lock_guard lock(mutex_);
                RunStatus& s = kept->status;
                if (problem.empty()) {
                    if (s.file != name) ++kept_version_;
                    s.file = kept->own_file = name;
                    s.file_passes = passes;
                    kept->file_seeds = seeds;
                    kept->own_version.swap(version_of_file);
                }
                s.file_problem.swap(problem);
            }
            changed();
            written->set_value();
        };
        // Where many files wait, as at the end of a program with many runs, this thread does it.
        if (!writer_.post(finish)) finish();
    } catch (...) {
        if (is_new) folder_->give_back(name);
        throw;
    }
}

// -- Reading, in the thread of the writer.

bool Session::look_into_folder() noexcept try {
    if (!folder_) return true;
    return writer_.post([this] {
        const std::shared_ptr<const LoadedScene> loaded = scene_.load();
        if (!loaded) return;
        std::vector<KeptRun> found = folder_->list(*loaded);
        {
            const std::lock_guard lock(mutex_);
            kept_.swap(found);
        }
        ++kept_version_;
        changed();
    });
} catch (const std::exception&) {
    return false;
}

void Session::list_kept() {
    if (!look_into_folder()) throw std::runtime_error(kTooMany);
}

std::vector<KeptRun> Session::kept() const {
    const std::lock_guard lock(mutex_);
    std::vector<KeptRun> closed = kept_;
    std::erase_if(closed, [&](const KeptRun& k) {
        return std::any_of(runs_.begin(), runs_.end(),
                           [&](const auto& run) { return run->status.file == k.file; });
    });
    return closed;
}

std::shared_ptr<Session::Run> Session::load_run(const std::string& name) {
    const std::shared_ptr<const LoadedScene> loaded = scene_.load();
    if (!loaded) throw std::runtime_error("the scene is not loaded yet");
    CheckpointFile file(folder_->path_of(name));
    const CheckpointHeader& header = file.header();
    if (!is_of(header, loaded->scene, loaded->source))
        throw std::runtime_error(
            fmt::format("{} is not of this scene, or not of this part of it", file.name()));
    auto run = std::make_shared<Run>();
    run->loaded = loaded;
    RunStatus& s = run->status;
    s.request = request_of(header);
    s.request.threads = threads_;
    s.estimator = estimator_named(header.estimator);
    if (!header.choice.empty())
        s.choice = std::make_shared<const MethodChoice>(MethodChoice::from_json(header.choice));
    s.state = RunState::Stopped;
    const bool is_own = load_record(file.sections(), s);
    const bool fits = technique_images_fit(loaded->scene, header.technique_depth);
    ThreadArena arena(threads_);
    try {
        if (!fits)
            throw std::runtime_error(
                fmt::format("its technique images need more than {} MiB", kTechniqueBytes >> 20));
        run->settings = settings_of_run(
            settings_of(s.request, IntegratorSpec::parse(header.integrator)), s.seeds);
        run->settings.choice = s.choice;
        auto renderer = std::make_unique<Renderer>(loaded->scene, run->settings);
        run->conditions = conditions_of(*renderer, loaded->scene, loaded->source, run->settings);
        file.resume(*renderer, run->conditions, run->log);
        if (run->settings.keeps_largest) run->opened = SumsBefore::of(renderer->film());
        run->renderer = std::move(renderer);
    } catch (...) {
        s.why_look_only = caught();
        if (!fits) s.request.technique_depth = 0;
        arena.execute(
            [&] { run->totals = std::make_unique<const RenderTotals>(file.totals(fits)); });
    }
    const RenderStats& stats = run->totals ? run->totals->stats : run->renderer->stats();
    s.seconds = run->totals ? run->totals->seconds : run->renderer->seconds();
    s.rays_per_second = s.seconds > 0 ? double(stats.rays()) / s.seconds : 0;
    const Film& film = run->totals ? *run->totals->film : run->renderer->film();
    if (s.seeds > 1) {
        run->load_seeds(file.sections());
        if (run->is_counted) s.seconds = 0;
        s.seconds += run->series.load()->total_seconds();
        s.fraction = double(s.finished_seeds) / s.seeds;
    } else {
        s.error = arena.execute([&] { return film.error(); });
        if (s.request.spp)
            s.fraction = std::min(1.0, double(film.passes()) / double(*s.request.spp));
    }
    s.interval = interval_kind(s.estimator, s.request.sampler, film.has_groups(), s.seeds);
    s.passes = s.file_passes = s.opened_passes = run->passes();
    if (s.history.empty() && s.error.valid) s.history.push_back({s.passes, s.seconds, s.error});
    s.file = name;
    if (is_own) {
        run->own_file = name;
        run->own_version = file_version(folder_->path_of(name));
        run->file_seeds = run->seeds.count();
    }
    wait_for_next_file(*run, 0);
    return run;
}

void Session::open(const std::string& name, std::function<void(const Opened&)> done) {
    if (!folder_)
        throw std::runtime_error("the program keeps no runs; start it with --runs FOLDER");
    const bool is_taken = writer_.post([this, name, done = std::move(done)] {
        Opened opened;
        try {
            opened.run = open_now(name);
        } catch (...) {
            opened.error = caught();
        }
        changed();
        done(opened);
    });
    if (!is_taken) throw std::runtime_error(kTooMany);
}

int Session::open_now(const std::string& name) {
    {
        const std::lock_guard lock(mutex_);
        for (const auto& run : runs_)
            if (run->status.file == name) return run->status.id;
    }
    const std::shared_ptr<Run> run = load_run(name);
    {
        const std::lock_guard lock(mutex_);
        run->status.id = ++last_id_;
    }
    // Here, since the session's thread may be in a long pass. What that takes of the processor cannot be told from the rest.
    publish(*run);
    const std::lock_guard lock(mutex_);
    if (is_closed_) throw std::runtime_error("the program is about to end");
    runs_.push_back(run);
    return run->status.id;
}

}  // namespace etendue
