#include "render/renderer.h"
#include "system/threads.h"

#include <algorithm>
#include <array>
#include <bit>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "render/statistics_section.h"
#include "sampler/pilot_seed.h"
#include "system/available_memory.h"

namespace etendue {
namespace {

/// Number of samples in a chunk of parallel work. It does not depend on the number of threads.
constexpr uint64_t kChunk = 256;

/// Integrators learn before passes 0, 1, 4, 16, 64 …
struct LearningStep {
    uint32_t number;  ///< Index of the learning step.
    uint32_t pass;    ///< Index of the pass within the step.

    static LearningStep of(uint32_t pass) {
        if (pass == 0) return {0, 0};
        // The step begins at the largest power of four that is at most `pass`.
        const uint32_t step = uint32_t(std::bit_width(pass) + 1) / 2;
        return {step, pass - (uint32_t(1) << (2 * step - 2))};
    }
};

/// Receivers of contributions: the film, and optionally technique images and an observer.
struct Receivers {
    Receivers(Film& film, TechniqueImages* techniques, const RenderSettings& settings,
              float splat_scale, Workspace& work)
        : film(film), techniques(techniques), observer(settings.observer), shown(settings.shown),
          splat_scale(splat_scale), work(work) {}

    Film& film;
    TechniqueImages* techniques;
    ContributionObserver* observer;
    PathSelection shown;
    float splat_scale;
    Workspace& work;
};

/// The sink of samples.
class FilmSink final : public ContributionSink {
public:
    explicit FilmSink(const Receivers& to) : to_(to) {}

    /// Begins the sample `index`. There are `light_paths` light paths: the samples of a film's margin have none, since all
    /// splats are divided by this number.
    void begin(uint64_t index, uint64_t light_paths) {
        index_ = index;
        adds_splats_ = index < light_paths;
        sum_ = Rgb();
    }
    void end() { to_.film.add_eye(index_, sum_); }

    void add(const Join& join, Rgb contribution) override {
        if (!to_.shown.contains(join.technique)) return;
        const bool is_splat = join.technique.t <= 1;
        if (is_splat && !adds_splats_) return;
        const Rgb value = contribution * join.mis_weight;
        if (!is_finite(value)) {
            ++to_.work.stats.rejected;
            return;
        }
        const float share = is_splat ? to_.splat_scale : to_.work.z.film_weight;
        if (is_splat)
            to_.film.add_splat(join.film, value);
        else
            sum_ += value * share;
        if (!to_.techniques && !to_.observer) return;
        const FilmTarget target = is_splat             ? FilmTarget{join.film}
                                  : to_.film.spreads() ? FilmTarget{to_.work.z.film}
                                                       : FilmTarget{to_.work.z.film, index_};
        if (to_.techniques)
            to_.techniques->add(target, join.technique, contribution, join.mis_weight, share);
        if (to_.observer) to_.observer->observe(join, contribution, share, target, to_.work);
    }

private:
    Receivers to_;
    uint64_t index_ = 0;
    bool adds_splats_ = true;
    Rgb sum_;
};

/// The sink of Markov chains.
class FilmSplats final : public SplatSink {
public:
    explicit FilmSplats(const Receivers& to) : to_(to) {}
    ~FilmSplats() override { flush(); }
    FilmSplats(const FilmSplats&) = delete;
    FilmSplats& operator=(const FilmSplats&) = delete;

