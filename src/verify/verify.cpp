#include "verify/verify.h"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <thread>

#include <fmt/format.h>

#include "math/hash.h"

namespace etendue {
namespace {

/// Samples of the first, short rendering that tells times and edge lengths.
constexpr uint64_t kPilotSamples = 20000;
/// δ is the length that the shortest edge of this share of the light does not reach.
constexpr double kShortShare = 0.2;

using TileMeans = std::vector<std::array<double, 3>>;  ///< Of every tile, then of the image.

/// One rendering with a seed of its own, brought to means per pixel and pass.
struct Run {
    std::vector<Rgb> pixels;
    std::vector<ContributionTally::Entry> entries;
    std::map<PathClass, std::vector<ContributionTally::TileSum>> tiles;
    uint64_t rejected = 0;
};

/// All runs of one method.
struct Series {
    TechniqueCounts counts;
    Estimator estimator = Estimator::Unbiased;
    uint64_t spp = 0;
    std::vector<Run> runs;
};

/// The methods share a scene, the options and δ.
class Runner {
public:
    Runner(const Scene& scene, const VerifyOptions& options,
           const std::function<void(const std::string&)>& progress)
        : scene_(scene), options_(options),
          progress_(progress), grid_{scene.film(), std::min({options.tiles, scene.film().crop_width,
                                                             scene.film().crop_height})},
          cut_offs_(size_t(options.longest) + 1) {}

    const TileGrid& grid() const { return grid_; }
    /// δ by path length.
    const std::vector<float>& cut_offs() const { return cut_offs_; }
    /// Finds them from a short rendering by the method.
    void choose_cut_offs(const IntegratorSpec& spec);
    /// Every run of the method; `stream` tells its random numbers from those of the others.
    Series render(const IntegratorSpec& spec, uint64_t stream) const;

private:
    Renderer renderer(const IntegratorSpec& spec, uint64_t stream, uint64_t run, uint64_t spp,
                      ContributionObserver* observer) const;
    Run render_run(const IntegratorSpec& spec, uint64_t stream, uint64_t run, uint64_t spp) const;
    uint64_t choose_spp(const IntegratorSpec& spec, uint64_t stream) const;
    uint64_t pilot_spp() const { return 1 + kPilotSamples / scene_.film().pixel_count(); }
    int threads() const {
        return options_.threads > 0 ? options_.threads
                                    : std::max(1, int(std::thread::hardware_concurrency()));
    }

