#include "render/renderer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <exception>
#include <new>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/info.h>

#include "film/parallel_for.h"
#include "film/thread_arena.h"
#include "math/hash.h"
#include "render/method_choice.h"
#include "render/statistics_section.h"
#include "sampler/pilot_seed.h"
#include "system/available_memory.h"
#include "system/failure.h"

namespace etendue {
namespace {

/// Number of samples in a chunk of parallel work. It does not depend on the number of threads.
constexpr uint64_t kChunk = 256;

/// The result of `make`; empty where there is not enough memory, for what a rendering can do without.
template <class Make>
auto where_there_is_memory(const Make& make) -> std::optional<decltype(make())> {
    try {
        return make();
    } catch (const std::bad_alloc&) {
        return {};
    }
}

/// Integrators learn before passes 0, 1, 4, 16, 64 …; those up to the next learning step are a generation.
struct LearningStep {
    uint32_t number;  ///< Index of the learning step.
    uint32_t pass;    ///< Index of the pass within the step.

    /// The first pass that follows its generation.
    uint64_t end() const { return uint64_t(1) << (2 * number); }

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
        if (!to_.shown.contains(join.technique)) return;
        if (!is_finite(contribution)) {
            ++to_.work.stats.rejected;
            return;
        }
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
    /// Adds the splats that wait; to be called at the end. Not by the destructor, since there may be no memory for a splat.
    /// What then still waits is dropped with the pass.
    void flush() {
        const size_t count = std::exchange(waiting_, 0);
        for (size_t i = 0; i < count; ++i) to_.film.add_splat(queue_[i].film, queue_[i].value);
    }

private:
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
            "several seeds instead, and add them up (etendue merge)",
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

/// Throws if several processes cannot render together.
void check_ranks(const RenderSettings& settings, const Integrator& integrator) {
    if (settings.ranks->count() == 1) return;
    if (integrator.error_groups() > 0)
        throw std::runtime_error(
            fmt::format("{} cannot be rendered by several processes together, since each pass "
                        "continues the chains of earlier ones; give each process another seed, and "
                        "merge the results",
                        settings.integrator.name));
    if (settings.technique_depth > 0)
        throw std::runtime_error(
            "technique images cannot be rendered by several processes together; give each process "
            "other passes, and merge the results");
    if (settings.observer)
        throw std::runtime_error(
            "contributions cannot be observed where several processes render together");
}

/// The film's geometry, if there is memory for its film.
const FilmGeometry& fitting_film(const Scene& scene, const RenderSettings& settings,
                                 const Integrator& integrator, uint64_t light_paths) {
    const FilmGeometry& g = scene.film();
    uint64_t bytes =
        g.pixel_count() * Film::bytes_per_pixel(light_paths > 0, integrator.error_groups(),
                                                settings.ranks->count() > 1);
    if (settings.keeps_largest && integrator.error_groups() == 0)
        bytes += g.pixel_count() * sizeof(LargestPass);
    if (settings.technique_depth > 0)
        bytes += TechniqueImages::memory_bytes(g.pixel_count(), settings.technique_depth);
    require_memory(bytes, fmt::format("an image of {} x {} pixels", g.crop_width, g.crop_height),
                   "; render it in crops (--crop)");
    return g;
}

}  // namespace

struct Renderer::Workers {
    explicit Workers(int threads) : allowed(allow_threads(threads)), arena(threads) {}

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
    void drop_sums() {
        for (Workspace& w : spaces) w.sums.reset();
    }

