#include "verify/report_json.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "render/render_request.h"

namespace etendue {
namespace {

nlohmann::ordered_json to_json(const VerifyReport& report, const WelchTest& t) {
    nlohmann::ordered_json j{{"tested", t.is_tested()},
                             {"method", t.method.mean()},
                             {"method_standard_error", std::sqrt(t.method.squared_error())},
                             {"reference", t.reference.mean()},
                             {"reference_standard_error", std::sqrt(t.reference.squared_error())},
                             {"effective_count", t.effective_count}};
    if (t.is_tested()) {
        j["p"] = t.p;
        j["deviates"] = report.deviates(t);
        if (t.reference.mean() != 0) j["detectable"] = t.detectable(report.level);
    }
    return j;
}

/// Adds the comparisons of image and tiles, and their power.
void add_images(const VerifyReport& report, const MethodReport& m, nlohmann::ordered_json& j) {
    j["untested_tiles"] = m.untested_tiles;
    const Detectable detectable = report.detectable(m);
    j["detectable"] = {{"lengths_not_tested", detectable.not_tested}};
    if (detectable.image) j["detectable"]["image"] = *detectable.image;
    if (detectable.length) j["detectable"]["length"] = *detectable.length;
    for (const WelchTest& t : m.image) j["image"].push_back(to_json(report, t));
    for (const WelchTest& t : m.tiles) j["tiles"].push_back(to_json(report, t));
}

nlohmann::ordered_json to_json(const VerifyReport& report, const MethodReport& m,
                               const VerifyOptions& options) {
    nlohmann::ordered_json j{{"method", m.method},
                             {"estimator", to_string(m.estimator)},
                             {"verdict", to_string(report.verdict(m))},
                             {"spp", m.spp},
                             {"rejected_contributions", m.stats.rejected},
                             {"runaways", m.stats.runaways},
                             {"bounds_exceeded", m.stats.bounds_exceeded},
                             {"out_of_reach", m.out_of_reach},
                             {"too_rare", m.too_rare}};
    add_images(report, m, j);
    if (options.detect)
        j["detectable"]["is_reached"] = report.detectable(m).reaches(*options.detect);
    for (const LengthReport& l : m.lengths) {
        j["lengths"].push_back(to_json(report, l.comparison));
        j["lengths"].back().update(nlohmann::ordered_json{{"edges", l.edges},
                                                          {"cut_off", l.cut_off},
                                                          {"share", l.share},
                                                          {"out_of_reach", l.out_of_reach},
                                                          {"too_rare", l.too_rare}});
    }
    for (const ClassReport& c : m.classes) {
        j["classes"].push_back(to_json(report, c.comparison));
        j["classes"].back().update(nlohmann::ordered_json{
            {"class", to_string(c.path_class)}, {"share", c.share}, {"against", c.reference}});
    }
    for (const UntestedClass& c : m.untested)
        j["not_compared"].push_back({{"class", to_string(c.path_class)},
                                     {"share", c.share},
                                     {"out_of_reach", c.is_out_of_reach},
                                     {"method_effective_count", c.method_count},
                                     {"reference_effective_count", c.reference_count}});
    for (const TechniqueReport& t : m.techniques) {
        j["techniques"].push_back(to_json(report, t.comparison));
        j["techniques"].back().update(
            nlohmann::ordered_json{{"is_pair", is_pair(t.technique.strategy)},
                                   {"is_specular", t.technique.strategy == Strategy::Specular},
                                   {"s", t.technique.s},
                                   {"t", t.technique.t},
                                   {"coverage", t.coverage}});
    }
    for (const ErrorOfRuns& e : m.errors)
        j["errors"].push_back({{"runs", e.runs}, {"rmse", e.rmse}});
    if (m.slope) j["slope"] = *m.slope;
    return j;
}

}  // namespace

nlohmann::ordered_json to_json(const VerifyReport& report, const Scene& scene,
                               const VerifyOptions& options) {
    nlohmann::ordered_json j{{"scene", scene.file()},
                             {"width", scene.film().crop_width},
                             {"height", scene.film().crop_height},
                             {"reference", report.reference},
                             {"runs", options.runs},
                             {"seed", options.seed},
                             {"sampler", to_string(options.sampler)},
                             {"alpha", options.alpha},
                             {"tests", report.tests},
                             {"level", report.level},
                             {"interrupted", report.interrupted},
                             {"failures", report.failures},
                             {"warnings", report.warnings}};
    if (options.detect) j["detect"] = *options.detect;
    for (const MethodReport& m : report.methods)
        j["methods"].push_back(to_json(report, m, options));
    return j;
}

nlohmann::ordered_json to_json(const VerifyReport& report, const ImageSeries& images,
                               const ImageSeries& against, double alpha) {
    const MethodReport& m = report.methods.front();
    nlohmann::ordered_json method{{"method", m.method}, {"verdict", to_string(report.verdict(m))}};
    add_images(report, m, method);
    return {{"width", images.width()},
            {"height", images.height()},
            {"reference", report.reference},
            {"images", images.count()},
            {"against", against.count()},
            {"alpha", alpha},
            {"tests", report.tests},
            {"level", report.level},
            {"failures", report.failures},
            {"warnings", report.warnings},
            {"methods", nlohmann::ordered_json::array({std::move(method)})}};
}

}  // namespace etendue
