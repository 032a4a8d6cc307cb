#pragma once
// Independent renderings of one method, on which all tests are based.

#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "math/statistics.h"
#include "render/renderer.h"
#include "verify/contribution_tally.h"

namespace etendue {

struct VerifyOptions;

/// Mean of one or more renderings with different seeds; contributions are per pixel and pass.
struct IndependentRun {
    std::vector<Rgb> pixels;
    std::vector<ContributionTally::Entry> entries;
    /// Sums of every tile, and of the crop, by class; classes that differ only in has_short_edge are combined.
    std::map<PathClass, std::vector<ContributionTally::TileSum>> tiles;
    std::map<PathClass, Tally> classes;
    RenderStats stats;

    /// From the mean of `renderings` − 1 renderings to that of `renderings`, the last of which is `other`.
    void merge(const IndependentRun& other, uint64_t renderings);
    double light(const PathClass& c) const {
        const auto found = classes.find(c);
        return found == classes.end() ? 0.0 : found->second.sum;
    }
};

/// All runs of one method.
struct RunSeries {
    IntegratorSpec spec;
    uint64_t stream = 0;  ///< Distinguishes its random numbers from those of other series.
    TechniqueCounts counts;
    std::function<bool(const Technique&)> uses;  ///< Integrator::uses()
    Estimator estimator = Estimator::Unbiased;
    bool has_chains = false;  ///< Contributions of the states of a Markov chain are correlated.
    uint64_t spp = 0;         ///< Samples per pixel of one rendering.
    uint64_t renderings = 0;  ///< Renderings per run.
    double seconds = 0;       ///< Wall-clock time of all renderings.
    std::vector<std::string> memory_warnings;  ///< See render/warnings.h.
    std::vector<IndependentRun> runs;

    uint64_t samples() const { return spp * renderings; }  ///< Samples per pixel of one run.
    RenderStats stats() const;                             ///< Sums over the runs.
    /// Sums over the runs; their counts are of independent contributions.
    std::map<PathClass, Tally> classes() const;
    /// Mean and spread of `value(run)` over the runs.
    template <class Value>
    Moments moments(const Value& value) const {
        Moments m;
        for (const IndependentRun& r : runs) m.add(value(r));
        return m;
    }
    /// Independent contributions to a mean over the runs, at most: of chains as many as would explain its spread.
    double most_contributions(const Moments& m) const {
        if (!has_chains) return std::numeric_limits<double>::infinity();
        return m.squared_error() > 0 ? m.mean() * m.mean() / m.squared_error() : 0.0;
    }
};

/// Thrown when VerifyOptions::interrupted is set.
struct VerifyInterrupted {};

/// Renders series with common scene, options and δ: techniques are compared on paths whose edges have at least the
/// length δ.
class SeriesRenderer {
public:
    using Report = std::function<void(const std::string&)>;

    SeriesRenderer(const Scene& scene, const VerifyOptions& options, const Report& progress);

    const Scene& scene() const { return scene_; }
    const TileGrid& grid() const { return grid_; }
    /// δ by path length.
    const std::vector<float>& cut_offs() const { return cut_offs_; }
    /// Chooses δ by a short rendering with the method `spec`.
    void choose_cut_offs(const IntegratorSpec& spec);

    /// Creates a series without renderings. Without `spp` the samples per pixel of a rendering are chosen so that one
    /// rendering in every run takes `seconds` altogether, as measured by a pilot rendering.
    RunSeries begin(const IntegratorSpec& spec, uint64_t stream, std::optional<uint64_t> spp,
                    double seconds) const;
    /// Adds `renderings` renderings to every run. Rethrows exceptions of renderings; the series then has the renderings
    /// that were finished in all runs.
    void extend(RunSeries& series, uint64_t renderings) const;

private:
    Renderer renderer(const IntegratorSpec& spec, uint64_t seed, uint64_t spp,
                      ContributionObserver* observer) const;
    uint64_t seed(const RunSeries& series, uint64_t run, uint64_t rendering) const;
    IndependentRun render(const IntegratorSpec& spec, uint64_t seed, uint64_t spp) const;
    double seconds_a_pass(const IntegratorSpec& spec, uint64_t seed) const;
    uint64_t pilot_spp() const;
    /// Number of runs of a method at the same time. Objects of Python work on one thread, that of the caller.
    int threads(const IntegratorSpec& spec) const;

    const Scene& scene_;
    const VerifyOptions& options_;
    const Report& progress_;
    TileGrid grid_;
    std::vector<float> cut_offs_;
};

}  // namespace etendue