    void add(Vec2 film, Rgb value) override {
        if (!to_.shown.contains_all()) return;
        // Splats wait until the memory of their pixels has been fetched.
        if (waiting_ == queue_.size()) flush();
        to_.film.prefetch_splat(film);
        queue_[waiting_++] = {film, value};
    }
    void tell(const Join& join, Rgb contribution, float factor) override {
        if (!to_.shown.contains(join.technique) || !is_finite(contribution)) return;
        if (!to_.shown.contains_all())
            to_.film.add_splat(join.film, contribution * (join.mis_weight * factor));
        const float share = to_.splat_scale * factor;
        if (to_.techniques)
            to_.techniques->add({join.film}, join.technique, contribution, join.mis_weight, share);
        // The eye path of a chain has no pixel of its own either.
        if (to_.observer) to_.observer->observe(join, contribution, share, {join.film}, to_.work);
    }
    /// Whether tell() does anything.
    bool needs_joins() const { return to_.techniques || to_.observer || !to_.shown.contains_all(); }

private:
    void flush() {
        for (size_t i = 0; i < waiting_; ++i) to_.film.add_splat(queue_[i].film, queue_[i].value);
        waiting_ = 0;
    }

    struct Splat {
        Vec2 film;
        Rgb value;
    };
    Receivers to_;
    std::array<Splat, 16> queue_;
    size_t waiting_ = 0;
};

}  // namespace

void check_limits(const RenderLimits& limits, uint64_t first_pass) {
    if (first_pass >= kMostPasses || limits.spp.value_or(1) > kMostPasses - first_pass)
        throw std::runtime_error(fmt::format(
            "{} samples per pixel are too many: there are random numbers for 2^32; render with "
            "several seeds instead, and average the images",
            first_pass + limits.spp.value_or(1)));
}

const char* to_string(StopReason reason) {
    switch (reason) {
    case StopReason::Samples: return "samples";
    case StopReason::Time: return "time";
    case StopReason::Error: return "error";
    case StopReason::Interrupted: return "interrupted";
    }
    return "";
}

const char* to_string(Estimator estimator) {
    switch (estimator) {
    case Estimator::Unbiased: return "unbiased";
    case Estimator::Consistent: return "consistent";
    case Estimator::Biased: return "biased";
    }
    return "";
}

namespace {

/// Estimates the radiance in the scene within a factor of about 1000: the radiance that a bounding sphere with all
/// emitted power would have. Like the image, it is proportional to the radiance of the emitters.
double typical_radiance(const Scene& scene) {
    double power = 0;
    for (const auto& emitter : scene.emitters()) power += emitter->power();
    const double radius = scene.bounds().is_empty() ? 0 : double(scene.bounds().radius());
    return radius > 0 ? power / (4 * sqr(std::numbers::pi * radius)) : power;
}

/// By default, TBB limits the number of threads in all arenas together to that of the hardware. The limit applies to
/// the whole process, and a larger one is valid only while a global_control exists, so every renderer that needs more
/// threads creates its own. TBB uses the smallest limit of all global_controls; kRoom leaves room for other renderers.
std::unique_ptr<tbb::global_control> allow_threads(int threads) {
    constexpr size_t kRoom = 256;
    if (threads <= tbb::info::default_concurrency()) return nullptr;
    return std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                 std::max(size_t(threads), kRoom));
}

/// Exception that ends a pass which is to be discarded.
struct PassDropped {};

/// The film's geometry, if there is memory for its film and for the image that is written.
const FilmGeometry& fitting_film(const Scene& scene, const RenderSettings& settings,
                                 const Integrator& integrator, uint64_t light_paths) {
    const FilmGeometry& g = scene.film();
    uint64_t bytes =
        g.pixel_count() * Film::bytes_per_pixel(light_paths > 0, integrator.error_groups()) +
        g.pixel_count() * sizeof(Rgb);
    if (settings.technique_depth > 0)
        bytes += TechniqueImages::memory_bytes(g.pixel_count(), settings.technique_depth);
    require_memory(bytes, fmt::format("an image of {} x {} pixels", g.crop_width, g.crop_height),
                   "; render it in crops (--crop)");
    return g;
}

}  // namespace

struct Renderer::Workers {
    explicit Workers(int threads) : allowed(allow_threads(threads)), arena(thread_count(threads)) {}

