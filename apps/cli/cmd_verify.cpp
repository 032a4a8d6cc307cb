#include <algorithm>
#include <cstdio>
#include <map>

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "image/atomic_file.h"
#include "image/image_io.h"
#include "number_checks.h"
#include "path_lengths.h"
#include "scene_options.h"
#include "verify/verify.h"

namespace etendue {
namespace {

struct VerifyCommand {
    SceneOptions scene;
    std::vector<std::string> methods{"path", "light", "bdpt"};
    std::string lengths = "1..8", against = "path", reference, json;
    uint64_t spp = 0;
    VerifyOptions options;
    bool quiet = false;

    void run();
};

ReferenceImage read_reference(const std::string& path, const Scene& scene) {
    const Image image = read_image(path);
    const auto layers = image.layers();
    if (std::find(layers.begin(), layers.end(), "variance") == layers.end())
        throw std::runtime_error(fmt::format(
            "{}: expected a layer \"variance\" beside the picture, as render --aov variance writes",
            path));
    const auto spp = image.attributes.find("etendue.spp");
    const auto* samples =
        spp == image.attributes.end() ? nullptr : std::get_if<double>(&spp->second);
    if (!samples || *samples < 2)
        throw std::runtime_error(fmt::format(
            "{}: expected the attribute \"etendue.spp\", samples per pixel, at least 2", path));
    const FilmGeometry& film = scene.film();
    if (image.width != film.crop_width || image.height != film.crop_height)
        throw std::runtime_error(fmt::format("{} has {} x {} pixels, but the scene has {} x {}",
                                             path, image.width, image.height, film.crop_width,
                                             film.crop_height));
    return {path, rgb_pixels(image), rgb_pixels(image, "variance"), int64_t(*samples)};
}

// -- Text.

std::string percent(double v) {
    const double p = 100 * v;
    return p == 0 ? "0 %" : p < 0.01 ? "< 0.01 %" : fmt::format("{:.{}f} %", p, p < 9.995 ? 2 : 1);
}

std::string describe(const VerifyReport& report, const Comparison& c) {
    if (!c.is_tested())
        return c.method.mean() == 0 && c.reference.mean() == 0 ? "nothing there"
                                                               : "too few samples to test";
    return fmt::format("ratio {:.5f} ± {:.5f}, p = {:.2g}{}", c.ratio(), c.ratio_error(), c.p,
                       report.deviates(c) ? "  DEVIATES" : "");
}

const char* kChannels[] = {"red", "green", "blue"};

void print_image(const VerifyReport& report, const MethodReport& m) {
    for (size_t c = 0; c < m.image.size(); ++c)
        fmt::print("  image, {:<6} {}\n", kChannels[c], describe(report, m.image[c]));
    size_t tested = 0, deviating = 0, worst = 0;
    for (size_t i = 0; i < m.tiles.size(); ++i) {
        const Comparison& c = m.tiles[i];
        tested += c.is_tested();
        deviating += report.deviates(c);
        if (c.is_tested() && (!m.tiles[worst].is_tested() || c.p < m.tiles[worst].p)) worst = i;
    }
    fmt::print("  tiles         {} of {} tested by channel, {} deviate", tested, m.tiles.size(),
               deviating);
    if (tested > 0)
        fmt::print("; the worst, tile {}, {}: {}", worst / 3, kChannels[worst % 3],
                   describe(report, m.tiles[worst]));
    fmt::print("\n");
}

void print_lengths(const VerifyReport& report, const MethodReport& m) {
    if (m.lengths.empty()) return;
    fmt::print("  length     share  out of reach  too rare  would be found  comparison\n");
    for (const LengthReport& l : m.lengths)
        fmt::print("  {:>6}  {:>8}  {:>12}  {:>8}  {:>14}  {}\n", l.edges, percent(l.share),
                   percent(l.out_of_reach), percent(l.too_rare),
                   l.comparison.is_tested() ? percent(l.comparison.detectable(report.level)) : "-",
                   describe(report, l.comparison));
}

/// One row a length, one column a number of light vertices s; pairs apart.
void print_techniques(const VerifyReport& report, const MethodReport& m, bool pairs) {
    std::map<int, std::vector<const TechniqueReport*>> rows;
    for (const TechniqueReport& t : m.techniques)
        if (is_pair(t.technique.strategy) == pairs) rows[t.technique.vertices() - 1].push_back(&t);
    if (rows.empty()) return;
    fmt::print("  {} alone, ratio to the reference (standard error of the last digits; share "
               "compared), by s\n",
               pairs ? "pairs of vertices" : "connections");
    for (const auto& [edges, row] : rows) {
        std::string line = fmt::format("  {:>6} ", edges);
        int column = 0;
        for (const TechniqueReport* t : row) {
            for (; column < t->technique.s; ++column) line += fmt::format(" {:>18}", "");
            const Comparison& c = t->comparison;
            line += fmt::format(
                " {:>18}",
                !c.is_tested()
                    ? "-"
                    : fmt::format("{}{:.3f}({:.0f}; {:.0f} %)", report.deviates(c) ? "!" : "",
                                  c.ratio(), std::ceil(1000 * c.ratio_error()), 100 * t->coverage));
            ++column;
        }
        fmt::print("{}\n", line);
    }
    for (const TechniqueReport& t : m.techniques)
        if (is_pair(t.technique.strategy) == pairs && report.deviates(t.comparison))
            fmt::print("  s = {}, t = {}: {}\n", t.technique.s, t.technique.t,
                       describe(report, t.comparison));
}

void print_verdict(const VerifyReport& report, const MethodReport& m) {
    const char* claim = to_string(m.estimator);
    switch (report.verdict(m)) {
    case Verdict::Consistent:
        fmt::print("  verdict: consistent with unbiased (it claims to be {})", claim);
        break;
    case Verdict::Deviates:
        fmt::print("  verdict: NOT unbiased, where marked above (it claims to be {})", claim);
        break;
    case Verdict::Undecided:
        fmt::print("  verdict: undecided, more samples are needed (it claims to be {})", claim);
        break;
    }
    if (m.out_of_reach > 0)
        fmt::print("; {} of the light is out of its reach, or the reference's",
                   percent(m.out_of_reach));
    if (m.too_rare > 0) fmt::print("; {} comes by paths too rare for a test", percent(m.too_rare));
    if (m.rejected > 0) fmt::print("; {} contributions were not finite", m.rejected);
    fmt::print("\n\n");
}

void print_report(const VerifyReport& report, const Scene& scene, const VerifyOptions& options) {
    fmt::print("{}, {} x {} pixels, {} runs, against {}\n", scene.file(), scene.film().crop_width,
               scene.film().crop_height, options.runs, report.reference);
    fmt::print("{} comparisons, together a false alarm with probability {}: each is tested at "
               "{:.3g}\n",
               report.tests, options.alpha, report.level);
    fmt::print("\n");
    for (const MethodReport& m : report.methods) {
        fmt::print("{}, {} spp a run\n", m.method, m.spp);
        print_image(report, m);
        print_lengths(report, m);
        print_techniques(report, m, false);
        print_techniques(report, m, true);
        if (m.slope)
            fmt::print("  error of the mean of 1 to {} runs: slope {:.3f}\n", m.errors.back().runs,
                       *m.slope);
        print_verdict(report, m);
    }
}

// -- JSON.

nlohmann::ordered_json to_json(const VerifyReport& report, const Comparison& c) {
    nlohmann::ordered_json j{{"tested", c.is_tested()},
                             {"method", c.method.mean()},
                             {"method_standard_error", std::sqrt(c.method.squared_error())},
                             {"reference", c.reference.mean()},
                             {"reference_standard_error", std::sqrt(c.reference.squared_error())},
                             {"effective_count", c.effective_count}};
    if (c.is_tested()) {
        j["p"] = c.p;
        j["deviates"] = report.deviates(c);
        if (c.reference.mean() != 0) j["detectable"] = c.detectable(report.level);
    }
    return j;
}

nlohmann::ordered_json to_json(const VerifyReport& report, const MethodReport& m) {
    nlohmann::ordered_json j{{"method", m.method},
                             {"estimator", to_string(m.estimator)},
                             {"verdict", to_string(report.verdict(m))},
                             {"spp", m.spp},
                             {"rejected_contributions", m.rejected},
                             {"out_of_reach", m.out_of_reach},
                             {"too_rare", m.too_rare}};
    for (const Comparison& c : m.image) j["image"].push_back(to_json(report, c));
    for (const Comparison& c : m.tiles) j["tiles"].push_back(to_json(report, c));
    for (const LengthReport& l : m.lengths) {
        j["lengths"].push_back(to_json(report, l.comparison));
        j["lengths"].back().update(nlohmann::ordered_json{{"edges", l.edges},
                                                          {"cut_off", l.cut_off},
                                                          {"share", l.share},
                                                          {"out_of_reach", l.out_of_reach},
                                                          {"too_rare", l.too_rare}});
    }
    for (const TechniqueReport& t : m.techniques) {
        j["techniques"].push_back(to_json(report, t.comparison));
        j["techniques"].back().update(
            nlohmann::ordered_json{{"is_pair", is_pair(t.technique.strategy)},
                                   {"s", t.technique.s},
                                   {"t", t.technique.t},
                                   {"coverage", t.coverage}});
    }
    for (const ErrorOfRuns& e : m.errors)
        j["errors"].push_back({{"runs", e.runs}, {"rmse", e.rmse}});
    if (m.slope) j["slope"] = *m.slope;
    return j;
}

nlohmann::ordered_json to_json(const VerifyReport& report, const Scene& scene,
                               const VerifyOptions& options) {
    nlohmann::ordered_json j{{"scene", scene.file()},
                             {"width", scene.film().crop_width},
                             {"height", scene.film().crop_height},
                             {"reference", report.reference},
                             {"runs", options.runs},
                             {"seed", options.seed},
                             {"alpha", options.alpha},
                             {"tests", report.tests},
                             {"level", report.level}};
    for (const MethodReport& m : report.methods) j["methods"].push_back(to_json(report, m));
    return j;
}

void VerifyCommand::run() {
    const PathSelection selected = parse_lengths(lengths, PathClass::kMostEdges);
    options.shortest = selected.shortest;
    options.longest = selected.longest;
    if (spp > 0) options.spp = spp;
    options.against = IntegratorSpec::parse(against);
    std::vector<IntegratorSpec> specs;
    for (const std::string& m : methods) specs.push_back(IntegratorSpec::parse(m));
    for (const IntegratorSpec& s : specs) make_integrator(s);

    const Scene s = load_scene(scene);
    for (const std::string& w : s.warnings()) fmt::print(stderr, "warning: {}\n", w);
    std::optional<ReferenceImage> image;
    if (!reference.empty()) image = read_reference(reference, s);
    const bool is_terminal = isatty(STDERR_FILENO) != 0;
    const VerifyReport report = verify(s, specs, options, image, [&](const std::string& line) {
        if (!quiet && is_terminal) fmt::print(stderr, "\r{}\033[K", line);
    });
    if (!quiet && is_terminal) fmt::print(stderr, "\r\033[K");

    if (!quiet) print_report(report, s, options);
    if (!json.empty()) write_file_atomically(json, to_json(report, s, options).dump(2) + "\n");
    std::vector<std::string> rejected;
    for (const MethodReport& m : report.methods)
        if (m.estimator == Estimator::Unbiased && report.verdict(m) == Verdict::Deviates)
            rejected.push_back(m.method);
    if (!rejected.empty())
        throw std::runtime_error(
            fmt::format("claimed to be unbiased, but rejected: {}", fmt::join(rejected, ", ")));
}

}  // namespace

void add_verify_command(CLI::App& app) {
    auto command = std::make_shared<VerifyCommand>();
    CLI::App& c = *app.add_subcommand("verify", "Test whether methods are unbiased");
    command->scene.add_to(c);
    c.add_option("--methods", command->methods,
                 "Integrators with parameters, as for render -i, separated by spaces")
        ->capture_default_str();
    c.add_option("--lengths", command->lengths, "Path lengths to compare, in edges")
        ->capture_default_str();
    c.add_option("--runs", command->options.runs, "Independent renderings of each method")
        ->capture_default_str()
        ->check(CLI::Range(8, 4096));
    c.add_option("--alpha", command->options.alpha,
                 "Probability of a false alarm, of all comparisons together")
        ->capture_default_str()
        ->check(CLI::Range(1e-9, 0.5));
    auto* spp = c.add_option("--spp", command->spp, "Samples per pixel of each run")
                    ->check(must_be_above_0);
    c.add_option("--time", command->options.seconds, "Seconds for all runs of one method")
        ->capture_default_str()
        ->check(must_be_above_0)
        ->excludes(spp);
    auto* against = c.add_option("--against", command->against, "Method to compare with")
                        ->capture_default_str();
    c.add_option("--reference", command->reference,
                 "Picture to compare with, an .exr with a layer \"variance\", instead of a method")
        ->excludes(against);
    c.add_option("--tiles", command->options.tiles, "Tiles across and down the image")
        ->capture_default_str()
        ->check(CLI::Range(1, 64));
    c.add_option("--json", command->json, "Write every figure to this JSON file");
    c.add_option("--seed", command->options.seed, "Seed of all random numbers")
        ->capture_default_str();
    c.add_option("--threads", command->options.threads, "Runs at a time; 0: one a core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
