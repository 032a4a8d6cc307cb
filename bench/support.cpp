#include "support.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include <fmt/format.h>

#include "readers/scene_file.h"
#include "render/render_request.h"
#include "scene/builder.h"

namespace etendue::bench {
namespace {

[[noreturn]] void usage(const char* program) {
    fmt::print(stderr, "usage: {} [--repeats N] [--seconds S] [--quick] [--only TEXT]\n", program);
    std::exit(2);
}

template <class Number>
bool parse_positive(std::string_view text, Number& out) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    return error == std::errc() && end == text.data() + text.size() && out > 0;
}

}  // namespace

Options Options::parse(int argc, char** argv) {
    Options options;
    for (int i = 1; i < argc; ++i) {
        const std::string_view option = argv[i];
        if (option == "--quick") {
            options.quick = true;
            options.seconds = 0.1;
            continue;
        }
        if (++i == argc) usage(argv[0]);
        if (option == "--only")
            options.only = argv[i];
        else if (!(option == "--repeats" && parse_positive(argv[i], options.repeats)) &&
                 !(option == "--seconds" && parse_positive(argv[i], options.seconds)))
            usage(argv[0]);
    }
    return options;
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const size_t n = values.size();
    return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

void Report::add(const std::string& name, const std::vector<Figure>& figures,
                 const nlohmann::ordered_json& notes) const {
    nlohmann::ordered_json values;
    for (const Figure& f : figures) {
        const auto [min, max] = std::minmax_element(f.runs.begin(), f.runs.end());
        nlohmann::ordered_json& v = values[f.name];
        v = {{"unit", f.unit},
             {"better", f.higher_is_better ? "higher" : "lower"},
             {"median", median(f.runs)},
             {"min", *min},
             {"max", *max},
             {"runs", f.runs}};
        if (f.aim) v["aim"] = *f.aim;
    }
    nlohmann::ordered_json line = {{"bench", bench_}, {"case", name}, {"figures", values}};
    if (!notes.empty()) line["notes"] = notes;
    print(line);
}

void Report::skip(const std::string& name, const std::string& reason) const {
    print({{"bench", bench_}, {"case", name}, {"skipped", reason}});
}

void Report::print(const nlohmann::ordered_json& line) const {
    fmt::print("{}\n", line.dump());
    std::fflush(stdout);
}

SceneFile shared_scene(const std::string& folder, const std::string& name, const char* file) {
    const char* given = std::getenv("ETENDUE_SCENES");
    const std::filesystem::path root =
        given ? given : std::filesystem::path(ETENDUE_SOURCE_DIR) / ".." / "shared" / "scenes";
    return {name, root / folder / file};
}

SceneFile own_scene(const std::string& name) {
    return {name, std::filesystem::path(ETENDUE_SOURCE_DIR) / "scenes" / (name + ".xml")};
}

std::optional<Scene> load_or_skip(const Report& report, const SceneFile& file,
                                  std::optional<std::pair<int, int>> resolution) {
    if (!std::filesystem::exists(file.path)) {
        report.skip(file.name, "there is no such scene file");
        return {};
    }
    BuildOptions options;
    options.resolution = resolution;
    return build_scene(read_scene_file(file.path.string()), options);
}

IntegratorSpec integrator_for(const Scene& scene, const std::string& name) {
    return choose_integrator(scene, name);
}

Rendering render(const Scene& scene, const IntegratorSpec& integrator, int threads,
                 const Length& length, uint64_t seed) {
    RenderSettings settings;
    settings.integrator = integrator;
    settings.sampler = SamplerKind::Sobol;  // the default of the program
    settings.threads = threads;
    settings.seed = seed;
    settings.spp = length.passes;
    settings.seconds = length.seconds;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    return {.seconds = renderer.seconds(),
            .samples = double(renderer.film().passes() * scene.film().pixel_count()),
            .stats = renderer.stats(),
            .image = renderer.film().image()};
}

uint64_t passes_for(const Scene& scene, const IntegratorSpec& integrator, int threads,
                    double seconds) {
    const double one_pass =
        render(scene, integrator, threads, {.passes = 1, .seconds = {}}).seconds;
    return uint64_t(std::max(1.0, std::round(seconds / one_pass)));
}

}  // namespace etendue::bench
