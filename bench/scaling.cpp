// Speed-up by a second thread: the time of one thread divided by that of two, for the same passes.

#include "support.h"

int main(int argc, char** argv) {
    using namespace etendue::bench;
    const Options options = Options::parse(argc, argv);
    const Report report("scaling", options);
    for (const SceneFile& file :
         {own_scene("yard-cornell"), own_scene("yard-ring"), own_scene("cornell")}) {
        const auto scene = load_or_skip(report, file);
        if (!scene) continue;
        for (const std::string integrator_name : {"path", "light", "bdpt"}) {
            const std::string name = integrator_name + " " + file.name;
            if (!report.wants(name)) continue;
            const etendue::IntegratorSpec integrator = integrator_for(*scene, integrator_name);
            const uint64_t passes = passes_for(*scene, integrator, 2, options.seconds);
            const auto seconds = [&](int threads) {
                return render(*scene, integrator, threads, {.passes = passes, .seconds = {}})
                    .seconds;
            };
            const auto [one, two] = alternate(
                options.repeats, [&] { return seconds(1); }, [&] { return seconds(2); });
            report.add(name,
                       {{"scaling", "1", true,
                         each(one, two, [](double a, double b) { return a / b; }), 1.9},
                        {"seconds_1_thread", "s", false, one},
                        {"seconds_2_threads", "s", false, two}},
                       {{"passes", passes}});
        }
    }
}
