// Samples and mutations per second, and the error after a given time, alternating with measurements of bare Embree.
// `normalised` results are those expected on the machine where other renderers were measured, assuming the same ratio to Embree
// there. Methods that learn run for as long as it takes to do the same work. Two threads, as for the other renderers.

#include "image/image_io.h"
#include "image/metrics.h"
#include "support.h"
#include "yardstick.h"

namespace etendue::bench {
namespace {

/// A scene, and targets from the results of other renderers.
struct Case {
    SceneFile file;
    /// Folder in $ETENDUE_SCENES of the references ref1.pfm and ref2.pfm.
    std::string references = {};
    /// Seconds after which the error is measured, if there are references; 0: never.
    double error_seconds = 0;
    struct Aim {
        std::string integrator;
        std::optional<double> samples_per_second, rel_mse;
        /// Whether the error is not inverse to the time, since passes learn from earlier ones, or chains have a start-up.
        bool learns = false;
    };
    std::vector<Aim> integrators = {{"path", {}, {}}, {"bdpt", {}, {}}, {"light", {}, {}}};
};

/// Aims: `path` 1.5 times and `bdpt` twice the samples of the best peer; `bdpt` and each kind of chain at half the error
/// of the best peer of its kind, and `upg+bdpt` at half the error of the best one of all.
std::vector<Case> cases() {
    return {{.file = own_scene("yard-cornell"),
             .references = "yard-cornell-mts06",
             .error_seconds = 30,
             .integrators = {{"path", 1.5 * 1.31e6, {}},
                             {"bdpt", 2 * 0.318e6, 0.0043},
                             {"light", {}, {}},
                             {"pssmlt", {}, 0.0145 / 2, true},
                             {"mmlt", {}, 0.0161 / 2, true},
                             {"mlt", {}, 0.0102 / 2, true}}},
            {.file = own_scene("yard-ring"),
             .references = "yard-ring-mts06",
             .error_seconds = 60,
             .integrators = {{"path", 1.5 * 0.75e6, {}},
                             {"bdpt", 2 * 0.154e6, 0.19},
                             {"light", {}, {}},
                             {"upg+bdpt", {}, {}, true},
                             {"upg+bdpt:guide=on", {}, 0.035 / 2, true},
                             {"pssmlt", {}, 0.128 / 2, true},
                             {"mmlt", {}, 0.088 / 2, true},
                             {"mlt", {}, 0.035 / 2, true}}},
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

/// Mutations per second, relative to samples of `bdpt`. The start-up and direct light take as long with few mutations as with
/// many, and cancel.
void measure_mutations(const Report& report, const Options& options, const Scene& scene,
                       const std::string& scene_name, const std::string& method) {
    const std::string name = "mutations " + method + " " + scene_name;
    if (!report.wants(name)) return;
    constexpr int kFew = 1, kMany = 9;  // per pixel
    const auto pass = [&](int mutations) {
        const IntegratorSpec chains =
            integrator_for(scene, method + ":mutations=" + std::to_string(mutations));
        return render(scene, chains, kPeerThreads, {.passes = 1, .seconds = {}});
    };
    double rays = 0;
    const IntegratorSpec bdpt = integrator_for(scene, "bdpt");
    const uint64_t passes =
        std::max(passes_for(scene, bdpt, kPeerThreads, options.seconds), uint64_t{8});
    const auto [mutations, samples] = alternate(
        options.repeats,
        [&] {
            const Rendering few = pass(kFew), many = pass(kMany);
            const double count = (kMany - kFew) * few.samples;
            rays = double(many.stats.rays() - few.stats.rays()) / count;
            return count / (many.seconds - few.seconds);
        },
        [&] {
            return render(scene, bdpt, kPeerThreads, {.passes = passes, .seconds = {}})
                .samples_per_second();
        });
    report.add(name,
               {{"mutations_per_second", "mutations/s", true, mutations},
                {"bdpt_samples_per_second", "samples/s", true, samples},
                {"mutations_per_bdpt_sample", "1", true,
                 each(mutations, samples, [](double a, double b) { return a / b; }), 1.0}},
               {{"rays_per_mutation", rays}});
}

/// Errors of images of the case's scene, in comparison with its two references.
class Comparison {
public:
    explicit Comparison(const Case& c)
        : reference_(read_rgb(file(c, "ref1.pfm").string()).pixels),
          reference2_(read_rgb(file(c, "ref2.pfm").string()).pixels) {}
    static bool possible(const Case& c) {
        return std::filesystem::exists(file(c, "ref1.pfm")) &&
               std::filesystem::exists(file(c, "ref2.pfm"));
    }
    ImageErrors errors(const std::vector<Rgb>& image) const {
        return image_errors(image, reference_, {.reference2 = reference2_, .ignore_above = 3});
    }

private:
    static std::filesystem::path file(const Case& c, const char* name) {
        return shared_scene(c.references, c.file.name, name).path;
    }

    std::vector<Rgb> reference_, reference2_;
};

/// Errors of independent runs that take `error_seconds` together, each scaled to that time (the
/// error of an unbiased estimate is inverse to its length); and that of the mean of their images,
/// which has no such assumption.
void measure_error(const Report& report, const Options& options, const Yardstick& yardstick,
                   const Scene& scene, const Case& c, const Case::Aim& aim) {
    const std::string name = "error " + aim.integrator + " " + c.file.name;
    if (!report.wants(name)) return;
    const Comparison comparison(c);
    const IntegratorSpec integrator = integrator_for(scene, aim.integrator);
    const double length = options.quick ? options.seconds : c.error_seconds / options.repeats;
    uint64_t seed = 0;
    std::vector<Rgb> sum(scene.film().pixel_count());
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
            const ImageErrors e = comparison.errors(r.image);
            const double scale = r.seconds / c.error_seconds;
            return Run{e.rel_mse * scale, e.rel_mse_trimmed * scale,
                       e.rel_mse * r.samples / double(sum.size())};
        },
        [&] { return yardstick.rays_per_second(kPeerThreads, options.seconds); });
    for (Rgb& value : sum) value *= float(1 / samples);
    const ImageErrors all = comparison.errors(sum);
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

/// Errors of runs as long as it takes to do the work of `error_seconds` on the machine where other renderers were measured.
void measure_learning_error(const Report& report, const Options& options,
                            const Yardstick& yardstick, const Scene& scene, const Case& c,
                            const Case::Aim& aim) {
    const std::string name = "error " + aim.integrator + " " + c.file.name;
    if (!report.wants(name)) return;
    const Comparison comparison(c);
    const IntegratorSpec integrator = integrator_for(scene, aim.integrator);
    std::vector<double> rel_mse, trimmed, seconds, mean_ratio;
    for (int run = 0; run < options.repeats; ++run) {
        const double rays = yardstick.rays_per_second(kPeerThreads, options.seconds);
        const double length = options.quick ? options.seconds : c.error_seconds * kPeerRays / rays;
        const Rendering r = render(scene, integrator, kPeerThreads,
                                   {.passes = {}, .seconds = length}, uint64_t(run));
        const ImageErrors e = comparison.errors(r.image);
        rel_mse.push_back(e.rel_mse);
        trimmed.push_back(e.rel_mse_trimmed);
        seconds.push_back(r.seconds);
        mean_ratio.push_back(e.mean_ratio);
    }
    report.add(name,
               {{"normalised_rel_mse", "1", false, rel_mse, aim.rel_mse},
                {"normalised_rel_mse_trimmed", "1", false, trimmed},
                {"seconds", "s", false, seconds},
                {"mean_ratio", "1", false, mean_ratio}},
               {{"seconds", c.error_seconds}});
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
        if (c.error_seconds > 0)
            for (const char* method : {"pssmlt", "mmlt", "mlt"})
                measure_mutations(report, options, *scene, c.file.name, method);
        const bool with_errors = c.error_seconds > 0 && Comparison::possible(c);
        if (c.error_seconds > 0 && !with_errors)
            report.skip("error " + c.file.name, "there are no references");
        for (const Case::Aim& aim : c.integrators) {
            if (aim.learns) {
                if (with_errors) measure_learning_error(report, options, yardstick, *scene, c, aim);
                continue;
            }
            measure_samples(report, options, yardstick, *scene, c.file.name, aim);
            if (with_errors) measure_error(report, options, yardstick, *scene, c, aim);
        }
    }
}
