#pragma once
// Parts shared by all benchmarks: options, scenes, timed renderings, alternating measurements, and result lines.
//
// A benchmark prints one line with a JSON object per case:
//     {"bench": "scaling", "case": "bdpt yard-ring", "figures": {"scaling": {"unit": …, "better": "higher" | "lower",
//      "aim": …, "median": …, "min": …, "max": …, "runs": […]}}, "notes": {…}}
// or {"bench": …, "case": …, "skipped": reason}. bench/compare reads these lines.

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "image/image.h"
#include "render/renderer.h"
#include "scene/scene.h"

namespace etendue::bench {

struct Options {
    int repeats = 5;     ///< Runs of each side.
    double seconds = 1;  ///< Minimal duration of one run.
    bool quick = false;  ///< Short runs, to test the benchmarks; the results are meaningless.
    std::string only;    ///< Only cases whose name contains this text; all if empty.

    /// Parses `--repeats N --seconds S --quick --only TEXT`; ends the program on errors.
    static Options parse(int argc, char** argv);
};

/// One measured quantity: its value in every run.
struct Figure {
    std::string name;
    std::string unit;
    bool higher_is_better;
    std::vector<double> runs;
    std::optional<double> aim = {};
};
double median(std::vector<double> values);

/// The result lines of one program.
class Report {
public:
    Report(std::string bench, const Options& options)
        : bench_(std::move(bench)), only_(options.only) {}

    /// Whether this case is selected by --only.
    bool wants(const std::string& name) const { return name.find(only_) != std::string::npos; }
    void add(const std::string& name, const std::vector<Figure>& figures,
             const nlohmann::ordered_json& notes = {}) const;
    void skip(const std::string& name, const std::string& reason) const;

private:
    void print(const nlohmann::ordered_json& line) const;
    std::string bench_, only_;
};

/// Calls `a` and `b` alternately, A B A B …, after one unmeasured call of each; returns their results by run.
template <class A, class B>
auto alternate(int repeats, const A& a, const B& b) {
    a(), b();
    std::pair<std::vector<decltype(a())>, std::vector<decltype(b())>> runs;
    for (int i = 0; i < repeats; ++i) {
        runs.first.push_back(a());
        runs.second.push_back(b());
    }
    return runs;
}

/// f(a_i, b_i) for every run i.
template <class A, class B, class F>
std::vector<double> each(const std::vector<A>& a, const std::vector<B>& b, const F& f) {
    std::vector<double> values;
    for (size_t i = 0; i < a.size(); ++i) values.push_back(f(a[i], b[i]));
    return values;
}
template <class A, class F>
std::vector<double> each(const std::vector<A>& a, const F& f) {
    return each(a, a, [&](const A& x, const A&) { return f(x); });
}

/// A scene file that may be missing on this machine.
struct SceneFile {
    std::string name;
    std::filesystem::path path;
};
/// `file` in the folder `folder` of $ETENDUE_SCENES, or of shared/scenes beside the project.
SceneFile shared_scene(const std::string& folder, const std::string& name,
                       const char* file = "scene.xml");
/// scenes/`name`.xml of the project.
SceneFile own_scene(const std::string& name);
/// The scene, or a line that says the file is missing. A file that cannot be read is an error.
std::optional<Scene> load_or_skip(const Report& report, const SceneFile& file,
                                  std::optional<std::pair<int, int>> resolution = {});

/// The integrator NAME or NAME:PARAMETER=VALUE,…, with the scene file's own parameters, such as the longest path.
IntegratorSpec integrator_for(const Scene& scene, const std::string& name);

struct Rendering {
    double seconds = 0;
    double samples = 0;  ///< Passes times pixels.
    RenderStats stats;
    std::vector<Rgb> image;

    double samples_per_second() const { return samples / seconds; }
    double rays_per_second() const { return double(stats.rays()) / seconds; }
};
/// Length of a rendering: passes, or seconds.
struct Length {
    std::optional<uint64_t> passes;
    std::optional<double> seconds;
};
Rendering render(const Scene& scene, const IntegratorSpec& integrator, int threads,
                 const Length& length, uint64_t seed = 0);
/// Passes that take about `seconds`, at least one.
uint64_t passes_for(const Scene& scene, const IntegratorSpec& integrator, int threads,
                    double seconds);

}  // namespace etendue::bench
