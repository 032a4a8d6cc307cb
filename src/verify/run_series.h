#pragma once
// Independent renderings of one method: the sample that all tests are made from.

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "math/statistics.h"
#include "render/renderer.h"
#include "verify/contribution_tally.h"

namespace etendue {

struct VerifyOptions;

/// The mean of one or more renderings, each with a seed of its own; per pixel and pass.
struct IndependentRun {
    std::vector<Rgb> pixels;
    std::vector<ContributionTally::Entry> entries;
    /// By class, whether or not it has a short edge; tile by tile, and in total.
    std::map<PathClass, std::vector<ContributionTally::TileSum>> tiles;
    std::map<PathClass, Tally> classes;
    uint64_t rejected = 0;

    /// Makes it the mean of `renderings` renderings, the last of which is `other`.
    void merge(const IndependentRun& other, uint64_t renderings);
    double light(const PathClass& c) const {
        const auto found = classes.find(c);
        return found == classes.end() ? 0.0 : found->second.sum;
    }
};

/// All runs of one method.
struct RunSeries {
    IntegratorSpec spec;
    uint64_t stream = 0;  ///< Tells its random numbers from those of other series.
    TechniqueCounts counts;
    Estimator estimator = Estimator::Unbiased;
    uint64_t spp = 0;         ///< Of one rendering.
    uint64_t renderings = 0;  ///< In each run.
    double seconds = 0;       ///< Spent on all of it.
    std::vector<IndependentRun> runs;

    uint64_t samples() const { return spp * renderings; }  ///< Of a pixel, in each run.
    uint64_t rejected() const;
    /// Sum over the runs.
    std::map<PathClass, Tally> classes() const;
    /// Mean and spread of `value(run)`.
    template <class Value>
    Moments moments(const Value& value) const {
        Moments m;
        for (const IndependentRun& r : runs) m.add(value(r));
        return m;
    }
};

/// Renders series. They share the scene, the options, and δ, the shortest edge of paths that techniques are compared on.
class SeriesRenderer {
public:
    using Report = std::function<void(const std::string&)>;

    SeriesRenderer(const Scene& scene, const VerifyOptions& options, const Report& progress);

    const TileGrid& grid() const { return grid_; }
    /// δ by path length.
    const std::vector<float>& cut_offs() const { return cut_offs_; }
    /// Finds them from a short rendering by the method.
    void choose_cut_offs(const IntegratorSpec& spec);

    /// A series without renderings. Without `spp` one rendering has as many samples as make all runs take `seconds`,
    /// by the time of a rendering that is thrown away.
    RunSeries begin(const IntegratorSpec& spec, uint64_t stream, std::optional<uint64_t> spp,
                    double seconds) const;
    /// Adds so many renderings to every run. Throws what a rendering threw.
    void extend(RunSeries& series, uint64_t renderings) const;

private:
    Renderer renderer(const IntegratorSpec& spec, uint64_t seed, uint64_t spp,
                      ContributionObserver* observer) const;
    uint64_t seed(const RunSeries& series, uint64_t run, uint64_t rendering) const;
    IndependentRun render(const IntegratorSpec& spec, uint64_t seed, uint64_t spp) const;
    double seconds_a_pass(const IntegratorSpec& spec, uint64_t seed) const;
    uint64_t pilot_spp() const;
    int threads() const;

    const Scene& scene_;
    const VerifyOptions& options_;
    const Report& progress_;
    TileGrid grid_;
    std::vector<float> cut_offs_;
};

}  // namespace etendue