    std::unique_ptr<tbb::global_control> allowed;
    ThreadArena arena;
    tbb::enumerable_thread_specific<Workspace> spaces;
};

Renderer::Renderer(const Scene& scene, const RenderSettings& settings)
    : Renderer(scene, with_chosen_method(scene, settings), nullptr) {}

Renderer::Renderer(const Scene& scene, const RenderSettings& settings,
                   std::unique_ptr<Integrator> integrator)
    : scene_(scene), settings_(settings),
      integrator_(integrator ? std::move(integrator) : make_integrator(settings.integrator)),
      light_paths_(integrator_->light_paths(scene)),
      film_(fitting_film(scene, settings, *integrator_, light_paths_), scene.filter(),
            typical_radiance(scene), settings.filter_mode),
      workers_(std::make_unique<Workers>(settings.threads)) {
    // Others can be traced again without, or not at all.
    if (integrator_->error_groups() > 0 || !integrator_->keeps_paths() ||
        integrator_->samples_alone(scene))
        settings_.keeps_generations = false;
    check_limits(settings, settings.first_pass);
    check_ranks(settings, *integrator_);
    film_.set_ranks(*settings.ranks);
    if (integrator_->error_groups() > 0)
        film_.set_groups(integrator_->error_groups());
    else if (settings.keeps_largest)
        film_.keep_largest();
    if (settings.technique_depth > 0)
        techniques_ = std::make_unique<TechniqueImages>(
            scene.film(), scene.filter(), settings.technique_depth, typical_radiance(scene));
    if (settings.choice) seconds_ = settings.choice->seconds;
}

Renderer::~Renderer() = default;

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
    if (!kept_pass_) return false;
    const Numbers place = numbers(*kept_pass_);
    const float splat_scale = light_paths_ > 0 ? float(1.0 / double(light_paths_)) : 0.0f;
    work.is_observed = true;
    work.sums = integrator_->make_sums();
    Sampler sampler(settings_.sampler, place.seed);
    sampler.start(place.pass, index);
    const SampleContext c{scene_,       film_,       expected(), index, index / kChunk,
                          light_paths_, splat_scale, sampler,    sink};
    integrator_->trace_eye_paths({&c, 1}, {&work.z, 1}, work.stats);
    integrator_->sample(c, work);
    return true;
}

namespace {

/// Number of samples whose eye paths are made in turns. Where the caches of a processor hold most of what rays and
/// materials read, nothing waits for memory, and one after the other is faster.
uint64_t walks_in_turn(const Scene& scene) {
    constexpr size_t kCaches = size_t(16) << 20;
    const Scene::Statistics& s = scene.statistics();
    const size_t read = s.geometry_bytes + s.accelerator_bytes + s.texture_bytes;
    return read > kCaches || scene.has_large_emitter_tables() ? kWalksInTurn : 1;
}

}  // namespace

/// The paths of one pass.
class Renderer::Pass {
public:
    /// The pass that follows `passes` others.
    Pass(Renderer& renderer, uint32_t passes, const std::atomic<bool>& drop)
        : r_(renderer), drop_(drop), passes_(passes),
          cost_(r_.settings_.cost_limit, r_.settings_.cost_limit ? r_.cost() : 0),
          index_(uint32_t(r_.settings_.first_pass) + passes), numbers_(r_.numbers(passes)),
          splat_scale_(r_.light_paths_ > 0 ? float(1.0 / double(r_.light_paths_)) : 0.0f) {}

    void learn() {
        r_.film_.renew_expected();
        r_.integrator_->learn({.scene = r_.scene_,
                               .film = r_.film_,
                               .index = index_,
                               .light_paths = r_.light_paths_,
                               .so_far = r_.stats_});
    }
    void prepare() {
        cost_.count_once();
        r_.integrator_->prepare(context());
        // These paths are no part of the image.
        r_.preparation_ += r_.workers_->take_stats();
        r_.workers_->drop_sums();
    }
    /// What the samples share.
    void trace_shared() {
        r_.film_.begin_pass(r_.light_paths_,
                            film_offset(r_.settings_.sampler, numbers_.seed,
                                        r_.integrator_->eye_paths_of(numbers_.pass)),
                            hash_combine(numbers_.seed, numbers_.pass));
        r_.integrator_->trace(context());
        r_.kept_pass_ = passes_;
    }
    void trace() {
        trace_shared();
        const std::function<void()>& meanwhile = r_.settings_.meanwhile;
        const uint64_t count = r_.film_.sample_count(), in_turn = walks_in_turn(r_.scene_);
        parallel_for(chunks(count), [&](uint64_t chunk) {
            if (meanwhile) meanwhile();
            SamplesInTurn samples(*this, chunk);
            const uint64_t end = std::min(count, (chunk + 1) * kChunk);
            for (uint64_t i = chunk * kChunk; i < end; i += in_turn)
                samples.make(i, std::min(end, i + in_turn));
        });
    }

private:
    static uint64_t chunks(uint64_t samples) { return (samples + kChunk - 1) / kChunk; }
    void go_on() const {
        if (drop_.load(std::memory_order_relaxed)) throw PassDropped();
    }
    Workspace& workspace() const {
        Workspace& work = r_.workers_->spaces.local();
        work.is_observed = r_.settings_.observer != nullptr;
        work.drop = &drop_;
        if (!work.sums) work.sums = r_.integrator_->make_sums();
        return work;
    }
    Receivers receivers(Workspace& work) const {
        return {r_.film_, r_.techniques_.get(), r_.settings_, splat_scale_, work};
    }

