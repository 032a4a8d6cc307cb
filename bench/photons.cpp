// Photons: the cost of a gathered pair relative to a merged one; time and memory for storing the light paths of a pass,
// and for building and searching the grid; growth of these times with the number of photons and the radius. One thread,
// processor time.

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>

#include <fmt/format.h>

#include "compare/error_statistics.h"
#include "integrator/bdpt.h"
#include "reuse/light_vertex_grid.h"
#include "support.h"

namespace etendue::bench {
namespace {

double processor_seconds() {
    return double(std::clock()) / CLOCKS_PER_SEC;
}

/// Seconds of one call: the mean of as many calls as take at least `least` seconds.
template <class F>
double processor_seconds_of(double least, const F& f) {
    const double begin = processor_seconds();
    double seconds = 0;
    for (int calls = 1;; ++calls) {
        f();
        seconds = processor_seconds() - begin;
        if (seconds >= least) return seconds / calls;
    }
}

/// The results of repeated calls of `run`, after one unmeasured call.
template <class Run>
auto repeat(int repeats, const Run& run) {
    run();
    std::vector<decltype(run())> runs;
    for (int i = 0; i < repeats; ++i) runs.push_back(run());
    return runs;
}

RenderSettings settings_for(const IntegratorSpec& spec) {
    RenderSettings settings;
    settings.integrator = spec;
    settings.sampler = SamplerKind::Sobol;  // the default of the program
    settings.threads = 1;
    return settings;
}

void add_passes(Renderer& renderer, uint64_t passes) {
    RenderLimits limits;
    limits.spp = renderer.film().passes() + passes;
    renderer.run(
        limits, [](const Progress&) {}, false);
}

/// The default radius of pairs of an integrator after some passes.
float own_radius(const Scene& scene, const IntegratorSpec& spec, uint64_t passes) {
    Renderer renderer(scene, settings_for(spec));
    add_passes(renderer, passes);
    return std::sqrt(renderer.integrator().counts(scene, scene.film().pixel_count()).pairs.disc /
                     kPi);
}

IntegratorParams params_of(const IntegratorSpec& spec) {
    const auto& all = integrator_registry();
    const auto entry = std::find_if(
        all.begin(), all.end(), [&](const IntegratorEntry& e) { return e.info.name == spec.name; });
    return {spec, entry->info};
}

// ------------------------------------------------------------------------------------------- gather cost

/// `vcm` or `upg+bdpt` with a fixed radius. Half of the passes find and count pairs without using them; weights,
/// roulette and all other techniques are the same.
class HalfOfThePasses final : public Integrator {
public:
    HalfOfThePasses(const IntegratorSpec& spec, float radius)
        : whole_(make_integrator(spec)), paths_(params_of(spec)), radius_(radius) {}

    void learn(const LearnContext& pass) override {
        whole_->learn(pass);
        paths_.learn(pass);
    }
    void prepare(const PassContext& pass) override { whole_->prepare(pass); }
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}
    std::unique_ptr<PassSums> make_sums() const override { return whole_->make_sums(); }
    void collect(std::span<const std::unique_ptr<PassSums>> workers) override {
        whole_->collect(workers);
    }
    void trace(const PassContext& pass) override {
        // The two kinds alternate, so that roulette has learned from equally many passes.
        is_whole_ = (pass.index + 1) % 4 < 2;
        if (is_whole_) {
            whole_->trace(pass);
        } else {
            cache_.begin(pass.chunks(pass.light_paths), 0, UINT64_MAX);
            trace_light_paths(paths_, pass, counts(pass.scene, pass.light_paths), pass.light_paths,
                              cache_);
            cache_.assemble();
            grid_.build(cache_, radius_);
        }
        begin_of_samples_ = processor_seconds();
    }
    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        if (is_whole_) return whole_->trace_eye_paths(c, z, stats);
        paths_.trace_eye_paths(c, counts(c[0].scene, c[0].light_paths), z, stats);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        if (is_whole_) return whole_->sample(c, work);
        const TechniqueCounts n = counts(c.scene, c.light_paths);
        const SubPath &y = work.y, &z = work.z;
        cache_.restore(c.scene, c.index, work.y);
        for (int t = 2; t <= z.size(); ++t) {
            paths_.add_hits(c, n, t, work);
            if (!paths_.is_joinable(z, t)) continue;
            paths_.add(c, join_next_event(c.scene, z, t, c.sampler, n), work);
            for (int s = 2; s <= y.size() && s + t - 1 <= paths_.max_depth(); ++s)
                paths_.add(c, join_connect(c.scene, y, s, z, t, n), work);
            const auto only_count = [&](const GatherCandidate&) -> std::optional<Chosen> {
                ++work.stats.pairs;
                return {};
            };
            grid_.for_each_in({z[t - 1].p, radius_}, only_count,
                              [](const GatherCandidate&, Chosen) {});
        }
    }
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return whole_->counts(scene, light_paths);
    }
    uint64_t light_paths(const Scene& scene) const override { return whole_->light_paths(scene); }
    Estimator estimator() const override { return Estimator::Biased; }

    bool is_whole() const { return is_whole_; }
    /// When the last pass had its light paths.
    double begin_of_samples() const { return begin_of_samples_; }