    /// Returns the sum of all workers' statistics and resets them.
    RenderStats take_stats() {
        RenderStats sum;
        for (Workspace& w : spaces) sum += std::exchange(w.stats, {});
        return sum;
    }

    /// Returns every worker's sums for the integrator and resets them.
    std::vector<std::unique_ptr<PassSums>> take_sums() {
        std::vector<std::unique_ptr<PassSums>> taken;
        for (Workspace& w : spaces)
            if (w.sums) taken.push_back(std::move(w.sums));
        return taken;
    }

    std::unique_ptr<tbb::global_control> allowed;
    tbb::task_arena arena;
    tbb::enumerable_thread_specific<Workspace> spaces;
};

Renderer::Renderer(const Scene& scene, const RenderSettings& settings)
    : Renderer(scene, settings, make_integrator(settings.integrator)) {}

Renderer::Renderer(const Scene& scene, const RenderSettings& settings,
                   std::unique_ptr<Integrator> integrator)
    : scene_(scene), settings_(settings), integrator_(std::move(integrator)),
      light_paths_(integrator_->light_paths(scene)),
      film_(fitting_film(scene, settings, *integrator_, light_paths_), scene.filter(),
            typical_radiance(scene), settings.filter_mode),
      workers_(std::make_unique<Workers>(settings.threads)) {
    check_limits(settings, settings.first_pass);
    if (integrator_->error_groups() > 0) film_.set_groups(integrator_->error_groups());
    if (settings.technique_depth > 0)
        techniques_ = std::make_unique<TechniqueImages>(
            scene.film(), scene.filter(), settings.technique_depth, typical_radiance(scene));
}

Renderer::~Renderer() = default;

void Renderer::pass(const std::atomic<bool>& drop) {
    const uint64_t rejected_before = film_.rejected();
    has_last_pass_ = false;
    try {
        workers_->arena.execute([&] { trace_pass(drop); });
    } catch (...) {
        workers_->arena.execute([&] {
            film_.drop_pass();
            if (techniques_) techniques_->drop_pass();
        });
        workers_->take_stats();
        workers_->take_sums();
        throw;
    }
    stats_ += workers_->take_stats();
    stats_.rejected += film_.rejected() - rejected_before;
    integrator_->collect(workers_->take_sums());
    has_last_pass_ = true;
}

Renderer::Numbers Renderer::numbers(uint32_t passes) const {
    const bool is_learning = integrator_->is_learning();
    if (!is_learning && integrator_->error_groups() == 0)
        return {settings_.seed, uint32_t(settings_.first_pass) + passes};
    // Passes that depend on those before them start anew in each rendering, and not with the same numbers.
    const uint64_t seed =
        settings_.first_pass == 0
            ? settings_.seed
            : hash_combine(hash_combine(settings_.seed, 0x6672616d65), settings_.first_pass);
    if (!is_learning) return {seed, passes};
    const LearningStep step = LearningStep::of(passes);
    return {step.number > 0 ? hash_combine(seed, step.number) : seed, step.pass};
}

Vec2 film_offset(SamplerKind kind, uint64_t seed, uint32_t pass) {
    constexpr uint64_t kPath = ~uint64_t(0);  // that of no eye or light path
    Sampler sampler(kind, seed);
    sampler.start(pass, kPath);
    sampler.seek(Stream::Eye, 0);
    return sampler.next_2d();
}

bool Renderer::sample_again(uint64_t index, Workspace& work, ContributionSink& sink) const {
    if (!has_last_pass_) return false;
    const Numbers place = numbers(uint32_t(film_.passes() - 1));
    const float splat_scale = light_paths_ > 0 ? float(1.0 / double(light_paths_)) : 0.0f;
    work.is_observed = true;
    work.sums = integrator_->make_sums();
    Sampler sampler(settings_.sampler, place.seed);
    sampler.start(place.pass, index);
    integrator_->sample({scene_, film_, film_.expected_in_last_pass(), index, index / kChunk,
                         light_paths_, splat_scale, sampler, sink},
                        work);
    return true;
}