    const Scene& scene_;
    const VerifyOptions& options_;
    const std::function<void(const std::string&)>& progress_;
    TileGrid grid_;
    std::vector<float> cut_offs_;
};

void render_all(Renderer& renderer) {
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
}

Renderer Runner::renderer(const IntegratorSpec& spec, uint64_t stream, uint64_t run, uint64_t spp,
                          ContributionObserver* observer) const {
    RenderSettings settings;
    settings.integrator = spec;
    settings.seed = hash_combine(hash_combine(options_.seed, stream), run);
    settings.threads = 1;
    settings.spp = spp;
    settings.observer = observer;
    return Renderer(scene_, settings);
}

void Runner::choose_cut_offs(const IntegratorSpec& spec) {
    struct Edges {
        std::vector<std::pair<float, double>> shortest;  // and the light it brings
        double total = 0;
    };
    struct EdgeObserver final : ContributionObserver {
        EdgeObserver(const Scene& s, int longest) : scene(s), lengths(size_t(longest) + 1) {}
        void observe(const Join& join, Rgb contribution, float share, uint64_t,
                     const Workspace& paths) override {
            const double light = double(luminance(contribution) * join.mis_weight * share);
            Edges& edges = lengths[size_t(join.technique.vertices() - 1)];
            edges.shortest.emplace_back(shortest_edge(scene, join, paths.y, paths.z), light);
            edges.total += light;
        }
        const Scene& scene;
        std::vector<Edges> lengths;
    } observer(scene_, options_.longest);
    Renderer pilot = renderer(spec, 0, 0, pilot_spp(), &observer);
    render_all(pilot);
    for (size_t i = 0; i < observer.lengths.size(); ++i) {
        Edges& edges = observer.lengths[i];
        std::sort(edges.shortest.begin(), edges.shortest.end());
        double sum = 0;
        const auto delta =
            std::find_if(edges.shortest.begin(), edges.shortest.end(), [&](const auto& edge) {
                return (sum += edge.second) > kShortShare * edges.total;
            });
        if (delta != edges.shortest.end() && std::isfinite(delta->first))
            cut_offs_[i] = delta->first;
    }
}

/// From the time of a rendering that is thrown away: the number must not depend on the values that are compared.
uint64_t Runner::choose_spp(const IntegratorSpec& spec, uint64_t stream) const {
    if (options_.spp) return *options_.spp;
    ContributionTally tally(scene_, grid_, cut_offs_);
    Renderer pilot = renderer(spec, stream, uint64_t(options_.runs), pilot_spp(), &tally);
    render_all(pilot);
    const double pass = pilot.seconds() / double(pilot_spp());
    const double share = options_.seconds * std::min(threads(), options_.runs) / options_.runs;
    return std::max(uint64_t(1), uint64_t(share / pass));
}

Run Runner::render_run(const IntegratorSpec& spec, uint64_t stream, uint64_t run,
                       uint64_t spp) const {
    ContributionTally tally(scene_, grid_, cut_offs_);
    Renderer r = renderer(spec, stream, run, spp, &tally);
    render_all(r);
    const double scale = 1 / (double(spp) * double(scene_.film().pixel_count()));
    const auto scaled = [&](Tally t) { return t.scaled(scale); };
    Run out{r.film().image(), tally.entries(), tally.tiles(),
            r.stats().rejected + r.film().rejected()};
    for (ContributionTally::Entry& e : out.entries)
        e.weighted = scaled(e.weighted), e.alone = scaled(e.alone);
    for (auto& [path_class, tiles] : out.tiles)
        for (ContributionTally::TileSum& t : tiles) {
            for (double& v : t.rgb) v *= scale;
            t.luminance = scaled(t.luminance);
        }
    return out;
}

Series Runner::render(const IntegratorSpec& spec, uint64_t stream) const {
    const auto integrator = make_integrator(spec);
    if (!integrator->keeps_paths())
        throw std::runtime_error(fmt::format(
            "{} cannot be verified: its photons do not keep their paths; use compare", spec.name));
    Series series;
    series.counts = integrator->counts(scene_, integrator->light_paths(scene_));
    series.estimator = integrator->estimator();
    series.spp = choose_spp(spec, stream);
    series.runs.resize(size_t(options_.runs));
    for (int first = 0; first < options_.runs; first += threads()) {
        if (progress_)
            progress_(fmt::format("{}: {} of {} runs of {} spp", spec.to_string(), first,
                                  options_.runs, series.spp));
        std::vector<std::jthread> workers;
        for (int run = first; run < std::min(options_.runs, first + threads()); ++run)
            workers.emplace_back([&, run] {
                series.runs[size_t(run)] = render_run(spec, stream, uint64_t(run), series.spp);
            });
    }
    return series;
}

/// Means of the tiles and of the image.
TileMeans tile_means(const std::vector<Rgb>& pixels, const TileGrid& grid) {
    TileMeans sums(grid.tiles() + 1);
    std::vector<double> counts(grid.tiles() + 1);
    for (uint64_t i = 0; i < pixels.size(); ++i)
        for (const size_t part : {grid.tile(i), grid.tiles()}) {
            ++counts[part];
            for (int c = 0; c < 3; ++c) sums[part][size_t(c)] += double(pixels[i][c]);
        }
    for (size_t i = 0; i < sums.size(); ++i)
        for (double& v : sums[i]) v /= counts[i];
    return sums;
}

PathClass without_length_of_edges(PathClass c) {
    c.has_short_edge = false;
    return c;
}

/// The classes of two series' paths.
class CommonClasses {
public:
    CommonClasses(const Series& method, const Series& reference) {
        gather(method, &Found::method);
        gather(reference, &Found::reference);
        for (auto& [c, f] : found_) {
            f.is_reachable = can_make(method.counts, c) && can_make(reference.counts, c);
            f.is_common = f.is_reachable && f.effective_count() >= kEnoughContributions;
        }
    }
    bool contains(PathClass c) const {
        const auto f = found_.find(without_length_of_edges(c));
        return f != found_.end() && f->second.is_common;
    }