private:
    std::unique_ptr<Integrator> whole_;
    Bidirectional paths_;
    LightVertexCache cache_;
    LightVertexGrid grid_;
    float radius_;
    bool is_whole_ = true;
    double begin_of_samples_ = 0;
};

/// Of passes of one kind, once they have their light paths.
struct Passes {
    double seconds = 0, rays = 0, pairs = 0, visible_pairs = 0, trials = 0, eye_paths = 0;

    Passes& operator+=(const Passes& o) {
        seconds += o.seconds, rays += o.rays, pairs += o.pairs;
        visible_pairs += o.visible_pairs, trials += o.trials, eye_paths += o.eye_paths;
        return *this;
    }
};

class GatherCost {
public:
    GatherCost(const Scene& scene, IntegratorSpec spec, float radius) {
        spec.params["radius"] = fmt::format("{}", radius);
        if (spec.name == "vcm") spec.params["alpha"] = "1";
        auto integrator = std::make_unique<HalfOfThePasses>(spec, radius);
        integrator_ = integrator.get();
        renderer_ = std::make_unique<Renderer>(scene, settings_for(spec), std::move(integrator));
    }
    struct Run {
        Passes whole, searching;

        double ns_per_pair() const {
            return 1e9 * (whole.seconds - searching.seconds) / searching.pairs;
        }
        double rays_per_pair() const { return (whole.rays - searching.rays) / searching.pairs; }
        double share_of_pairs() const { return 1 - searching.seconds / whole.seconds; }
    };
    Run run(double least_seconds) {
        Run run;
        while (run.whole.seconds + run.searching.seconds < least_seconds)
            for (int i = 0; i < 4; ++i) add_pass(run);
        return run;
    }

private:
    void add_pass(Run& run) {
        const RenderStats before = renderer_->stats();
        add_passes(*renderer_, 1);
        const double end = processor_seconds();
        const RenderStats& after = renderer_->stats();
        Passes& sum = integrator_->is_whole() ? run.whole : run.searching;
        sum.seconds += end - integrator_->begin_of_samples();
        sum.rays += double(after.rays() - before.rays());
        sum.pairs += double(after.pairs - before.pairs);
        sum.visible_pairs += double(after.visible_pairs - before.visible_pairs);
        sum.trials += double(after.trials - before.trials);
        sum.eye_paths += double(after.eye_paths - before.eye_paths);
    }

    std::unique_ptr<Renderer> renderer_;
    const HalfOfThePasses* integrator_;
};