void Renderer::trace_pass(const std::atomic<bool>& drop) {
    const auto passes = uint32_t(film_.passes());
    const uint32_t index = uint32_t(settings_.first_pass) + passes;
    const uint64_t pixels = scene_.film().pixel_count(), light_paths = light_paths_;
    const float splat_scale = light_paths > 0 ? float(1.0 / double(light_paths)) : 0.0f;
    const Numbers place = numbers(passes);
    film_.begin_pass(light_paths, film_offset(settings_.sampler, place.seed,
                                              integrator_->eye_paths_of(place.pass)));
    const uint64_t seed = place.seed;
    const auto go_on = [&] {
        if (drop.load(std::memory_order_relaxed)) throw PassDropped();
    };
    const auto workspace = [&]() -> Workspace& {
        Workspace& work = workers_->spaces.local();
        work.is_observed = settings_.observer != nullptr;
        if (!work.sums) work.sums = integrator_->make_sums();
        return work;
    };
    const auto chunks = [](uint64_t samples) { return (samples + kChunk - 1) / kChunk; };
    // Calls use(context, work, sink) for the samples 0 … count-1 of the pass.
    const auto for_each_sample = [&](uint64_t count, const auto& use) {
        tbb::parallel_for(uint64_t(0), chunks(count), [&](uint64_t chunk) {
            Workspace& work = workspace();
            Sampler sampler(settings_.sampler, seed);
            FilmSink sink({film_, techniques_.get(), settings_, splat_scale, work});
            const uint64_t end = std::min(count, (chunk + 1) * kChunk);
            for (uint64_t i = chunk * kChunk; i < end; ++i) {
                go_on();
                sampler.start(place.pass, i);
                work.stats.is_timed = i % RenderStats::kTimedSamples == 0;
                use(SampleContext{scene_, film_, film_.expected(), i, chunk, light_paths,
                                  splat_scale, sampler, sink},
                    work, sink);
            }
        });
    };
    // If a discarded pass is traced again, its learning step is not repeated.
    if (learned_passes_ == passes) {
        if (LearningStep::of(passes).pass == 0)
            integrator_->learn({.scene = scene_,
                                .film = film_,
                                .index = index,
                                .light_paths = light_paths,
                                .so_far = stats_});
        ++learned_passes_;
    }
    integrator_->trace(
        {.scene = scene_,
         .film = film_,
         .index = index,
         .light_paths = light_paths,
         .pixels = pixels,
         .seed = seed,
         .for_each_sample =
             [&](uint64_t count, const PassContext::Use& use) {
                 for_each_sample(count, [&](const SampleContext& c, Workspace& work, FilmSink&) {
                     use(c, work);
                 });
             },
         .chunks = chunks,
         .for_each_other_path =
             [&](uint64_t count, const PassContext::Task& task) {
                 tbb::parallel_for(uint64_t(0), count, [&](uint64_t i) {
                     go_on();
                     Sampler sampler(settings_.sampler, pilot_seed(seed, PilotUse::OtherPaths));
                     Workspace& work = workspace();
                     work.stats.is_timed = i % RenderStats::kTimedSamples == 0;
                     task(i, sampler, work);
                 });
             },
         .for_each_chain =
             [&](uint64_t count, const PassContext::ChainTask& task) {
                 tbb::parallel_for(uint64_t(0), count, [&](uint64_t i) {
                     go_on();
                     Workspace& work = workspace();
                     FilmSplats splats({film_, techniques_.get(), settings_, splat_scale, work});
                     work.is_observed = splats.needs_joins();
                     task(i, splats, work);
                 });
             },
         .forget_statistics = [&] { workers_->take_stats(); }});
    for_each_sample(film_.sample_count(),
                    [&](const SampleContext& c, Workspace& work, FilmSink& sink) {
                        sink.begin(c.index, c.light_paths);
                        integrator_->sample(c, work);
                        sink.end();
                    });
    film_.end_pass(integrator_->splat_error_factor());
    if (techniques_) techniques_->end_pass();
}