    /// Shares of the light of the paths with `edges`, 0 for all, that are left out.
    struct LeftOut {
        double out_of_reach = 0, too_rare = 0;
    };
    LeftOut left_out(int edges) const {
        LeftOut out;
        double total = 0;
        for (const auto& [c, f] : found_) {
            if (edges != 0 && c.edges != edges) continue;
            const double light = std::max(f.method.sum, f.reference.sum);
            total += light;
            if (!f.is_reachable)
                out.out_of_reach += light;
            else if (!f.is_common)
                out.too_rare += light;
        }
        if (total > 0) out.out_of_reach /= total, out.too_rare /= total;
        return out;
    }
    double effective_count(int edges) const {
        Found all;
        for (const auto& [c, f] : found_)
            if (f.is_common && c.edges == edges)
                all.method += f.method, all.reference += f.reference;
        return all.effective_count();
    }

private:
    struct Found {
        Tally method, reference;
        bool is_reachable = false, is_common = false;
        double effective_count() const {
            return std::min(method.effective_count(), reference.effective_count());
        }
    };
    void gather(const Series& series, Tally Found::*side) {
        for (const Run& r : series.runs)
            for (const ContributionTally::Entry& e : r.entries)
                found_[without_length_of_edges(e.path_class)].*side += e.weighted;
    }
    std::map<PathClass, Found> found_;
};

/// Spread over the runs of `value(run)`.
template <class Value>
Moments over_runs(const Series& series, const Value& value) {
    Moments m;
    for (const Run& r : series.runs) m.add(value(r));
    return m;
}

Comparison compare(const Moments& method, const Moments& reference, double effective_count) {
    return {method, reference, effective_count,
            welch_p(method, reference, kRounding * std::fabs(reference.mean()))};
}

/// Tiles and image of a series, without the classes that are not common.
struct TileSeries {
    std::vector<std::array<Moments, 3>> means;
    std::vector<Tally> tallies;
};

/// `common` is nullptr where nothing is to be left out.
TileSeries tile_series(const Series& series, const TileGrid& grid, const CommonClasses* common) {
    TileSeries out{std::vector<std::array<Moments, 3>>(grid.tiles() + 1),
                   std::vector<Tally>(grid.tiles() + 1)};
    std::vector<double> pixels(grid.tiles() + 1);
    const double all = double(grid.film.pixel_count());
    for (uint64_t i = 0; i < grid.film.pixel_count(); ++i) ++pixels[grid.tile(i)];
    pixels.back() = all;
    for (const Run& run : series.runs) {
        TileMeans means = tile_means(run.pixels, grid);
        for (const auto& [c, tiles] : run.tiles) {
            const bool is_common = !common || common->contains(c);
            for (size_t i = 0; i < tiles.size(); ++i)
                for (const size_t part : {i, grid.tiles()}) {
                    if (is_common) {
                        out.tallies[part] += tiles[i].luminance;
                        continue;
                    }
                    for (size_t k = 0; k < 3; ++k)
                        means[part][k] -= tiles[i].rgb[k] * all / pixels[part];
                }
        }
        for (size_t i = 0; i < means.size(); ++i)
            for (size_t k = 0; k < 3; ++k) out.means[i][k].add(means[i][k]);
    }
    return out;
}

TileSeries tile_series(const ReferenceImage& image, const TileGrid& grid) {
    const TileMeans means = tile_means(image.pixels, grid);
    TileMeans errors = tile_means(image.variance, grid);
    std::vector<double> pixels(grid.tiles() + 1);
    for (uint64_t i = 0; i < image.pixels.size(); ++i) ++pixels[grid.tile(i)], ++pixels.back();
    TileSeries out{std::vector<std::array<Moments, 3>>(means.size()),
                   std::vector<Tally>(means.size(), Tally{1, 0x1p-40, 0x1p-120})};
    for (size_t i = 0; i < means.size(); ++i)
        for (size_t k = 0; k < 3; ++k)
            out.means[i][k] =
                Moments::estimate(means[i][k], errors[i][k] / pixels[i], image.samples);
    return out;
}

void compare_images(const TileSeries& method, const TileSeries& reference, MethodReport& report) {
    for (size_t i = 0; i < method.means.size(); ++i) {
        const double effective =
            std::min(method.tallies[i].effective_count(), reference.tallies[i].effective_count());
        for (size_t k = 0; k < 3; ++k)
            (i + 1 < method.means.size() ? report.tiles : report.image)
                .push_back(compare(method.means[i][k], reference.means[i][k], effective));
    }
    // What is too rare in some tiles may be missing from others, unseen: a tile without it looks well sampled, and dark.
    double all = 0, untested = 0;
    for (const Comparison& c : report.tiles) {
        all += c.reference.mean();
        if (!c.is_tested()) untested += c.reference.mean();
    }
    if (untested > kTooMuchUntested * all)
        for (Comparison& c : report.tiles) c.effective_count = 0;
}

void compare_lengths(const Series& method, const Series& reference, const CommonClasses& common,
                     const VerifyOptions& options, const std::vector<float>& cut_offs,
                     MethodReport& report) {
    const auto light = [](const Run& run, const auto& belongs) {
        double sum = 0;
        for (const ContributionTally::Entry& e : run.entries)
            if (belongs(e.path_class)) sum += e.weighted.sum;
        return sum;
    };
    const auto everything = over_runs(
        reference, [&](const Run& r) { return light(r, [](PathClass) { return true; }); });
    for (int edges = options.shortest; edges <= options.longest; ++edges) {
        const auto of_length = [&](const Series& s, bool only_common) {
            return over_runs(s, [&](const Run& r) {
                return light(r, [&](PathClass c) {
                    return c.edges == edges && (!only_common || common.contains(c));
                });
            });
        };
        const auto left = common.left_out(edges);
        report.lengths.push_back({edges, cut_offs[size_t(edges)],
                                  of_length(reference, false).mean() / everything.mean(),
                                  left.out_of_reach, left.too_rare,
                                  compare(of_length(method, true), of_length(reference, true),
                                          common.effective_count(edges))});
    }
}

TechniqueReport compare_technique(const Technique& q, const Series& method,
                                  const Series& reference) {
    struct Found {
        Tally alone, expected;
    };
    const auto times_made = [&](const PathClass& c) {
        return double(etendue::times_made(q, c, method.counts.pairs.rule));
    };
    std::map<PathClass, Found> found;
    double length_total = 0;
    for (const Run& r : method.runs)
        for (const ContributionTally::Entry& e : r.entries)
            if (e.technique == q && !e.path_class.has_short_edge)
                found[e.path_class].alone += e.alone;
    for (const Run& r : reference.runs)
        for (const ContributionTally::Entry& e : r.entries) {
            if (e.technique.vertices() != q.vertices()) continue;
            length_total += e.weighted.sum;
            if (!e.path_class.has_short_edge && can_make(q, e.path_class))
                found[e.path_class].expected += e.weighted.scaled(times_made(e.path_class));
        }
    std::set<PathClass> classes;
    Found all;
    double covered = 0;
    for (const auto& [c, f] : found) {
        if (!can_make(reference.counts, c)) continue;
        if (f.alone.effective_count() < kEnoughAlone ||
            f.expected.effective_count() < kEnoughContributions)
            continue;
        classes.insert(c);
        all.alone += f.alone, all.expected += f.expected;
        covered += f.expected.sum / times_made(c);
    }
    const auto mean = [&](const Series& s, const auto& value) {
        return over_runs(s, [&](const Run& r) {
            double sum = 0;
            for (const ContributionTally::Entry& e : r.entries)
                if (classes.contains(e.path_class)) sum += value(e);
            return sum;
        });
    };
    return {
        q, length_total > 0 ? covered / length_total : 0.0,
        compare(mean(method, [&](const auto& e) { return e.technique == q ? e.alone.sum : 0.0; }),
                mean(reference,
                     [&](const auto& e) { return e.weighted.sum * times_made(e.path_class); }),
                std::min(all.alone.effective_count(), all.expected.effective_count()))};
}

/// The picture that errors are measured from, and the variance of it; both by channel.
struct ErrorReference {
    std::vector<std::array<Moments, 3>> pixels;