/// (pass − pass without pairs) / pairs, the search being in both; pairs are all that it finds.
void measure_gather_cost(const Report& report, const Options& options, const Scene& scene,
                         const std::string& scene_name) {
    const std::string name = "gather cost " + scene_name;
    if (!report.wants(name)) return;
    const IntegratorSpec vcm = integrator_for(scene, "vcm"),
                         upg = integrator_for(scene, "upg+bdpt");
    constexpr uint64_t kAdaptingPasses = 8;
    const float radius = own_radius(scene, upg, kAdaptingPasses);
    GatherCost merging(scene, vcm, radius), gathering(scene, upg, radius);
    // Small differences need longer runs.
    const double seconds = 4 * options.seconds;
    const auto [merged, gathered] = alternate(
        options.repeats, [&] { return merging.run(seconds); },
        [&] { return gathering.run(seconds); });
    using Run = GatherCost::Run;
    Passes whole, searching;
    for (const Run& run : gathered) whole += run.whole, searching += run.searching;
    report.add(
        name,
        {{"gather_over_merge", "1", false,
          each(merged, gathered,
               [](const Run& m, const Run& g) { return g.ns_per_pair() / m.ns_per_pair(); }),
          2.5},
         {"merge", "ns/pair", false, each(merged, [](const Run& r) { return r.ns_per_pair(); })},
         {"gather", "ns/pair", false, each(gathered, [](const Run& r) { return r.ns_per_pair(); })},
         {"rays_of_a_merge", "rays/pair", false,
          each(merged, [](const Run& r) { return r.rays_per_pair(); })},
         {"rays_of_a_gather", "rays/pair", false,
          each(gathered, [](const Run& r) { return r.rays_per_pair(); })},
         {"share_of_merging", "1", false,
          each(merged, [](const Run& r) { return r.share_of_pairs(); })},
         {"share_of_gathering", "1", false,
          each(gathered, [](const Run& r) { return r.share_of_pairs(); })}},
        {{"radius", radius},
         {"light_paths", scene.film().pixel_count()},
         {"pairs_an_eye_path", searching.pairs / searching.eye_paths},
         {"gathered_share_of_pairs", whole.pairs / searching.pairs},
         {"visible_share_of_pairs", whole.visible_pairs / searching.pairs},
         {"trials_a_visible_pair", whole.trials / whole.visible_pairs}});
}

// --------------------------------------------------------------------------------------------- photon map

/// Sub-paths of one pass on one thread, without a renderer.
class Walks {
public:
    explicit Walks(const Scene& scene)
        : scene_(scene), film_(scene.film(), scene.filter()), spec_(integrator_for(scene, "vcm")),
          paths_(params_of(spec_)), radius_(own_radius(scene, spec_, 1)) {}

    /// That of `vcm` in its first pass.
    float radius() const { return radius_; }

    /// Light paths, and nothing else.
    void trace(uint64_t light_paths) {
        const PassContext pass = context(light_paths);
        const TechniqueCounts n = counts(light_paths);
        pass.for_each_light_path([&](const SampleContext& c, Workspace& work) {
            trace_light_path(paths_.light_walk(c.scene, n, work.stats), c.sampler, work.y);
        });
    }
    void keep(uint64_t light_paths, LightVertexCache& kept) {
        const PassContext pass = context(light_paths);
        kept.begin(pass.chunks(light_paths), 0, UINT64_MAX);
        trace_light_paths(paths_, pass, counts(light_paths), light_paths, kept);
        kept.assemble();
    }
    /// Eye vertices that search for photons, in the order of a pass; of every eighth chunk.
    std::vector<Vec3> queries() {
        std::vector<Vec3> points;
        const uint64_t pixels = scene_.film().pixel_count();
        const TechniqueCounts n = counts(pixels);
        for (uint64_t pixel = 0; pixel < pixels; ++pixel) {
            if (pixel / kChunk % 8 != 0) continue;
            sampler_.start(0, pixel);
            SubPath& z = work_.z;
            trace_eye_path(paths_.eye_walk(scene_, n, work_.stats), film_, pixel, sampler_, z);
            for (int t = 2; t <= z.size(); ++t)
                if (z[t - 1].is_connectible) points.push_back(z[t - 1].p);
        }
        return points;
    }

private:
    static constexpr uint64_t kChunk = 256;

    TechniqueCounts counts(uint64_t light_paths) const {
        TechniqueCounts n;
        n.hit = n.next_event = n.connect = 1;
        n.merge = float(light_paths);
        n.pairs.disc = kPi * radius_ * radius_;
        return n;
    }
    PassContext context(uint64_t light_paths) {
        return {.scene = scene_,
                .film = film_,
                .index = 0,
                .light_paths = light_paths,
                .pixels = scene_.film().pixel_count(),
                .seed = 0,
                .for_each_sample =
                    [this, light_paths](uint64_t count, const PassContext::Use& use) {
                        for (uint64_t i = 0; i < count; ++i) {
                            sampler_.start(0, i);
                            use({scene_, film_, film_.expected(), i, i / kChunk, light_paths,
                                 1 / float(light_paths), sampler_, sink_},
                                work_);
                        }
                    },
                .chunks = [](uint64_t samples) { return (samples + kChunk - 1) / kChunk; },
                .for_each_other_path = {},
                .for_each_chain = {}};
    }

