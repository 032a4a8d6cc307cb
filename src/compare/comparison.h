#pragma once
// Comparison of methods on one scene: they are rendered in turns, and compared with one reference.

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "compare/error_statistics.h"
#include "compare/reference.h"
#include "compare/timed_images.h"
#include "image/metrics.h"
#include "render/renderer.h"

namespace etendue {

/// A method: an integrator and its name in reports.
struct MethodSpec {
    std::string name;
    IntegratorSpec integrator;
};

struct CompareSettings {
    std::vector<MethodSpec> methods;
    std::vector<TimedImages> images;  ///< Of other programs, after the methods.
    SamplerKind sampler = SamplerKind::Sobol;
    uint64_t seed = 0;    ///< Of the first run; the others have consecutive seeds.
    int threads = 0;      ///< 0: one per core.
    RenderLimits limits;  ///< Of each method in each run: seconds or spp.
    int runs = 1;
    PathSelection shown;  ///< As in RenderSettings.
    /// Longest path, in edges, with technique images, which are rendered separately; 0 for none.
    int technique_depth = 0;
};

/// Errors of the image at one time.
struct Checkpoint {
    uint64_t spp;
    double seconds;  ///< Rendering time so far.
    ImageErrors errors;
};

struct Run {
    uint64_t seed = 0, spp = 0;
    double seconds = 0;
    RenderStats stats;
    Film::MeanEstimate mean;
    std::vector<Checkpoint> checkpoints;  ///< The last one is that of the final image.
    ImageErrors uncorrected;              ///< Including the reference's variance.

    const ImageErrors& errors() const { return checkpoints.back().errors; }
};

struct Method {
    MethodSpec spec;
    std::string folder;  ///< Of the images of another program; empty where the method was rendered.
    Estimator estimator = Estimator::Unbiased;
    std::vector<Run> runs;
    // Of the first of them:
    std::shared_ptr<const MethodChoice> choice;  ///< Where `auto` has chosen.
    std::vector<Rgb> image;
    std::vector<float> flip_map;
    double flip = 0;
    size_t peak_bytes = 0;                     ///< See MemoryMeter.
    std::vector<std::string> memory_warnings;  ///< See render/warnings.h.
    std::vector<TechniqueImages::Entry> techniques;
    uint64_t technique_spp = 0;

    const std::string& name() const { return spec.name; }
    /// See render/warnings.h; of all runs, and of the memory that they need.
    std::vector<std::string> warnings() const;
};

struct Comparison {
    std::string scene_file;
    FilmGeometry film;
    CompareSettings settings;
    Reference reference;
    /// The reference's own variance, in units of mse and rel_mse; 0 where it is unknown.
    double reference_mse = 0, reference_rel_mse = 0;
    std::vector<Method> methods;
    size_t scene_bytes = 0;  ///< Resident memory before the first method started.
    bool interrupted = false;
    std::vector<std::string> failures;  ///< Runs of methods that failed and are left out.
};

/// Receives the current status as one line of text.
using CompareProgress = std::function<void(const std::string& text)>;

/// Renders the methods and evaluates them. If `interrupted` is set, evaluates the images rendered until then. A method
/// whose rendering fails does not affect the others. Of images of other programs, memory, rays and techniques are unknown.
/// Throws std::runtime_error where a method or its parameters do not exist, or all methods fail.
Comparison compare(const Scene& scene, const Reference& reference, const CompareSettings& settings,
                   const CompareProgress& progress, const std::atomic<bool>& interrupted);

/// Throws std::runtime_error where a method or its parameters do not exist, or two are the same.
void check_methods(const std::vector<MethodSpec>& methods);
/// The same, and where images have the name of a method or of others.
void check_methods(const CompareSettings& settings);

/// Throws std::runtime_error where the MIS weights of a method differ from those of the reference's method, since the
/// means of their inner paths are different then.
void check_inner_paths(const Scene& scene, const std::vector<MethodSpec>& methods,
                       const IntegratorSpec& reference);

/// Limits at which a method stops and the next one continues. Checkpoints are a factor of √2 in time or 2 in samples
/// apart, so that they are equidistant in a logarithmic plot; long steps are divided into several turns.
struct Turn {
    RenderLimits limits;
    bool is_checkpoint;
};
std::vector<Turn> schedule(const RenderLimits& limits);

/// Results of one method over all runs.
struct MethodSummary {
    double spp = 0, seconds = 0, rays = 0;  ///< Means per run.
    double rmse = 0;                        ///< √ mean mse
    double rel_mse = 0, rel_mse_trimmed = 0, mape = 0, spike = 0;
    std::optional<Interval> rel_mse_interval;
    Interval mean_ratio;
    std::optional<PowerLaw> rmse_slope, rel_mse_slope;
    std::optional<Interval> rel_mse_slope_interval;  ///< From the slopes of the runs.
    std::optional<Efficiency> efficiency;  ///< From rel_mse, relative to the first method.
    /// Share of the uncorrected rel_mse that is due to the reference's noise; empty where it is unknown.
    std::optional<double> reference_share;
};
std::vector<MethodSummary> summarize(const Comparison& comparison);

}  // namespace etendue
