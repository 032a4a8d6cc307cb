#include "compare/report.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "compare/embedded_image.h"
#include "compare/error_json.h"
#include "compare/plot.h"
#include "compare/report_page.h"
#include "image/image_io.h"
#include "image/tonemap.h"
#include "render/render_request.h"
#include "system/output_file.h"
#include "system/threads.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// ------------------------------------------------------------------------------------------------------- figures

Json to_json(const Interval& i) {
    return {{"value", i.value}, {"low_95", i.low}, {"high_95", i.high}};
}
Json to_json(const PowerLaw& p) {
    return {{"slope", p.slope}, {"factor", p.factor}, {"points", p.points}};
}
Json to_json(const Efficiency& e);
template <class T>
Json to_json(const std::optional<T>& v) {
    return v ? to_json(*v) : Json();
}
Json to_json(const Efficiency& e) {
    return {{"value", e.value}, {"interval", to_json(e.interval)}};
}

Json to_json(const Run& r) {
    Json checkpoints = Json::array();
    for (const Checkpoint& c : r.checkpoints)
        checkpoints.push_back(
            {{"spp", c.spp}, {"seconds", c.seconds}, {"errors", to_json(c.errors)}});
    return {{"seed", r.seed},
            {"spp", r.spp},
            {"seconds", r.seconds},
            {"rays", r.stats.rays()},
            {"walk_rays", r.stats.walk_rays},
            {"shadow_rays", r.stats.shadow_rays},
            {"eye_paths", r.stats.eye_paths},
            {"light_paths", r.stats.light_paths},
            {"vertices", r.stats.vertices},
            {"rejected_contributions", r.stats.rejected},
            {"mean_luminance", r.mean.mean},
            {"mean_luminance_standard_error",
             r.mean.standard_error ? Json(*r.mean.standard_error) : Json()},
            {"errors", to_json(r.errors())},
            {"errors_with_reference_noise", to_json(r.uncorrected)},
            {"checkpoints", checkpoints}};
}

Json to_json(const MethodSummary& s) {
    return {{"spp", s.spp},
            {"seconds", s.seconds},
            {"rays", s.rays},
            {"rmse", s.rmse},
            {"rel_mse", s.rel_mse},
            {"rel_mse_interval", to_json(s.rel_mse_interval)},
            {"rel_mse_trimmed", s.rel_mse_trimmed},
            {"mape", s.mape},
            {"spike", s.spike},
            {"mean_ratio", to_json(s.mean_ratio)},
            {"rmse_slope", to_json(s.rmse_slope)},
            {"rel_mse_slope", to_json(s.rel_mse_slope)},
            {"rel_mse_slope_interval", to_json(s.rel_mse_slope_interval)},
            {"efficiency", to_json(s.efficiency)},
            {"reference_share", s.reference_share ? Json(*s.reference_share) : Json()}};
}

Json to_json(const Method& m, const MethodSummary& summary) {
    const bool is_rendered = m.folder.empty();
    Json runs = Json::array();
    for (const Run& r : m.runs) runs.push_back(to_json(r));
    return {{"name", m.name()},
            {"integrator", is_rendered ? Json(m.spec.integrator.to_string()) : Json()},
            {"estimator", is_rendered ? Json(to_string(m.estimator)) : Json()},
            {"folder", is_rendered ? Json() : Json(m.folder)},
            {"summary", to_json(summary)},
            {"flip", m.flip},
            {"peak_bytes", m.peak_bytes},
            {"technique_spp", m.technique_spp},
            {"warnings", m.warnings()},
            {"runs", runs}};
}