    SampleContext sample_context(uint64_t index, uint64_t chunk, Sampler& sampler,
                                 ContributionSink& sink) const {
        return {r_.scene_,       r_.film_,     r_.expected(), index, chunk,
                r_.light_paths_, splat_scale_, sampler,       sink};
    }

    /// Makes samples of a chunk, whose eye paths are traced in turns.
    class SamplesInTurn {
    public:
        SamplesInTurn(const Pass& pass, uint64_t chunk)
            : pass_(pass), chunk_(chunk), work_(pass.workspace()), meter_(pass.cost_, work_),
              sink_(pass.receivers(work_)),
              samplers_(kWalksInTurn, Sampler(pass.r_.settings_.sampler, pass.numbers_.seed)) {
            contexts_.reserve(kWalksInTurn);
            work_.eye_paths.resize(kWalksInTurn);
        }

        /// Makes the samples begin … end-1.
        void make(uint64_t begin, uint64_t end) {
            const Integrator& integrator = *pass_.r_.integrator_;
            contexts_.clear();
            for (uint64_t i = begin; i < end; ++i) {
                Sampler& sampler = samplers_[size_t(i - begin)];
                sampler.start(pass_.numbers_.pass, i);
                contexts_.push_back(pass_.sample_context(i, chunk_, sampler, sink_));
            }
            const bool is_one = contexts_.size() == 1;
            pass_.go_on();
            work_.stats.time_factor = 1;
            integrator.trace_eye_paths(contexts_,
                                       is_one ? std::span(&work_.z, 1)
                                              : std::span(work_.eye_paths).first(contexts_.size()),
                                       work_.stats);
            for (size_t i = 0; i < contexts_.size(); ++i) {
                const SampleContext& c = contexts_[i];
                pass_.go_on();
                work_.stats.time_factor = RenderStats::time_factor_of(c.index);
                if (!is_one) std::swap(work_.z, work_.eye_paths[i]);
                sink_.begin(c.index, c.light_paths);
                integrator.sample(c, work_);
                sink_.end();
                meter_.update();
            }
        }

    private:
        const Pass& pass_;
        uint64_t chunk_;
        Workspace& work_;
        RunningCost::Meter meter_;
        FilmSink sink_;
        std::vector<Sampler> samplers_;
        std::vector<SampleContext> contexts_;
    };

    /// Calls use(context, work) for the samples 0 … count-1 of the pass, which have no eye paths.
    template <class Use>
    void for_each_sample(uint64_t count, const Use& use) const {
        parallel_for(chunks(count), [&](uint64_t chunk) {
            Workspace& work = workspace();
            RunningCost::Meter meter(cost_, work);
            Sampler sampler(r_.settings_.sampler, numbers_.seed);
            FilmSink sink(receivers(work));
            const uint64_t end = std::min(count, (chunk + 1) * kChunk);
            for (uint64_t i = chunk * kChunk; i < end; ++i) {
                go_on();
                sampler.start(numbers_.pass, i);
                work.stats.time_factor = RenderStats::time_factor_of(i);
                use(sample_context(i, chunk, sampler, sink), work);
                meter.update();
            }
        });
    }

    PassContext context() const {
        return {
            .scene = r_.scene_,
            .film = r_.film_,
            .index = index_,
            .light_paths = r_.light_paths_,
            .pixels = r_.scene_.film().pixel_count(),
            .seed = numbers_.seed,
            .for_each_sample = [this](uint64_t count,
                                      const PassContext::Use& use) { for_each_sample(count, use); },
            .chunks = chunks,
            .for_each_other_path =
                [this](uint64_t count, const PassContext::Task& task) {
                    parallel_for(count, [&](uint64_t i) {
                        go_on();
                        Sampler sampler(r_.settings_.sampler,
                                        pilot_seed(numbers_.seed, PilotUse::OtherPaths));
                        Workspace& work = workspace();
                        RunningCost::Meter meter(cost_, work);
                        work.stats.time_factor = RenderStats::time_factor_of(i);
                        task(i, sampler, work);
                        meter.update();
                    });
                },
            .for_each_chain =
                [this](uint64_t count, const PassContext::ChainTask& task) {
                    parallel_for(count, [&](uint64_t i) {
                        go_on();
                        Workspace& work = workspace();
                        RunningCost::Meter meter(cost_, work);
                        FilmSplats splats(receivers(work));
                        work.is_observed = splats.needs_joins();
                        task(i, splats, work);
                        splats.flush();
                        meter.update();
                    });
                },
            .forget_statistics = [this] { r_.workers_->take_stats(); }};
    }