    struct NoSink final : ContributionSink {
        void add(const Join&, Rgb) override {}
    };

    const Scene& scene_;
    Film film_;
    IntegratorSpec spec_;
    Bidirectional paths_;
    float radius_;
    Sampler sampler_{SamplerKind::Sobol, 0};
    NoSink sink_;
    Workspace work_;
};

/// The light vertices that eye vertices can find.
std::vector<PointGrid::Entry> entries_of(const LightVertexCache& paths) {
    std::vector<PointGrid::Entry> entries;
    for (uint32_t i = 0; i < paths.vertices().size(); ++i)
        if (paths.vertices()[i].is_connectible) entries.push_back({paths.vertices()[i].p, i});
    return entries;
}

/// Sums over queries.
struct Answers {
    double found = 0, candidates = 0;
};
Answers answer(const PointGrid& grid, const std::vector<Vec3>& queries, float radius) {
    uint64_t found = 0, candidates = 0;
    for (Vec3 p : queries) {
        grid.for_each_near(p, radius, [&](const PointGrid::Entry&) { ++found; });
        candidates += grid.candidates(p, radius);
    }
    return {double(found), double(candidates)};
}
double query_seconds(const PointGrid& grid, const std::vector<Vec3>& queries, float radius,
                     double least) {
    uint64_t sum = 0;
    const double seconds = processor_seconds_of(least, [&] {
        for (Vec3 p : queries)
            grid.for_each_near(p, radius, [&](const PointGrid::Entry& e) { sum += e.index; });
    });
    // Vertices that no query can find are left out.
    [[maybe_unused]] volatile uint64_t looked_at = sum;
    return seconds / double(queries.size());
}

/// Bytes in use on the heap, in its arenas or mapped separately.
double heap_bytes() {
    const struct mallinfo2 info = mallinfo2();
    return double(info.uordblks + info.hblkhd);
}

void measure_map(const Report& report, const Options& options, const Scene& scene,
                 const std::string& scene_name) {
    const std::string name = "photon map " + scene_name;
    if (!report.wants(name)) return;
    Walks walks(scene);
    const std::vector<Vec3> queries = walks.queries();
    const uint64_t light_paths = scene.film().pixel_count();
    const float radius = walks.radius();

    const double heap_before = heap_bytes();
    LightVertexCache paths;
    PointGrid grid;
    walks.keep(light_paths, paths);
    grid.build(entries_of(paths), radius);
    const double held = heap_bytes() - heap_before;
    const std::vector<PointGrid::Entry> entries = entries_of(paths);
    const double vertices = double(paths.vertices().size()), photons = double(entries.size());
    const Answers answers = answer(grid, queries, radius);

    struct Run {
        double trace, keep, build, query;
    };
    const double least = options.seconds / 4;
    const auto runs = repeat(options.repeats, [&] {
        Run run;
        run.trace = processor_seconds_of(least, [&] { walks.trace(light_paths); });
        run.keep = processor_seconds_of(least, [&] { walks.keep(light_paths, paths); });
        run.build = processor_seconds_of(least, [&] { grid.build(entries, radius); });
        run.query = query_seconds(grid, queries, radius, least);
        return run;
    });
    const auto bytes = [&](const char* figure, double value) {
        return Figure{figure, "bytes/photon", false, {value / photons}};
    };
    report.add(
        name,
        {{"keep_over_trace", "1", false, each(runs, [](const Run& r) { return r.keep / r.trace; })},
         {"build_over_trace", "1", false,
          each(runs, [](const Run& r) { return r.build / r.trace; })},
         {"query_over_vertex_traced", "1", false,
          each(runs, [&](const Run& r) { return r.query / (r.trace / vertices); })},
         {"trace", "ns/photon", false,
          each(runs, [&](const Run& r) { return 1e9 * r.trace / photons; })},
         {"keep", "ns/photon", false,
          each(runs, [&](const Run& r) { return 1e9 * (r.keep - r.trace) / photons; })},
         {"build", "ns/photon", false,
          each(runs, [&](const Run& r) { return 1e9 * r.build / photons; })},
         {"query", "ns", false, each(runs, [](const Run& r) { return 1e9 * r.query; })},
         {"query_per_candidate", "ns", false,
          each(runs,
               [&](const Run& r) {
                   return 1e9 * r.query * double(queries.size()) / answers.candidates;
               })},
         bytes("light_paths", double(paths.memory_bytes())),
         bytes("grid", double(grid.memory_bytes())),
         bytes("held_in_all", held)},
        {{"light_paths", light_paths},
         {"vertices", vertices},
         {"photons", photons},
         {"radius", radius},
         {"queries", queries.size()},
         {"candidates_a_query", answers.candidates / double(queries.size())},
         {"found_a_query", answers.found / double(queries.size())}});
}

