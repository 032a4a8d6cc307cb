#pragma once
// Methods side by side on one scene: rendered in turns, judged by one reference.

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "compare/error_statistics.h"
#include "compare/reference.h"
#include "image/metrics.h"
#include "render/renderer.h"

namespace etendue {

/// What is compared: an integrator, and what people call it.
struct MethodSpec {
    std::string name;
    IntegratorSpec integrator;
};

struct CompareSettings {
    std::vector<MethodSpec> methods;
    SamplerKind sampler = SamplerKind::Sobol;
    uint64_t seed = 0;    ///< Of the first run; the others count on.
    int threads = 0;      ///< 0: all.
    RenderLimits limits;  ///< Of each method in each run: seconds or spp.
    int runs = 1;
    PathSelection shown;  ///< As in RenderSettings.
    /// Technique images up to this many edges, from a rendering of their own; 0 for none.
    int technique_depth = 0;
};

/// The image so far.
struct Checkpoint {
    uint64_t spp;
    double seconds;  ///< Spent rendering.
    ImageErrors errors;
};

struct Run {
    uint64_t seed = 0, spp = 0;
    double seconds = 0;
    RenderStats stats;
    uint64_t rejected = 0;  ///< Contributions that were not finite.
    Film::MeanEstimate mean;
    std::vector<Checkpoint> checkpoints;  ///< The last is that of the final image.
    /// Without the subtraction of the reference's variance.
    ImageErrors uncorrected;

    const ImageErrors& errors() const { return checkpoints.back().errors; }
};

struct Method {
    MethodSpec spec;
    Estimator estimator = Estimator::Unbiased;
    std::vector<Run> runs;
    // Of the first run.
    std::vector<Rgb> image;
    std::vector<float> flip_map;
    double flip = 0;
    size_t peak_bytes = 0;  ///< See MemoryMeter.
    std::vector<TechniqueImages::Entry> techniques;
    uint64_t technique_spp = 0;

    const std::string& name() const { return spec.name; }
};

struct Comparison {
    std::string scene_file;
    FilmGeometry film;
    CompareSettings settings;
    Reference reference;
    /// The reference's own variance, in units of mse and rel_mse; 0 where it is not known.
    double reference_mse = 0, reference_rel_mse = 0;
    std::vector<Method> methods;
    size_t scene_bytes = 0;  ///< Resident before the first method began.
    bool interrupted = false;
};

/// What is going on: `text` is fit for a line on the terminal.
using CompareProgress = std::function<void(const std::string& text)>;

/// Renders and judges. Where `interrupted` is set, what there is then is judged. Throws std::runtime_error where a method
/// or its parameters do not exist.
Comparison compare(const Scene& scene, const Reference& reference, const CompareSettings& settings,
                   const CompareProgress& progress, const std::atomic<bool>& interrupted);

/// Throws std::runtime_error where a method or its parameters do not exist, or two are the same.
void check_methods(const std::vector<MethodSpec>& methods);

/// Throws std::runtime_error where a method weighs its techniques otherwise than the reference's: then the inner paths of
/// both have different means.
void check_inner_paths(const Scene& scene, const std::vector<MethodSpec>& methods,
                       const IntegratorSpec& reference);

/// Where methods stop and let the next one go on. Checkpoints are a factor of √2 in time or 2 in samples apart, evenly in
/// a logarithmic plot; long steps are cut into several turns.
struct Turn {
    RenderLimits limits;
    bool is_checkpoint;
};
std::vector<Turn> schedule(const RenderLimits& limits);

/// Figures over all runs.
struct MethodSummary {
    double spp = 0, seconds = 0, rays = 0;  ///< Means of one run.
    double rmse = 0;                        ///< √ mean mse
    double rel_mse = 0, rel_mse_trimmed = 0, mape = 0, spike = 0;
    std::optional<Interval> rel_mse_interval;
    Interval mean_ratio;
    std::optional<PowerLaw> rmse_slope, rel_mse_slope;
    std::optional<Interval> rel_mse_slope_interval;  ///< From the slopes of the runs.
    std::optional<Efficiency> efficiency;  ///< From rel_mse, relative to the first method.
    /// Share of the measured rel_mse that was the reference's noise; none where that is not known.
    std::optional<double> reference_share;
};
std::vector<MethodSummary> summarize(const Comparison& comparison);

}  // namespace etendue