void Renderer::save_sums(SectionWriter& to) const {
    save_statistics(stats_, seconds_, to);
    film_.save(to);
    if (techniques_) techniques_->save(to);
}

void Renderer::save(SectionWriter& to) const {
    save_sums(to);
    LearnedState learned;
    integrator_->save(learned);
    to.begin("learned");
    to.put(learned_passes_);
    to.put(learned.bytes());
}

void Renderer::load(SectionReader& from) {
    load_statistics(from, stats_, seconds_);
    workers_->arena.execute([&] { film_.load(from); });
    if (techniques_) techniques_->add_saved(from);
    from.open("learned");
    from.get(learned_passes_);
    std::vector<std::byte> bytes;
    from.get(bytes);
    from.finish();
    LearnedState learned(std::move(bytes));
    try {
        integrator_->load(learned);
    } catch (const std::runtime_error& e) {
        from.fail(e.what());
    }
}

ErrorEstimate Renderer::error() const {
    return workers_->arena.execute([&] { return film_.error(); });
}

ErrorEstimate Progress::error() const {
    return renderer.error();
}

const ErrorEstimate& RecentError::update(const Progress& progress) {
    // Without a valid one, there is nothing to compute yet. The last one is that of the whole rendering.
    const bool is_last = progress.fraction.value_or(0) >= 1;
    if (!progress.renderer.film().has_groups() || !last_.valid || is_last ||
        progress.seconds >= seconds_ + 1) {
        last_ = progress.error();
        seconds_ = progress.seconds;
    }
    return last_;
}

std::optional<StopReason> Renderer::reached(const RenderLimits& limits,
                                            const std::optional<ErrorEstimate>& error) const {
    if (film_.passes() == 0) return {};
    if (film_.passes() >= limits.spp.value_or(kMostPasses - settings_.first_pass))
        return StopReason::Samples;
    // A pass is begun only if at least half of it is expected to fit.
    if (limits.seconds && seconds_ + 0.5 * seconds_ / double(film_.passes()) > *limits.seconds)
        return StopReason::Time;
    if (limits.error && error && error->valid && error->relative_rms <= *limits.error)
        return StopReason::Error;
    return {};
}

StopReason Renderer::run(const RenderLimits& limits,
                         const std::function<void(const Progress&)>& progress,
                         const std::atomic<bool>& interrupted, const std::atomic<bool>& drop) {
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    const double before = seconds_;
    check_limits(limits, settings_.first_pass);
    // Computed only where it matters, since it may take as long as a pass.
    const auto error_of_image = [&] {
        return limits.error ? std::optional(error()) : std::nullopt;
    };
    if (const auto reason = reached(limits, error_of_image())) return *reason;
    while (true) {
        try {
            pass(drop);
        } catch (const PassDropped&) {
            return StopReason::Interrupted;
        }
        seconds_ = before + std::chrono::duration<double>(Clock::now() - begin).count();

        const std::optional<ErrorEstimate> found = error_of_image();
        Progress now{*this, film_.passes(), seconds_, {}, double(stats_.rays()) / seconds_};
        if (limits.spp) now.fraction = double(now.passes) / double(*limits.spp);
        if (limits.seconds)
            now.fraction = std::max(now.fraction.value_or(0), seconds_ / *limits.seconds);
        // The error falls with the square root of the number of passes.
        if (found && found->valid)
            now.fraction =
                std::max(now.fraction.value_or(0), sqr(*limits.error / found->relative_rms));
        if (now.fraction) now.fraction = std::min(*now.fraction, 1.0);
        progress(now);

        if (interrupted.load(std::memory_order_relaxed)) return StopReason::Interrupted;
        if (const auto reason = reached(limits, found)) return *reason;
    }
}

}  // namespace etendue
