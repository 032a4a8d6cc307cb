#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string_view>

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "image/radiance_file.h"
#include "interrupt.h"
#include "json_text.h"
#include "messages.h"
#include "number_checks.h"
#include "option_groups.h"
#include "output_checks.h"
#include "path_lengths.h"
#include "render/render_request.h"
#include "scene_options.h"
#include "system/failure.h"
#include "system/output_file.h"
#include "usage_error.h"
#include "verify/image_series.h"
#include "verify/reference_image.h"
#include "verify/report_json.h"
#include "verify/verify.h"

namespace etendue {
namespace {

struct VerifyCommand {
    SceneOptions scene;
    std::vector<std::string> methods{"path", "light", "bdpt"};
    std::vector<std::string> against{"path", "light"};
    std::vector<std::string> images;
    std::string lengths = "1..8", detect, reference, json;
    uint64_t spp = 0;
    double seconds = 0;
    VerifyOptions options;
    bool quiet = false;

    void run();

private:
    void compare_images() const;
};

/// A share such as "0.5%" or "0.005", in [1e-4, 1).
double parse_share(const std::string& text, const char* option) {
    double value = 0;
    const char* begin = text.data();
    const auto [end, error] = std::from_chars(begin, begin + text.size(), value);
    const std::string_view rest(end, size_t(begin + text.size() - end));
    if (rest == "%") value /= 100;
    if (error != std::errc() || !(rest.empty() || rest == "%") || !(value >= 1e-4 && value < 1))
        throw UsageError(fmt::format(
            "{} must be a share between 0.01% and 100%, such as 0.5% or 0.005, but is \"{}\"",
            option, text));
    return value;
}

// -- Text.

std::string percent(double v) {
    const double p = 100 * v;
    return p == 0 ? "0 %" : p < 0.01 ? "< 0.01 %" : fmt::format("{:.{}f} %", p, p < 9.995 ? 2 : 1);
}

std::string describe(const VerifyReport& report, const WelchTest& t) {
    if (!t.is_tested())
        return t.method.mean() == 0 && t.reference.mean() == 0 ? "no light"
                                                               : "too few samples to test";
    return fmt::format("ratio {:.5f} ± {:.5f}, p = {:.2g}{}", t.ratio(), t.ratio_error(), t.p,
                       report.deviates(t) ? "  DEVIATES" : "");
}

const char* kChannels[] = {"red", "green", "blue"};

void print_image(const VerifyReport& report, const MethodReport& m) {
    for (size_t c = 0; c < m.image.size(); ++c)
        fmt::print("  image, {:<6} {}\n", kChannels[c], describe(report, m.image[c]));
    size_t tested = 0, deviating = 0, worst = 0;
    for (size_t i = 0; i < m.tiles.size(); ++i) {
        const WelchTest& t = m.tiles[i];
        tested += t.is_tested();
        deviating += report.deviates(t);
        if (t.is_tested() && (!m.tiles[worst].is_tested() || t.p < m.tiles[worst].p)) worst = i;
    }
    fmt::print("  tiles         {} of {} tested by channel, {} deviate", tested, m.tiles.size(),
               deviating);
    if (tested > 0)
        fmt::print("; the worst, tile {}, {}: {}", worst / 3, kChannels[worst % 3],
                   describe(report, m.tiles[worst]));
    fmt::print("\n");
    if (m.out_of_reach + m.too_rare > 0)
        fmt::print("  image and tiles contain only the compared paths, {} of the light\n",
                   percent(1 - m.out_of_reach - m.too_rare));
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

void print_classes(const VerifyReport& report, const MethodReport& m) {
    size_t deviating = 0;
    for (const ClassReport& c : m.classes) deviating += report.deviates(c.comparison);
    if (!m.classes.empty())
        fmt::print("  {} classes of paths tested, {} deviate\n"
                   "  class of paths     share  would be found  against  comparison\n",
                   m.classes.size(), deviating);
    for (const ClassReport& c : m.classes)
        if (c.share >= kLargeShare || report.deviates(c.comparison))
            fmt::print("  {:<14}  {:>8}  {:>14}  {:>7}  {}\n", to_string(c.path_class),
                       percent(c.share), percent(c.comparison.detectable(report.level)),
                       c.reference, describe(report, c.comparison));

    constexpr size_t kMostShown = 6;
    if (m.untested.empty()) return;
    fmt::print("  not compared       share  reason; could hide an error of up to that share\n");
    double rest = 0;
    for (size_t i = 0; i < m.untested.size(); ++i) {
        const UntestedClass& c = m.untested[i];
        if (i >= kMostShown)
            rest += c.share;
        else
            fmt::print("  {:<14}  {:>8}  {}\n", to_string(c.path_class), percent(c.share),
                       c.is_out_of_reach
                           ? "out of reach"
                           : fmt::format("too rare: {:.0f} effective contributions, {:.0f} of the "
                                         "reference",
                                         c.method_count, c.reference_count));
    }
    if (m.untested.size() > kMostShown)
        fmt::print("  {} more         {:>8}\n", m.untested.size() - kMostShown, percent(rest));
}

/// A table with one row per path length and one column per number s of light vertices; `pairs` selects merges and
/// gathers, or specular connections, which no method has together; or all other techniques.
void print_techniques(const VerifyReport& report, const MethodReport& m, bool pairs) {
    std::map<int, std::vector<const TechniqueReport*>> rows;
    for (const TechniqueReport& t : m.techniques)
        if (has_own_light_side(t.technique.strategy) == pairs)
            rows[t.technique.vertices() - 1].push_back(&t);
    if (rows.empty()) return;
    fmt::print("  {} alone, ratio to the reference (standard error of the last digits; share "
               "compared), by s\n",
               pairs ? "pairs of vertices, or specular connections," : "connections");
    for (const auto& [edges, row] : rows) {
        std::string line = fmt::format("  {:>6} ", edges);
        int column = 0;
        for (const TechniqueReport* t : row) {
            for (; column < t->technique.s; ++column) line += fmt::format(" {:>18}", "");
            const WelchTest& test = t->comparison;
            line += fmt::format(" {:>18}",
                                !test.is_tested()
                                    ? "-"
                                    : fmt::format("{}{:.3f}({:.0f}; {:.0f} %)",
                                                  report.deviates(test) ? "!" : "", test.ratio(),
                                                  std::ceil(1000 * test.ratio_error()),
                                                  100 * t->coverage));
            ++column;
        }
        fmt::print("{}\n", line);
    }
    for (const TechniqueReport& t : m.techniques)
        if (has_own_light_side(t.technique.strategy) == pairs && report.deviates(t.comparison))
            fmt::print("  s = {}, t = {}: {}\n", t.technique.s, t.technique.t,
                       describe(report, t.comparison));
}

/// The smallest error that the tests would have found, in words.
std::string power(const Detectable& d) {
    if (!d.image) return "no error of the image could have been found";
    std::string text = fmt::format("an error of {} of the image", percent(*d.image));
    if (d.length)
        text += fmt::format(", or of {} of any path length with {:.0f} % of the light or more{},",
                            percent(*d.length), 100 * kLargeShare,
                            d.not_tested.empty()
                                ? ""
                                : fmt::format(" (except paths of {} edges, which were not tested)",
                                              fmt::join(d.not_tested, ", ")));
    return text + " would have been found with 90 % probability";
}

void print_verdict(const VerifyReport& report, const MethodReport& m,
                   const VerifyOptions& options) {
    const char* claim = to_string(m.estimator);
    switch (report.verdict(m)) {
    case Verdict::Consistent:
        fmt::print("  verdict: no bias was found (it claims to be {})", claim);
        break;
    case Verdict::Deviates:
        fmt::print("  verdict: NOT unbiased, where marked above (it claims to be {})", claim);
        break;
    case Verdict::Undecided:
        fmt::print("  verdict: undecided, more samples are needed (it claims to be {})", claim);
        break;
    }
    const Detectable detectable = report.detectable(m);
    fmt::print("; {}", power(detectable));
    if (options.detect && !detectable.reaches(*options.detect))
        fmt::print("; the time ran out before {} was reached", percent(*options.detect));
    if (m.out_of_reach > 0)
        fmt::print("; {} of the light is out of reach of the method or of all references",
                   percent(m.out_of_reach));
    if (m.too_rare > 0)
        fmt::print("; {} of the light comes from paths that are too rare for a test, which could "
                   "hide an error of up to that size",
                   percent(m.too_rare));
    fmt::print("\n\n");
}

void print_level(const VerifyReport& report, double alpha) {
    fmt::print("{} comparisons with a joint probability of a false alarm of {}: each is tested at "
               "{:.3g}\n\n",
               report.tests, alpha, report.level);
}

void print_report(const VerifyReport& report, const Scene& scene, const VerifyOptions& options) {
    fmt::print("{}, {} x {} pixels, {} runs, sampler {}, against {}\n", scene.file(),
               scene.film().crop_width, scene.film().crop_height, options.runs,
               to_string(options.sampler), report.reference);
    print_level(report, options.alpha);
    for (const MethodReport& m : report.methods) {
        fmt::print("{}, {} spp per run\n", m.method, m.spp);
        print_image(report, m);
        print_lengths(report, m);
        print_classes(report, m);
        print_techniques(report, m, false);
        print_techniques(report, m, true);
        if (m.slope)
            fmt::print("  error of the mean of 1 to {} runs: slope {:.3f}\n", m.errors.back().runs,
                       *m.slope);
        print_verdict(report, m, options);
    }
}

void print_report(const VerifyReport& report, const ImageSeries& images, const ImageSeries& against,
                  double alpha) {
    const MethodReport& m = report.methods.front();
    fmt::print("{} images ({}) against {} ({}), {} x {} pixels\n", images.count(), m.method,
               against.count(), report.reference, images.width(), images.height());
    print_level(report, alpha);
    print_image(report, m);
    switch (report.verdict(m)) {
    case Verdict::Consistent:
        fmt::print("  verdict: no difference of the expectations was found");
        break;
    case Verdict::Deviates:
        fmt::print("  verdict: the expectations DIFFER, where marked above");
        break;
    case Verdict::Undecided:
        fmt::print("  verdict: undecided, more images or more samples are needed");
        break;
    }
    fmt::print("; {}\n", power(report.detectable(m)));
}

void throw_all(const std::vector<std::string>& failures) {
    if (!failures.empty()) throw std::runtime_error(fmt::format("{}", fmt::join(failures, "; ")));
}

/// The files of folders, and the others.
std::vector<std::string> files_of(const std::vector<std::string>& names) {
    std::vector<std::string> files;
    for (const std::string& name : names) {
        if (!std::filesystem::is_directory(name)) {
            files.push_back(name);
            continue;
        }
        const std::vector<std::string> inside = radiance_files(name);
        files.insert(files.end(), inside.begin(), inside.end());
    }
    return files;
}

void VerifyCommand::compare_images() const {
    for (const auto* names : {&images, &against})
        for (const std::string& file : files_of(*names))
            refuse_same_file("image", file, "results", json);
    if (!json.empty()) OutputFile::check(json);
    ImageSeries ours(options.tiles), theirs(options.tiles);
    ours.add_files(images);
    theirs.add_files(against);
    const VerifyReport report = verify_images(ours, theirs, options.alpha);
    // The file first, since standard output may have gone.
    const std::string not_written = failure_of([&] {
        if (!json.empty())
            write_file(json, json_text(to_json(report, ours, theirs, options.alpha)));
    });
    if (!quiet) print_report(report, ours, theirs, options.alpha);
    std::vector<std::string> failures;
    if (!not_written.empty()) failures.push_back(not_written);
    if (report.verdict(report.methods.front()) == Verdict::Deviates)
        failures.emplace_back("the expectations of the images differ");
    throw_all(failures);
}

void VerifyCommand::run() {
    if (!images.empty()) return compare_images();
    const PathSelection selected = parse_lengths(lengths, PathClass::kMostEdges);
    options.shortest = selected.shortest;
    options.longest = selected.longest;
    if (spp > 0) options.spp = spp;
    if (spp > 0 && seconds > 0 && detect.empty())
        throw UsageError("--time and --spp exclude each other, except with --detect");
    if (seconds > 0) options.seconds = seconds;
    if (!detect.empty()) options.detect = parse_share(detect, "--detect");
    refuse_same_file("scene", scene.file, "results", json);
    refuse_same_file("reference", reference, "results", json);
    for (const auto* names : {&methods, &against})
        for (const std::string& m : *names) refuse_user_paths(m, "results", json);
    options.against.clear();
    for (const std::string& m : against) options.against.push_back(IntegratorSpec::parse(m));
    std::vector<IntegratorSpec> specs;
    for (const std::string& m : methods) specs.push_back(IntegratorSpec::parse(m));
    for (const IntegratorSpec& s : specs) make_integrator(s);

    SceneOptions loading = scene;
    loading.threads = options.threads;
    const Scene s = load_scene(loading);
    print_warnings(s.warnings());
    std::optional<ReferenceImage> image;
    if (!reference.empty()) image = read_reference_image(reference, s);
    const bool is_terminal = isatty(STDERR_FILENO) != 0;
    if (!json.empty()) OutputFile::check(json);
    options.interrupted = &catch_interrupts();
    const VerifyReport report = verify(s, specs, options, image, [&](const std::string& line) {
        if (!quiet && is_terminal) message("\r{}\033[K", line);
    });
    if (!quiet && is_terminal) message("\r\033[K");

    if (report.methods.empty())
        throw std::runtime_error("interrupted before the first comparison: nothing was written");
    // The file first, since standard output may have gone.
    const std::string not_written = failure_of([&] {
        if (!json.empty()) write_file(json, json_text(to_json(report, s, options)));
    });
    print_warnings(report.warnings);
    if (report.interrupted)
        message("warning: interrupted; what follows is based on the renderings until then\n");
    if (!quiet) print_report(report, s, options);
    std::vector<std::string> rejected;
    for (const MethodReport& m : report.methods)
        if (m.estimator == Estimator::Unbiased && report.verdict(m) == Verdict::Deviates)
            rejected.push_back(m.method);
    std::vector<std::string> failures = report.failures;
    if (!not_written.empty()) failures.push_back(not_written);
    if (!rejected.empty())
        failures.push_back(
            fmt::format("claimed to be unbiased, but rejected: {}", fmt::join(rejected, ", ")));
    throw_all(failures);
}

/// Options that apply to --images as well.
constexpr std::string_view kOptionsOfImages[] = {"--against", "--alpha", "--tiles",
                                                 "--json",    "--quiet", "--memory"};

}  // namespace

void add_verify_command(CLI::App& app) {
    auto command = std::make_shared<VerifyCommand>();
    CLI::App& c = *app.add_subcommand(
        "verify", "Test whether methods are unbiased, or whether images have the same expectation");
    c.add_option("--methods", command->methods,
                 "Integrators with parameters, as for render -i, separated by spaces")
        ->capture_default_str();
    auto* lengths = c.add_option("--lengths", command->lengths, "Path lengths to compare, in edges")
                        ->capture_default_str();
    c.add_option("--runs", command->options.runs, "Independent renderings of each method")
        ->capture_default_str()
        ->check(CLI::Range(8, 4096));
    c.add_option("--alpha", command->options.alpha,
                 "Probability of a false alarm in all comparisons together")
        ->capture_default_str()
        ->check(must_be_within(1e-9, 0.5));
    c.add_option("--spp", command->spp,
                 "Samples per pixel of each run; with --detect, of each rendering")
        ->check(must_be_above_0);
    c.add_option("--time", command->seconds,
                 "Seconds for all runs of one method (default: 30, unless --spp is given); with "
                 "--detect, for the whole command (default: no limit)")
        ->check(must_be_above_0);
    auto* detect = c.add_option(
        "--detect", command->detect,
        "Render until a relative error of this size (0.5% or 0.005) in the image, or in a path "
        "length with at least 2 % of the light, would be found with 90 % probability");
    add_sampler_option(c, command->options.sampler, ", as for render");
    auto* against = c.add_option("--against", command->against,
                                 "Methods to compare with: the first one, and each other one on "
                                 "the classes of paths that it estimates much better")
                        ->capture_default_str();
    CLI::Option* images =
        c.add_option(
             "--images", command->images,
             "Instead of SCENE: test whether these independent images, .exr or .pfm files or "
             "folders of them, have the same expectation as those of --against")
            ->needs(against);
    c.add_option("--reference", command->reference,
                 "Reference image, an .exr with a layer \"variance\", instead of --against")
        ->excludes(against)
        ->excludes(detect)
        ->excludes(lengths);
    c.add_option("--tiles", command->options.tiles, "Number of tiles along each side of the image")
        ->capture_default_str()
        ->check(CLI::Range(1, 64));
    c.add_option("--json", command->json, "Write all results to this JSON file");
    c.add_option("--seed", command->options.seed, "Seed of all random numbers")
        ->capture_default_str()
        ->check(must_be_unsigned);
    c.add_option("--threads", command->options.threads,
                 "Number of runs rendered at the same time; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    command->scene.add_to(c);
    CLI::Option* scene = c.get_option("SCENE")->required(false);
    set_group(c, kForExperts, {"--lengths", "--runs", "--alpha", "--tiles", "--sampler"});
    c.callback([command, &c, images, scene] {
        if (images->count() == 0 && scene->count() == 0)
            throw CLI::RequiredError("SCENE, or --images with --against");
        if (images->count() > 0)
            for (const CLI::Option* o : c.get_options())
                if (o->count() > 0 && o != images &&
                    std::ranges::find(kOptionsOfImages, o->get_name()) ==
                        std::end(kOptionsOfImages))
                    throw CLI::ExcludesError("--images", o->get_name());
        command->run();
    });
}

}  // namespace etendue