    explicit ErrorReference(const Series& series) : pixels(series.runs[0].pixels.size()) {
        for (const Run& r : series.runs)
            for (size_t i = 0; i < pixels.size(); ++i)
                for (int c = 0; c < 3; ++c) pixels[i][size_t(c)].add(double(r.pixels[i][c]));
    }
    explicit ErrorReference(const ReferenceImage& image) : pixels(image.pixels.size()) {
        for (size_t i = 0; i < pixels.size(); ++i)
            for (int c = 0; c < 3; ++c)
                pixels[i][size_t(c)] = Moments::estimate(
                    double(image.pixels[i][c]), double(image.variance[i][c]), image.samples);
    }
};

/// RMSE of the mean of 1, 2, 4 … runs [Qin et al. 2015, fig. 7], each over as many groups of runs as there are.
std::vector<ErrorOfRuns> errors_of_runs(const Series& series, const ErrorReference& reference) {
    std::vector<ErrorOfRuns> out;
    const size_t pixels = reference.pixels.size();
    double noise = 0;
    for (const auto& p : reference.pixels)
        for (const Moments& m : p) noise += m.squared_error() / double(3 * pixels);
    for (size_t n = 1; n <= series.runs.size(); n *= 2) {
        const size_t groups = series.runs.size() / n;
        double mse = 0;
        for (size_t g = 0; g < groups; ++g)
            for (size_t i = 0; i < pixels; ++i)
                for (int c = 0; c < 3; ++c) {
                    double sum = 0;
                    for (size_t r = g * n; r < (g + 1) * n; ++r)
                        sum += double(series.runs[r].pixels[i][c]);
                    mse += sqr(sum / double(n) - reference.pixels[i][size_t(c)].mean());
                }
        mse = mse / double(groups * 3 * pixels) - noise;
        // Below the reference's own noise nothing is seen.
        if (mse < noise) break;
        out.push_back({int(n), std::sqrt(mse)});
    }
    return out;
}

/// Least squares in logarithms.
std::optional<double> slope_of(const std::vector<ErrorOfRuns>& errors) {
    if (errors.size() < 4) return {};
    double x = 0, y = 0, xx = 0, xy = 0;
    for (const ErrorOfRuns& e : errors) {
        const double u = std::log(e.runs), v = std::log(e.rmse);
        x += u, y += v, xx += u * u, xy += u * v;
    }
    const double n = double(errors.size());
    return (n * xy - x * y) / (n * xx - x * x);
}

IntegratorSpec limited(IntegratorSpec spec, int longest) {
    if (!spec.params.emplace("max_depth", std::to_string(longest)).second)
        throw std::runtime_error(fmt::format(
            "{}: max_depth must not be given: the path lengths that are compared set it",
            spec.to_string()));
    return spec;
}

/// Roulette before shadow rays thins by the weighted contribution: it leaves a technique alone, where its weight is
/// small, rare values without bound. So techniques are looked at without it. Nothing where `spec` has none.
std::optional<IntegratorSpec> without_join_roulette(IntegratorSpec spec) {
    for (const IntegratorEntry& e : integrator_registry())
        for (const ParamInfo& p : e.info.params)
            if (e.info.name == spec.name && p.name == std::string("roulette") &&
                spec.params.emplace(p.name, "0").second)
                return spec;
    return {};
}

}  // namespace

const char* to_string(Verdict verdict) {
    switch (verdict) {
    case Verdict::Consistent: return "consistent";
    case Verdict::Deviates: return "deviates";
    case Verdict::Undecided: return "undecided";
    }
    return "";
}

bool Comparison::is_tested() const {
    return effective_count >= kEnoughContributions && (method.mean() != 0 || reference.mean() != 0);
}

double Comparison::ratio_error() const {
    return std::sqrt(method.squared_error() + sqr(ratio()) * reference.squared_error()) /
           std::fabs(reference.mean());
}

double Comparison::detectable(double level) const {
    const double error = std::sqrt(method.squared_error() + reference.squared_error());
    if (!(error > 0)) return kRounding;
    const double dof = welch_dof(method, reference);
    // One-sided: the tail of student_quantile() counts both.
    return kRounding + (student_quantile(level, dof) + student_quantile(0.2, dof)) * error /
                           std::fabs(reference.mean());
}

Verdict VerifyReport::verdict(const MethodReport& method) const {
    bool any = false, deviating = false;
    method.for_each_tested([&](const Comparison& c) {
        any = true;
        deviating |= deviates(c);
    });
    if (!any || method.too_rare > kTooMuchTooRare) return Verdict::Undecided;
    return deviating ? Verdict::Deviates : Verdict::Consistent;
}

VerifyReport verify(const Scene& scene, const std::vector<IntegratorSpec>& methods,
                    const VerifyOptions& options, const std::optional<ReferenceImage>& reference,
                    const std::function<void(const std::string&)>& progress) {
    Runner runner(scene, options, progress);
    VerifyReport report;
    std::optional<Series> against;
    if (reference) {
        report.reference = reference->name;
    } else {
        // Roulette, too, is to be verified: the reference does without.
        IntegratorSpec spec = limited(options.against, options.longest);
        spec.params.emplace("rr_depth", std::to_string(options.longest + 1));
        report.reference = spec.to_string();
        for (const IntegratorSpec& m : methods) make_integrator(limited(m, options.longest));
        runner.choose_cut_offs(spec);
        against = runner.render(spec, 1);
    }
    const ErrorReference error_reference =
        reference ? ErrorReference(*reference) : ErrorReference(*against);

    for (size_t i = 0; i < methods.size(); ++i) {
        const Series series = runner.render(
            reference ? methods[i] : limited(methods[i], options.longest), 2 + uint64_t(i));
        MethodReport m;
        m.method = methods[i].to_string();
        m.estimator = series.estimator;
        m.spp = series.spp;
        for (const Run& r : series.runs) m.rejected += r.rejected;
        if (reference) {
            compare_images(tile_series(series, runner.grid(), nullptr),
                           tile_series(*reference, runner.grid()), m);
        } else {
            const CommonClasses common(series, *against);
            const auto left = common.left_out(0);
            m.out_of_reach = left.out_of_reach;
            m.too_rare = left.too_rare;
            compare_images(tile_series(series, runner.grid(), &common),
                           tile_series(*against, runner.grid(), &common), m);
            compare_lengths(series, *against, common, options, runner.cut_offs(), m);
            const auto alone = without_join_roulette(limited(methods[i], options.longest));
            const Series unthinned =
                alone ? runner.render(*alone, 2 + uint64_t(methods.size() + i)) : Series{};
            for (int edges = options.shortest; edges <= options.longest; ++edges)
                for (const Technique& q : techniques_of_length(edges))
                    if (series.counts.of(q) > 0)
                        m.techniques.push_back(
                            compare_technique(q, alone ? unthinned : series, *against));
        }
        if (m.out_of_reach == 0) m.errors = errors_of_runs(series, error_reference);
        m.slope = slope_of(m.errors);
        m.for_each_tested([&](const Comparison&) { ++report.tests; });
        report.methods.push_back(std::move(m));
    }
    report.level = sidak(options.alpha, std::max(1, report.tests));
    return report;
}

}  // namespace etendue
