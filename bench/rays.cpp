// Overhead of integrators over Embree: their ray rate relative to that of the same rays replayed alone, and the share
// of time spent in Embree. Also the speed of Embree on this machine.

#include "ray_recorder.h"
#include "support.h"
#include "yardstick.h"

namespace etendue::bench {
namespace {

void measure_yardstick(const Report& report, const Options& options) {
    const std::string name = "bare embree";
    if (!report.wants(name)) return;
    const Yardstick yardstick;
    const auto [one, two] = alternate(
        options.repeats, [&] { return yardstick.rays_per_second(1, options.seconds); },
        [&] { return yardstick.rays_per_second(2, options.seconds); });
    report.add(name,
               {{"rays_per_second_1_thread", "rays/s", true, one},
                {"rays_per_second_2_threads", "rays/s", true, two},
                {"scaling", "1", true, each(one, two, [](double a, double b) { return b / a; })}},
               {{"triangles", yardstick.triangles()},
                {"rays", "diffuse paths, closest hit and occlusion"}});
}

/// Share of an integrator's time within Embree, on one thread: the run with the clock read around
/// every call against the run without.
std::vector<double> embree_shares(const Scene& scene, const IntegratorSpec& integrator,
                                  uint64_t passes, int repeats) {
    const auto run = [&] { render(scene, integrator, 1, {.passes = passes, .seconds = {}}); };
    const auto [whole, within] = alternate(
        repeats,
        [&] {
            const uint64_t begin = ticks();
            run();
            return double(ticks() - begin);
        },
        [&] { return ticks_within_embree(run); });
    return each(whole, within, [](double a, double b) { return b / a; });
}

struct Method {
    std::string name;
    std::optional<double> rate_aim = {}, share_aim = {};
};

void measure_integrator(const Report& report, const Options& options, const Scene& scene,
                        const Method& method, const std::string& scene_name) {
    const IntegratorSpec integrator = integrator_for(scene, method.name);
    // The rays of one pass; with masked surfaces one ray of the integrator can be several of
    // Embree's.
    double counted = 0;
    const RecordedRays recorded([&] {
        counted = double(render(scene, integrator, 1, {.passes = 1, .seconds = {}}).stats.rays());
    });
    const double embree_rays = double(recorded.size()) / counted;

    for (int threads : {1, 2}) {
        const std::string name =
            method.name + " " + scene_name + " threads=" + std::to_string(threads);
        if (!report.wants(name)) continue;
        const uint64_t passes = passes_for(scene, integrator, threads, options.seconds);
        const auto [rendered, bare] = alternate(
            options.repeats,
            [&] {
                const Rendering r =
                    render(scene, integrator, threads, {.passes = passes, .seconds = {}});
                return r.rays_per_second() * embree_rays;
            },
            [&] { return recorded.replay(threads, options.seconds); });
        std::vector<Figure> figures = {
            {"ray_rate", "1", true, each(rendered, bare, [](double a, double b) { return a / b; }),
             method.rate_aim},
            {"rays_per_second", "rays/s", true, rendered},
            {"bare_rays_per_second", "rays/s", true, bare}};
        if (threads == 1)
            figures.push_back({"ray_share", "1", true,
                               embree_shares(scene, integrator, passes, options.repeats),
                               method.share_aim});
        report.add(name, figures, {{"passes", passes}, {"recorded_rays", recorded.size()}});
    }
}

}  // namespace
}  // namespace etendue::bench

int main(int argc, char** argv) {
    using namespace etendue::bench;
    const Options options = Options::parse(argc, argv);
    const Report report("rays", options);
    measure_yardstick(report, options);
    for (const SceneFile& file :
         {own_scene("yard-cornell"), own_scene("yard-ring"),
          shared_scene("veach-ajar-mts3", "veach-ajar"), own_scene("cornell")}) {
        // Few pixels, so that the rays of one pass fit into memory.
        const auto scene = load_or_skip(report, file, {{256, 256}});
        if (!scene) continue;
        // Chains make so many mutations that start-up and direct light take little of the time.
        for (const Method& method : {Method{"path", 0.5, 0.6},
                                     {"bdpt", 0.5, 0.5},
                                     {"pssmlt:mutations=8"},
                                     {"mmlt:mutations=32"},
                                     {"mlt:mutations=32"}})
            measure_integrator(report, options, *scene, method, file.name);
    }
}
