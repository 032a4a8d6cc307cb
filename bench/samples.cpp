// Samples per second, and the error after a given time, alternating with measurements of bare Embree. `normalised`
// results are those expected on the machine where other renderers were measured, assuming the same ratio to Embree
// there. Two threads, as for the other renderers.

#include "image/image_io.h"
#include "image/metrics.h"
#include "support.h"
#include "yardstick.h"

namespace etendue::bench {
namespace {

/// A scene, and targets from the results of other renderers.
struct Case {
    SceneFile file;
    /// Seconds after which the error is measured; 0 where there are no references ref1.pfm and ref2.pfm.
    double error_seconds = 0;
    struct Aim {
        std::string integrator;
        std::optional<double> samples_per_second, rel_mse;
    };
    std::vector<Aim> integrators = {{"path", {}, {}}, {"bdpt", {}, {}}, {"light", {}, {}}};
};

/// Aims: `path` 1.5 times and `bdpt` twice the samples of the best peer, `bdpt` at half the best
/// peer's error.
std::vector<Case> cases() {
    return {{.file = shared_scene("yard-cornell-mts06", "yard-cornell"),
             .error_seconds = 30,
             .integrators = {{"path", 1.5 * 1.31e6, {}},
                             {"bdpt", 2 * 0.318e6, 0.0043},
                             {"light", {}, {}}}},
            {.file = shared_scene("yard-ring-mts06", "yard-ring"),
             .error_seconds = 60,
             .integrators = {{"path", 1.5 * 0.75e6, {}},
                             {"bdpt", 2 * 0.154e6, 0.19},
                             {"light", {}, {}}}},
            {.file = own_scene("cornell")}};
}

void measure_samples(const Report& report, const Options& options, const Yardstick& yardstick,
                     const Scene& scene, const std::string& scene_name, const Case::Aim& aim) {
    const std::string name = aim.integrator + " " + scene_name;
    if (!report.wants(name)) return;
    const IntegratorSpec integrator = integrator_for(scene, aim.integrator);
    // Enough passes that the first one, before roulette has learned the image, matters little.
    const uint64_t passes =
        std::max(passes_for(scene, integrator, kPeerThreads, options.seconds), uint64_t{8});
    const auto [rendered, bare] = alternate(
        options.repeats,
        [&] { return render(scene, integrator, kPeerThreads, {.passes = passes, .seconds = {}}); },
        [&] { return yardstick.rays_per_second(kPeerThreads, options.seconds); });
    const RenderStats& stats = rendered.front().stats;
    report.add(
        name,
        {{"samples_per_second", "samples/s", true,
          each(rendered, [](const Rendering& r) { return r.samples_per_second(); })},
         {"normalised_samples_per_second", "samples/s", true,
          each(rendered, bare,
               [](const Rendering& r, double rays) {
                   return r.samples_per_second() * kPeerRays / rays;
               }),
          aim.samples_per_second}},
        {{"passes", passes}, {"rays_per_sample", double(stats.rays()) / rendered.front().samples}});
}

/// Errors of independent runs that take `error_seconds` together, each scaled to that time (the
/// error of an unbiased estimate is inverse to its length); and that of the mean of their images,
/// which has no such assumption.
void measure_error(const Report& report, const Options& options, const Yardstick& yardstick,
                   const Scene& scene, const Case& c, const Case::Aim& aim) {
    const std::string name = "error " + aim.integrator + " " + c.file.name;
    if (!report.wants(name)) return;
    const auto ref1 = read_rgb(c.file.sibling("ref1.pfm").string()).pixels;
    const auto ref2 = read_rgb(c.file.sibling("ref2.pfm").string()).pixels;
    const auto errors = [&](const std::vector<Rgb>& image) {
        return image_errors(image, ref1, {.reference2 = ref2, .ignore_above = 3});
    };
    const IntegratorSpec integrator = integrator_for(scene, aim.integrator);
    const double length = options.quick ? options.seconds : c.error_seconds / options.repeats;
    uint64_t seed = 0;
    std::vector<Rgb> sum(ref1.size());
    double samples = 0, seconds = 0;
    struct Run {
        double rel_mse, trimmed, rel_mse_1_spp;
    };
    const auto [runs, bare] = alternate(
        options.repeats,
        [&] {
            const Rendering r =
                render(scene, integrator, kPeerThreads, {.passes = {}, .seconds = length}, seed);
            // The first call only warms up.
            if (seed++ > 0) {
                for (size_t i = 0; i < sum.size(); ++i) sum[i] += r.image[i] * float(r.samples);
                samples += r.samples;
                seconds += r.seconds;
            }
            const ImageErrors e = errors(r.image);
            const double scale = r.seconds / c.error_seconds;
            return Run{e.rel_mse * scale, e.rel_mse_trimmed * scale,
                       e.rel_mse * r.samples / double(ref1.size())};
        },
        [&] { return yardstick.rays_per_second(kPeerThreads, options.seconds); });
    for (Rgb& value : sum) value *= float(1 / samples);
    const ImageErrors all = errors(sum);
    report.add(
        name,
        {{"rel_mse", "1", false, each(runs, [](const Run& r) { return r.rel_mse; })},
         {"rel_mse_trimmed", "1", false, each(runs, [](const Run& r) { return r.trimmed; })},
         {"normalised_rel_mse", "1", false,
          each(runs, bare, [](const Run& r, double rays) { return r.rel_mse * rays / kPeerRays; }),
          aim.rel_mse},
         {"rel_mse_at_1_spp", "1", false, each(runs, [](const Run& r) { return r.rel_mse_1_spp; })},
         {"rel_mse_of_mean_image", "1", false, {all.rel_mse * seconds / c.error_seconds}}},
        {{"seconds", c.error_seconds},
         {"mean_ratio", all.mean_ratio},
         {"not_finite", all.not_finite}});
}

}  // namespace
}  // namespace etendue::bench

int main(int argc, char** argv) {
    using namespace etendue::bench;
    const Options options = Options::parse(argc, argv);
    const Report report("samples", options);
    const Yardstick yardstick;
    for (const Case& c : cases()) {
        const auto scene = load_or_skip(report, c.file);
        if (!scene) continue;
        for (const Case::Aim& aim : c.integrators) {
            measure_samples(report, options, yardstick, *scene, c.file.name, aim);
            if (c.error_seconds > 0) measure_error(report, options, yardstick, *scene, c, aim);
        }
    }
}