// ------------------------------------------------------------------------------------------------- growth

struct GridSize {
    double photons, radius;
};

/// Of y over x.
double exponent(const std::vector<double>& x, const std::vector<double>& y) {
    return fit_power_law(x, y).value().slope;
}

/// The grid alone, by photons at one radius and by radius with all photons.
void measure_growth(const Report& report, const Options& options, const Scene& scene,
                    const std::string& scene_name) {
    const std::string name = "growth " + scene_name;
    if (!report.wants(name)) return;
    Walks walks(scene);
    const std::vector<Vec3> queries = walks.queries();
    const int smallest = options.quick ? 12 : 14, largest = smallest + 6;
    const double most = std::exp2(largest), radius = walks.radius();
    std::vector<GridSize> by_photons, by_radius;
    for (int log2 = smallest; log2 <= largest; log2 += 2)
        by_photons.push_back({std::exp2(log2), radius});
    for (double scale : {0.25, 0.5, 1.0, 2.0, 4.0}) by_radius.push_back({most, scale * radius});

    std::vector<PointGrid::Entry> entries;
    for (uint64_t light_paths = 1024; double(entries.size()) < most; light_paths *= 2) {
        LightVertexCache paths;
        walks.keep(light_paths, paths);
        entries = entries_of(paths);
    }
    PointGrid grid;
    const auto build = [&](const GridSize& size) {
        grid.build({entries.data(), size_t(size.photons)}, float(size.radius));
    };
    const double least = options.seconds / 20;

    const auto measure = [&](const std::vector<GridSize>& sizes, const char* unit,
                             double GridSize::*variable) {
        /// Seconds, by size.
        struct Run {
            std::vector<double> build, query;
        };
        const auto runs = repeat(options.repeats, [&] {
            Run run;
            for (const GridSize& size : sizes) {
                run.build.push_back(processor_seconds_of(least, [&] { build(size); }));
                run.query.push_back(query_seconds(grid, queries, float(size.radius), least));
            }
            return run;
        });
        std::vector<double> x;
        for (const GridSize& size : sizes) x.push_back(size.*variable);
        for (size_t i = 0; i < sizes.size(); ++i) {
            build(sizes[i]);
            const Answers a = answer(grid, queries, float(sizes[i].radius));
            report.add(
                fmt::format("{} {}={:.7g}", name, unit, x[i]),
                {{"build", "ns/photon", false,
                  each(runs, [&](const Run& r) { return 1e9 * r.build[i] / sizes[i].photons; })},
                 {"query", "ns", false,
                  each(runs, [&](const Run& r) { return 1e9 * r.query[i]; })}},
                {{"candidates_a_query", a.candidates / double(queries.size())},
                 {"found_a_query", a.found / double(queries.size())}});
        }
        report.add(fmt::format("{} with {}", name, unit),
                   {{"exponent_of_build", "1", false,
                     each(runs, [&](const Run& r) { return exponent(x, r.build); })},
                    {"exponent_of_query", "1", false,
                     each(runs, [&](const Run& r) { return exponent(x, r.query); })}});
    };
    measure(by_photons, "photons", &GridSize::photons);
    measure(by_radius, "radius", &GridSize::radius);
}

}  // namespace
}  // namespace etendue::bench

int main(int argc, char** argv) {
    using namespace etendue::bench;
    const Options options = Options::parse(argc, argv);
    const Report report("photons", options);
    SceneFile file = shared_scene("staircase2-mts3", "staircase2");
    if (!std::filesystem::exists(file.path)) file = own_scene("ajar");
    const auto scene = load_or_skip(report, file, {{256, 256}});
    if (!scene) return 0;
    measure_gather_cost(report, options, *scene, file.name);
    measure_map(report, options, *scene, file.name);
    measure_growth(report, options, *scene, file.name);
}