Json to_json(const CompareSettings& s) {
    return {{"seconds", s.limits.seconds ? Json(*s.limits.seconds) : Json()},
            {"spp", s.limits.spp ? Json(*s.limits.spp) : Json()},
            {"runs", s.runs},
            {"paths", s.shown.inner_only ? "inner" : "all"},
            {"shortest_path", s.shown.shortest},
            {"longest_path",
             s.shown.longest == PathSelection::kNoLimit ? Json() : Json(s.shown.longest)},
            {"seed", s.seed},
            {"sampler", to_string(s.sampler)},
            {"threads", thread_count(s.threads)},
            {"technique_depth", s.technique_depth}};
}

std::string processor() {
    std::ifstream info("/proc/cpuinfo");
    for (std::string line; std::getline(info, line);)
        if (line.starts_with("model name"))
            if (const size_t colon = line.find(": "); colon != std::string::npos)
                return line.substr(colon + 2);
    return "unknown";
}

std::string dumped(const Json& json, int indent) {
    return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

// ------------------------------------------------------------------------------------------------------- pictures

std::vector<Rgb> false_colours(const std::vector<float>& values) {
    std::vector<Rgb> out;
    for (float v : values) out.push_back(magma(v));
    return out;
}

/// Name of a technique other than connection_technique(s, t); "" for that one.
const char* kind_name(const Technique& q) {
    return q.strategy == Strategy::Merge                 ? "merge"
           : q.strategy == Strategy::Gather              ? "gather"
           : q.strategy == Strategy::Specular            ? "specular"
           : q.strategy == Strategy::Connect && q.s == 1 ? "stored"
                                                         : "";
}

struct CurveKind {
    const char* file;
    const char* label;
    double (*error)(const ImageErrors&);
    bool has_law;
};
constexpr CurveKind kCurves[] = {
    {"rmse", "RMSE", [](const ImageErrors& e) { return e.rmse; }, true},
    {"rel_mse", "relMSE", [](const ImageErrors& e) { return e.rel_mse; }, true},
    {"rel_mse_trimmed", "relMSE, trimmed", [](const ImageErrors& e) { return e.rel_mse_trimmed; },
     false},
    {"mape", "MAPE", [](const ImageErrors& e) { return e.mape; }, false},
};

/// The convergence plot of the first run, with the mean slope of all runs.
LogLogPlot convergence(const Comparison& c, const std::vector<MethodSummary>& summaries,
                       const CurveKind& kind, const std::string& title) {
    LogLogPlot plot{title, "rendering time (s)", kind.label, {}};
    for (size_t i = 0; i < c.methods.size(); ++i) {
        PlotCurve& curve = plot.curves.emplace_back();
        curve.label = c.methods[i].name();
        for (const Checkpoint& p : c.methods[i].runs.front().checkpoints)
            curve.points.push_back({p.seconds, kind.error(p.errors)});
        if (kind.has_law)
            curve.law = &kind == &kCurves[0] ? summaries[i].rmse_slope : summaries[i].rel_mse_slope;
    }
    return plot;
}

/// What follows the stem of a method in the names of its maps.
constexpr const char *kFlip = "-flip", *kSquaredErrors = "-relse";

/// The stem of a method's files, numbered where files of others have one of these names.
std::string free_stem(const std::string& stem, std::set<std::string>& taken) {
    for (int i = 1;; ++i) {
        const std::string free = i == 1 ? stem : fmt::format("{}-{}", stem, i);
        const std::string names[] = {free, free + kFlip, free + kSquaredErrors};
        if (std::any_of(std::begin(names), std::end(names),
                        [&](const std::string& n) { return taken.contains(n); }))
            continue;
        taken.insert(std::begin(names), std::end(names));
        return free;
    }
}

/// Writes the images and plots of one scene to its folder; write() returns those that the page shows, as JSON.
class SceneFigures {
public:
    SceneFigures(const Comparison& comparison, const std::string& folder, const std::string& name)
        : c_(comparison), folder_(folder),
          name_(name), mapping_{ToneOperator::Srgb, auto_exposure(comparison.reference.pixels), 0} {
    }

    Json write() const {
        Json page{{"name", name_}, {"exposure", mapping_.exposure}};
        write_picture("reference", c_.reference.pixels);
        page["reference"] =
            radiance_data_uri(c_.reference.width, c_.reference.height, c_.reference.pixels);
        page["methods"] = Json::array();
        std::set<std::string> taken{"reference"};
        // A reference that is the image of a method in an earlier report keeps its name.
        const fs::path given = c_.reference.file;
        std::error_code none;
        if (fs::equivalent(given.parent_path() / ".", fs::path(file(".")), none))
            taken.insert(given.stem().string());
        for (const Method& m : c_.methods)
            page["methods"].push_back(write_method(m, free_stem(file_stem(m.name()), taken)));
        page["plots"] = write_plots();
        return page;
    }

private:
    std::string file(const std::string& name) const {
        return (fs::path(folder_) / name_ / name).string();
    }
    /// The reference may be that of an earlier report in the same folder, which has more layers than the image.
    void write_picture(const std::string& stem, const std::vector<Rgb>& pixels) const {
        const auto [w, h] = std::pair{c_.reference.width, c_.reference.height};
        const auto write = [&](const std::string& name, const Image& image) {
            const std::string& given = c_.reference.file;
            if (given.empty() || !are_one_file(name, given)) write_image(name, image);
        };
        write(file(stem + ".exr"), rgb_image(w, h, pixels));
        write(file(stem + ".png"), rgb_image(w, h, tone_map(pixels, mapping_)));
    }
    void write_map(const std::string& stem, const std::vector<float>& values) const {
        write_image(file(stem + ".png"),
                    rgb_image(c_.reference.width, c_.reference.height, false_colours(values)));
    }

    Json write_method(const Method& m, const std::string& stem) const {
        const auto [w, h] = std::pair{c_.reference.width, c_.reference.height};
        write_picture(stem, m.image);
        write_map(stem + kFlip, m.flip_map);
        write_map(stem + kSquaredErrors, relative_squared_errors(m.image, c_.reference.pixels));
        Json page{{"name", m.name()},
                  {"image", radiance_data_uri(w, h, m.image)},
                  {"flip", grey_data_uri(w, h, m.flip_map)},
                  {"techniques", Json::array()}};
        for (const auto& t : m.techniques) {
            const Technique& q = t.technique;
            const std::string kind = kind_name(q);
            const int edges = q.vertices() - 1;
            write_image(file(fmt::format("{}-techniques/length{:02}_s{:02}_t{:02}{}.png", stem,
                                         edges, q.s, q.t, kind)),
                        rgb_image(w, h, tone_map(t.weighted, mapping_)));
            constexpr int kThumbnail = 120;
            const RgbImage weighted = reduced(w, h, t.weighted, kThumbnail),
                           unweighted = reduced(w, h, t.unweighted, kThumbnail);
            page["techniques"].push_back(
                {{"kind", kind},
                 {"edges", edges},
                 {"s", q.s},
                 {"t", q.t},
                 {"width", weighted.width},
                 {"height", weighted.height},
                 {"weighted", radiance_data_uri(weighted.width, weighted.height, weighted.pixels)},
                 {"unweighted",
                  radiance_data_uri(weighted.width, weighted.height, unweighted.pixels)}});
        }
        return page;
    }

    Json write_plots() const {
        Json page = Json::array();
        const std::vector<MethodSummary> summaries = summarize(c_);
        for (const CurveKind& kind : kCurves) {
            const std::string svg = convergence(c_, summaries, kind, name_).svg();
            const std::string name = fmt::format("convergence-{}.svg", kind.file);
            write_file(file(name), svg);
            page.push_back({{"label", kind.label},
                            {"file", fmt::format("{}-{}", name_, name)},
                            {"svg", "data:image/svg+xml;base64," + base64(svg)}});
        }
        return page;
    }

    const Comparison& c_;
    const std::string &folder_, &name_;
    ToneMapping mapping_;
};

/// The name of the file, or of its folder where the file is called "scene..."; numbered where several scenes share it.
std::string scene_name(const std::string& file, std::set<std::string>& taken) {
    const fs::path path = fs::absolute(file);
    std::string stem = path.stem().string();
    if (stem.starts_with("scene") && path.has_parent_path())
        stem = path.parent_path().filename().string();
    stem = file_stem(stem);
    std::string name = stem;
    for (int i = 2; !taken.insert(name).second; ++i) name = fmt::format("{}-{}", stem, i);
    return name;
}

// ------------------------------------------------------------------------------------------------------- page

void replace(std::string& page, std::string_view mark, std::string_view text) {
    page.replace(page.find(mark), mark.size(), text);
}

/// JSON escaped for a <script> element.
std::string script_json(const Json& json) {
    std::string text = dumped(json, -1);
    for (size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
        text.insert(at + 1, "\\");
    return text;
}

}  // namespace

Json to_json(const Comparison& c) {
    const Reference& r = c.reference;
    Json methods = Json::array();
    const std::vector<MethodSummary> summaries = summarize(c);
    for (size_t i = 0; i < c.methods.size(); ++i)
        methods.push_back(to_json(c.methods[i], summaries[i]));
    return {{"file", c.scene_file},
            {"width", c.film.crop_width},
            {"height", c.film.crop_height},
            {"crop", {c.film.crop_x, c.film.crop_y, c.film.crop_width, c.film.crop_height}},
            {"interrupted", c.interrupted},
            {"failures", c.failures},
            {"scene_bytes", c.scene_bytes},
            {"reference",
             {{"file", r.file},
              {"method", r.method},
              {"spp", r.spp},
              {"seconds", r.seconds},
              {"reused", r.reused},
              {"variance_known", r.has_variance()},
              {"mse", c.reference_mse},
              {"rel_mse", c.reference_rel_mse},
              {"mean_relative_error", std::sqrt(r.mean_error.value)},
              {"warnings", r.warnings}}},
            {"methods", methods}};
}

std::string file_stem(const std::string& text) {
    std::string out = text;
    for (char& c : out)
        if (!std::isalnum(static_cast<unsigned char>(c)) &&
            std::string_view("._=-").find(c) == std::string_view::npos)
            c = '_';
    return out;
}

ReportWriter::ReportWriter(ReportOptions options)
    : options_(std::move(options)), report_{{"program", "etendue " + options_.version},
                                            {"processor", processor()},
                                            {"settings", Json()},
                                            {"failures", Json::array()},
                                            {"scenes", Json::array()}},
      pictures_(Json::array()) {}

void ReportWriter::add(const Comparison& c) {
    const std::string name = scene_name(c.scene_file, names_);
    Json scene = to_json(c);
    scene["name"] = name;
    Json pictures = SceneFigures(c, options_.folder, name).write();
    if (report_["settings"].is_null()) report_["settings"] = to_json(c.settings);
    report_["scenes"].push_back(std::move(scene));
    pictures_.push_back(std::move(pictures));
}

void ReportWriter::add_failure(const std::string& scene, const std::string& reason) {
    report_["failures"].push_back({{"file", scene}, {"reason", reason}});
}

void ReportWriter::write() const {
    std::string page(kReportHtml);
    replace(page, "/*{{style}}*/", kReportCss);
    replace(page, "/*{{program}}*/", kReportJs);
    replace(page, "{{report}}", script_json(report_));
    replace(page, "{{pictures}}", script_json(pictures_));
    write_file((fs::path(options_.folder) / "report.json").string(), dumped(report_, 2) + "\n");
    write_file((fs::path(options_.folder) / "report.html").string(), page);
}

void write_report(const std::vector<Comparison>& comparisons, const ReportOptions& options) {
    ReportWriter writer(options);
    for (const Comparison& c : comparisons) writer.add(c);
    writer.write();
}

}  // namespace etendue