    Renderer& r_;
    const std::atomic<bool>& drop_;
    uint32_t passes_;
    mutable RunningCost cost_;
    uint32_t index_;
    Numbers numbers_;
    float splat_scale_;
};

struct Renderer::Round {
    int passes = 0;  ///< Number of passes that it asks for: one of each of the first processes.
    int made =
        0;  ///< Number of them that can be added: those before the first one that is missing.
    bool is_incomplete = false;                   ///< Whether any is missing.
    std::exception_ptr failure;                   ///< Of this process, or what another one says.
    uint64_t rejected_before = 0;                 ///< Of the film.
    std::vector<std::unique_ptr<PassSums>> sums;  ///< Of the pass of a process that renders alone.
    std::vector<std::string> results;  ///< Statistics and sums of the pass of each process.
};

void Renderer::drop_pass() {
    workers_->arena.execute([&] {
        film_.drop_pass();
        if (techniques_) techniques_->drop_pass();
    });
    workers_->take_stats();
    workers_->drop_sums();
    kept_pass_.reset();
}

void Renderer::trace_own_pass(Round& round, const std::atomic<bool>& drop) {
    const auto passes = uint32_t(film_.passes());
    const int rank = settings_.ranks->index();
    kept_pass_.reset();
    // If a discarded pass is traced again, its learning step is not repeated.
    if (learned_steps_ == LearningStep::of(passes).number) {
        Pass(*this, passes, drop).learn();
        ++learned_steps_;
        is_prepared_ = false;
    }
    if (!is_prepared_) Pass(*this, passes, drop).prepare();
    is_prepared_ = true;
    if (rank >= round.passes) return;
    const uint32_t generation = LearningStep::of(passes).number;
    const bool is_kept = !generations_.empty() && generations_.back()->number == generation;
    // Integrators change what they learn from while they make passes.
    std::optional<std::vector<std::byte>> learned;
    if (settings_.keeps_generations && !is_kept)
        learned = where_there_is_memory([&] { return learned_state(); });
    Pass(*this, passes + uint32_t(rank), drop).trace();
    if (learned)
        where_there_is_memory([&] {
            keep_generation(generation, std::move(*learned));
            return true;
        });
    if (settings_.ranks->count() == 1) {
        // From the end of the film's pass to that of add_pass(), nothing may fail, so that all of them have the same passes.
        round.sums = workers_->take_sums();
        film_.end_pass(integrator_->splat_error_factor());
    } else {
        film_.finish_pass();
    }
    if (techniques_) techniques_->end_pass();
}

Renderer::Round Renderer::make_round(const RenderLimits& limits, const std::atomic<bool>& drop) {
    enum class Outcome : uint8_t { Good, Dropped, Failed };
    const Ranks& ranks = *settings_.ranks;
    Round round;
    round.passes = round_size(limits);
    round.rejected_before = film_.rejected();
    // What is learned next is learned from all passes. The processes agree on their number, but if one of them failed, not
    // on what they have learned already.
    if (LearningStep::of(uint32_t(film_.passes())).pass == 0) gather();

    auto outcome = Outcome::Good;
    try {
        workers_->arena.execute([&] { trace_own_pass(round, drop); });
    } catch (const PassDropped&) {
        outcome = Outcome::Dropped;
    } catch (...) {
        outcome = Outcome::Failed;
        round.failure = std::current_exception();
    }
    if (outcome != Outcome::Good) drop_pass();
    if (ranks.count() == 1) {
        round.made = outcome == Outcome::Good ? 1 : 0;
        round.is_incomplete = round.made == 0;
        return round;
    }

    const std::vector<Outcome> outcomes = ranks.gather_values(outcome);
    const auto first_bad = std::find_if(outcomes.begin(), outcomes.end(),
                                        [](Outcome o) { return o != Outcome::Good; });
    round.made = std::min(round.passes, int(first_bad - outcomes.begin()));
    round.is_incomplete = first_bad != outcomes.end();
    if (std::find(outcomes.begin(), outcomes.end(), Outcome::Failed) != outcomes.end()) {
        const std::vector<std::string> failures =
            ranks.gather(round.failure ? failure_of([&] { std::rethrow_exception(round.failure); })
                                       : std::string());
        for (size_t r = 0; r < failures.size() && !round.failure; ++r)
            if (!failures[r].empty())
                round.failure = std::make_exception_ptr(
                    std::runtime_error(fmt::format("process {}: {}", r, failures[r])));
    }
    if (round.made > 0)
        exchange(round);
    else
        drop_pass();
    return round;
}

void Renderer::exchange(Round& round) {
    const Ranks& ranks = *settings_.ranks;
    LearnedState own;
    if (ranks.index() < round.made) {
        own.put(workers_->take_stats());
        own.put(film_.rejected_in_pass());
        const auto sums = workers_->take_sums();
        own.put(uint64_t(sums.size()));
        for (const auto& s : sums) s->save(own);
    } else {
        workers_->take_stats();
        workers_->drop_sums();
    }
    round.results =
        ranks.gather({reinterpret_cast<const char*>(own.bytes().data()), own.bytes().size()});
    workers_->arena.execute([&] { film_.exchange(round.made); });
}

void Renderer::add_pass(Round& round, int rank) {
    if (settings_.ranks->count() == 1) {
        stats_ += workers_->take_stats();
        stats_.rejected += film_.rejected() - round.rejected_before;
        integrator_->collect(round.sums);
        return;
    }
    kept_pass_.reset();
    const auto* const bytes =
        reinterpret_cast<const std::byte*>(round.results[size_t(rank)].data());
    LearnedState result(std::vector<std::byte>(bytes, bytes + round.results[size_t(rank)].size()));
    RenderStats stats;
    uint64_t rejected = 0, workers = 0;
    result.get(stats);
    result.get(rejected);
    result.get(workers);
    std::vector<std::unique_ptr<PassSums>> sums;
    for (uint64_t i = 0; i < workers; ++i)
        sums.emplace_back(integrator_->make_sums())->load(result);
    workers_->arena.execute([&] { film_.add_pass(rank, rejected); });
    stats_ += stats;
    stats_.rejected += rejected;
    integrator_->collect(sums);
    last_rank_ = rank;
}

void Renderer::keep_generation(uint32_t number, std::vector<std::byte> learned) {
    generations_.push_back(std::make_shared<const Generation>(
        Generation{number, std::move(learned), film_.expected()}));
    const auto bytes = [&] {
        size_t sum = 0;
        for (const auto& g : generations_)
            sum += g->learned.size() + film_.geometry().pixel_count() * sizeof(float);
        return sum;
    };
    while (generations_.size() > 1 && bytes() > kGenerationBytes)
        generations_.erase(generations_.begin());
}

std::shared_ptr<const Generation> Renderer::generation_of(uint32_t pass) const {
    if (pass >= film_.passes() && pass != kept_pass_) return nullptr;
    for (const auto& g : generations_)
        if (g->number == LearningStep::of(pass).number) return g;
    return nullptr;
}

void Renderer::trace_again(uint32_t pass, std::shared_ptr<const Generation> generation,
                           const std::atomic<bool>& drop) {
    load_learned_state(generation->learned);
    replayed_ = std::move(generation);
    // Samples that share no light paths have their own.
    const bool splats_samples = light_paths_ > 0 && integrator_->light_path_memory() == 0;
    workers_->arena.execute([&] {
        Pass again(*this, pass, drop);
        if (settings_.observer && splats_samples)
            again.trace();
        else
            again.trace_shared();
    });
}

void Renderer::gather() {
    const Ranks& ranks = *settings_.ranks;
    if (ranks.count() == 1) return;
    film_.complete();
    if (last_rank_ < 0) return;
    std::vector<std::byte> state;
    if (ranks.index() == last_rank_) state = learned_state();
    ranks.broadcast(state, last_rank_);
    if (ranks.index() != last_rank_) load_learned_state(std::move(state));
    last_rank_ = -1;
}

std::vector<std::byte> Renderer::learned_state() const {
    LearnedState state;
    state.put(learned_steps_);
    state.put(is_prepared_);
    integrator_->save(state);
    return state.take();
}

void Renderer::load_learned_state(std::vector<std::byte> bytes) {
    LearnedState state(std::move(bytes));
    state.get(learned_steps_);
    state.get(is_prepared_);
    integrator_->load(state);
    kept_pass_.reset();
}

void Renderer::save_sums(SectionWriter& to) const {
    save_statistics(stats_, seconds_, to);
    film_.save(to);
    if (techniques_) techniques_->save(to);
}

void Renderer::save(SectionWriter& to) const {
    save_sums(to);
    to.begin("learned");
    to.put(learned_state());
}

void Renderer::load(SectionReader& from) {
    load_statistics(from, stats_, seconds_);
    workers_->arena.execute([&] { film_.load(from); });
    if (techniques_) techniques_->add_saved(from);
    from.open("learned");
    std::vector<std::byte> bytes;
    from.get(bytes);
    from.finish();
    try {
        load_learned_state(std::move(bytes));
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

std::string Renderer::place_of_failure() const {
    return pass_failed_ ? fmt::format("pass {} failed", film_.passes() + 1)
                        : fmt::format("after pass {}", film_.passes());
}

double Renderer::seconds_a_pass() const {
    if (film_.passes() == 0) return 0;
    const double before = settings_.choice ? settings_.choice->seconds : 0;
    return std::max(0.0, seconds_ - before) / double(film_.passes());
}

int Renderer::round_size(const RenderLimits& limits) const {
    const uint64_t passes = film_.passes(), all = kMostPasses - settings_.first_pass,
                   end =
                       std::min(LearningStep::of(uint32_t(passes)).end(), limits.spp.value_or(all));
    return int(std::min(end - passes, uint64_t(settings_.ranks->count())));
}

std::optional<StopReason> Renderer::reached(const RenderLimits& limits,
                                            const std::optional<ErrorEstimate>& error) const {
    if (film_.passes() == 0) return {};
    if (settings_.cost_limit && cost() > settings_.cost_limit->most) return StopReason::Interrupted;
    if (film_.passes() >= limits.spp.value_or(kMostPasses - settings_.first_pass))
        return StopReason::Samples;
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
    const Ranks& ranks = *settings_.ranks;
    check_limits(limits, settings_.first_pass);
    ended_together_ = pass_failed_ = false;
    const auto end = [&](StopReason reason) {
        ended_together_ = true;
        return reason;
    };
    // Where another process was interrupted in its pass, this one may have learned what it has not.
    if (last_rank_ >= 0) gather();
    // Computed only where it matters, since it may take as long as a pass.
    const auto error_of_image = [&] {
        return limits.error ? std::optional(error()) : std::nullopt;
    };
    seconds_ = ranks.of_first(seconds_);
    // All processes must come to the same end; each has its own time of the pilots of `auto`.
    double round_seconds = ranks.of_first(seconds_a_pass());
    // A round is begun only if at least half of it is expected to fit.
    const auto has_no_time = [&] {
        return limits.seconds && film_.passes() > 0 &&
               seconds_ + 0.5 * round_seconds > *limits.seconds;
    };
    if (const auto reason = reached(limits, error_of_image())) return end(*reason);
    if (has_no_time()) return end(StopReason::Time);
    while (true) {
        const double before_round = seconds_;
        Round round = make_round(limits, drop);
        const double so_far =
            ranks.of_first(before + std::chrono::duration<double>(Clock::now() - begin).count());
        for (int i = 0; i < round.made; ++i) {
            add_pass(round, i);
            // Each pass has its share of the time of the round.
            seconds_ =
                before_round + (so_far - before_round) * (double(i + 1) / double(round.made));

            const std::optional<ErrorEstimate> found = error_of_image();
            Progress now{.renderer = *this,
                         .passes = film_.passes(),
                         .seconds = seconds_,
                         .fraction = {},
                         .rays_per_second = double(stats_.rays()) / seconds_,
                         .ends_round = i + 1 == round.made};
            if (limits.spp) now.fraction = double(now.passes) / double(*limits.spp);
            if (limits.seconds)
                now.fraction = std::max(now.fraction.value_or(0), seconds_ / *limits.seconds);
            // The error falls with the square root of the number of passes.
            if (found && found->valid)
                now.fraction =
                    std::max(now.fraction.value_or(0), sqr(*limits.error / found->relative_rms));
            if (now.fraction) now.fraction = std::min(*now.fraction, 1.0);
            progress(now);

            if (now.ends_round && ranks.any(interrupted.load(std::memory_order_relaxed)))
                return end(StopReason::Interrupted);
            if (const auto reason = reached(limits, found)) return end(*reason);
        }
        if (round.failure) {
            ended_together_ = pass_failed_ = true;
            std::rethrow_exception(round.failure);
        }
        if (round.is_incomplete) return end(StopReason::Interrupted);
        // Alone, a round is a pass. The times of passes vary, and their mean less.
        round_seconds = ranks.count() == 1 ? seconds_a_pass() : so_far - before_round;
        if (has_no_time()) return end(StopReason::Time);
    }
}

}  // namespace etendue
