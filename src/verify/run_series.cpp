#include "verify/run_series.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <thread>

#include <fmt/format.h>

#include "math/hash.h"
#include "render/warnings.h"
#include "system/threads.h"
#include "verify/verify.h"

namespace etendue {
namespace {

/// Samples of the short pilot renderings that measure time and edge lengths.
constexpr uint64_t kPilotSamples = 20000;
/// δ is chosen so that this share of the light comes along paths whose shortest edge is shorter.
constexpr double kShortShare = 0.2;

/// Throws VerifyInterrupted if the rendering does not reach its end.
void render_all(Renderer& renderer, const std::atomic<bool>* interrupted) {
    const std::atomic<bool> never{false};
    const std::atomic<bool>& stop = interrupted ? *interrupted : never;
    const StopReason reason = renderer.run([](const Progress&) {}, stop, stop);
    if (reason == StopReason::Interrupted) throw VerifyInterrupted();
}

/// Shortest edge and contribution of every path of a rendering, by path length.
class ShortestEdges final : public ContributionObserver {
public:
    ShortestEdges(const Scene& scene, int longest) : scene_(scene), lengths_(size_t(longest) + 1) {}
    void observe(const Join& join, Rgb contribution, float share, const FilmTarget&,
                 const Workspace& paths) override {
        const Technique& q = join.technique;
        const SubPath& y = paths.light_side(q);
        lengths_[size_t(q.vertices() - 1)].emplace_back(
            shortest_edge(scene_, join, y, paths.z),
            double(luminance(contribution) * join.mis_weight * share));
    }
    /// The weighted quantile of the shortest edge: `share` of the light comes along paths with a shorter one. 0 where
    /// there is none.
    float quantile(size_t edges, double share) {
        auto& paths = lengths_[edges];
        std::sort(paths.begin(), paths.end());
        double total = 0, sum = 0;
        for (const auto& [edge, light] : paths) total += light;
        for (const auto& [edge, light] : paths)
            if ((sum += light) > share * total) return std::isfinite(edge) ? edge : 0.0f;
        return 0;
    }

private:
    const Scene& scene_;
    std::vector<std::vector<std::pair<float, double>>> lengths_;
};

/// Calls task(i) for i < count on up to `threads` threads, of which this one is the first; on fewer if there can be no further
/// one. If a task throws, no further tasks start and the exception is rethrown.
template <class Task>
void for_each_in_parallel(size_t count, int threads, const Task& task) {
    std::atomic<size_t> next{0};
    std::mutex mutex;
    std::exception_ptr error;
    const auto work = [&] {
        for (size_t i; (i = next++) < count;) {
            try {
                task(i);
            } catch (...) {
                const std::scoped_lock lock(mutex);
                if (!error) error = std::current_exception();
                next = count;
            }
        }
    };
    {
        std::vector<std::jthread> workers;
        try {
            for (int i = 1; i < std::min(threads, int(count)); ++i) workers.emplace_back(work);
        } catch (const std::exception&) {  // No memory for it.
        }
        work();
    }
    if (error) std::rethrow_exception(error);
}

}  // namespace

void IndependentRun::merge(const IndependentRun& other, uint64_t renderings) {
    const double its = 1 / double(renderings), own = 1 - its;
    for (size_t i = 0; i < pixels.size(); ++i)
        pixels[i] = pixels[i] * float(own) + other.pixels[i] * float(its);
    stats += other.stats;

    // Entries are sorted, see ContributionTally::entries().
    for (ContributionTally::Entry& e : entries) e = e.scaled(own);
    for (const ContributionTally::Entry& e : other.entries) {
        const auto at = std::lower_bound(entries.begin(), entries.end(), e);
        if (at != entries.end() && !(e < *at))
            *at += e.scaled(its);
        else
            entries.insert(at, e.scaled(its));
    }
    for (auto& [c, tally] : classes) tally = tally.scaled(own);
    for (const auto& [c, tally] : other.classes) classes[c] += tally.scaled(its);
    for (auto& [c, sums] : tiles)
        for (ContributionTally::TileSum& t : sums) {
            for (double& v : t.rgb) v *= own;
            t.luminance = t.luminance.scaled(own);
        }
    for (const auto& [c, sums] : other.tiles) {
        auto& to = tiles[c];
        to.resize(sums.size());
        for (size_t i = 0; i < sums.size(); ++i) {
            for (size_t k = 0; k < 3; ++k) to[i].rgb[k] += sums[i].rgb[k] * its;
            to[i].luminance += sums[i].luminance.scaled(its);
        }
    }
}

RenderStats RunSeries::stats() const {
    RenderStats sum;
    for (const IndependentRun& r : runs) sum += r.stats;
    return sum;
}

std::map<PathClass, Tally> RunSeries::classes() const {
    std::map<PathClass, Tally> out;
    for (const IndependentRun& r : runs)
        for (const auto& [c, tally] : r.classes) out[c] += tally;
    for (auto& [c, tally] : out)
        tally = tally.with_count_of_at_most(
            most_contributions(moments([&, &c = c](const auto& r) { return r.light(c); })));
    return out;
}

SeriesRenderer::SeriesRenderer(const Scene& scene, const VerifyOptions& options,
                               const Report& progress)
    : scene_(scene), options_(options),
      progress_(progress), grid_{scene.film(), std::min({options.tiles, scene.film().crop_width,
                                                         scene.film().crop_height})},
      cut_offs_(size_t(options.longest) + 1) {}

int SeriesRenderer::threads(const IntegratorSpec& spec) const {
    return spec.make ? 1 : thread_count(options_.threads);
}

uint64_t SeriesRenderer::pilot_spp() const {
    return 1 + kPilotSamples / scene_.film().pixel_count();
}

uint64_t SeriesRenderer::seed(const RunSeries& series, uint64_t run, uint64_t rendering) const {
    return hash_combine(hash_combine(hash_combine(options_.seed, series.stream), run), rendering);
}

Renderer SeriesRenderer::renderer(const IntegratorSpec& spec, uint64_t seed, uint64_t spp,
                                  ContributionObserver* observer) const {
    RenderSettings settings;
    settings.integrator = spec;
    settings.sampler = options_.sampler;
    settings.seed = seed;
    settings.threads = 1;
    settings.spp = spp;
    settings.observer = observer;
    return Renderer(scene_, settings);
}

void SeriesRenderer::choose_cut_offs(const IntegratorSpec& spec) {
    ShortestEdges edges(scene_, options_.longest);
    Renderer pilot = renderer(spec, hash_combine(options_.seed, 0), pilot_spp(), &edges);
    render_all(pilot, options_.interrupted);
    for (size_t i = 0; i < cut_offs_.size(); ++i) cut_offs_[i] = edges.quantile(i, kShortShare);
}

double SeriesRenderer::seconds_a_pass(const IntegratorSpec& spec, uint64_t seed) const {
    ContributionTally tally(scene_, grid_, cut_offs_);
    Renderer pilot = renderer(spec, seed, pilot_spp(), &tally);
    render_all(pilot, options_.interrupted);
    return pilot.seconds() / double(pilot_spp());
}

IndependentRun SeriesRenderer::render(const IntegratorSpec& spec, uint64_t seed,
                                      uint64_t spp) const {
    ContributionTally tally(scene_, grid_, cut_offs_);
    Renderer r = renderer(spec, seed, spp, &tally);
    render_all(r, options_.interrupted);
    const double scale = 1 / (double(spp) * double(scene_.film().pixel_count()));
    IndependentRun out{r.film().image(), tally.entries(), tally.tiles(), {}, r.stats()};
    for (ContributionTally::Entry& e : out.entries) {
        e = e.scaled(scale);
        out.classes[e.path_class.without_length_of_edges()] += e.weighted;
    }
    for (auto& [path_class, tiles] : out.tiles)
        for (ContributionTally::TileSum& t : tiles) {
            for (double& v : t.rgb) v *= scale;
            t.luminance = t.luminance.scaled(scale);
        }
    return out;
}

RunSeries SeriesRenderer::begin(const IntegratorSpec& spec, uint64_t stream,
                                std::optional<uint64_t> spp, double seconds) const {
    const std::shared_ptr<Integrator> integrator = make_integrator(spec);
    if (!integrator->keeps_paths())
        throw std::runtime_error(fmt::format(
            "{} cannot be verified, since its photons do not store their paths; use compare",
            spec.name));
    RunSeries series;
    series.spec = spec;
    series.stream = stream;
    const uint64_t light_paths = integrator->light_paths(scene_);
    series.counts = integrator->counts(scene_, light_paths);
    series.uses = [this, integrator, light_paths](const Technique& q) {
        return integrator->uses(q, scene_, light_paths);
    };
    series.estimator = integrator->estimator();
    series.has_chains = integrator->error_groups() > 0;
    series.runs.resize(size_t(options_.runs));
    // Each thread has a rendering of its own.
    if (const std::optional<uint64_t> available = available_memory())
        series.memory_warnings = memory_warnings(scene_, spec.name, *integrator, light_paths,
                                                 *available / uint64_t(threads(spec)));
    if (spp) {
        series.spp = *spp;
    } else {
        const double share = seconds * std::min(threads(spec), options_.runs) / options_.runs;
        const double pass = seconds_a_pass(spec, seed(series, uint64_t(options_.runs), 0));
        series.spp = std::max(uint64_t(1), uint64_t(share / pass));
    }
    return series;
}

void SeriesRenderer::extend(RunSeries& series, uint64_t renderings) const {
    using Clock = std::chrono::steady_clock;
    const size_t runs = series.runs.size();
    const uint64_t wanted = series.renderings + renderings;
    std::mutex mutex;
    size_t done = 0;
    // One rendering in every run at a time, so that all runs are equally long whenever this ends.
    while (series.renderings < wanted) {
        const auto begin = Clock::now();
        std::vector<IndependentRun> more(runs);
        for_each_in_parallel(runs, threads(series.spec), [&](size_t i) {
            more[i] = render(series.spec, seed(series, i, series.renderings), series.spp);
            const std::scoped_lock lock(mutex);
            ++done;
            if (progress_)
                progress_(fmt::format("{}: {} of {} runs of {} spp", series.spec.to_string(),
                                      done / renderings, runs, series.spp * wanted));
        });
        ++series.renderings;
        for (size_t i = 0; i < runs; ++i)
            if (series.renderings == 1)
                series.runs[i] = std::move(more[i]);
            else
                series.runs[i].merge(more[i], series.renderings);
        series.seconds += std::chrono::duration<double>(Clock::now() - begin).count();
    }
}

}  // namespace etendue
