#include "render/render_report.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "render/aov.h"
#include "render/method_choice.h"
#include "render/warnings.h"

namespace etendue {

nlohmann::json statistics(const Film& film, const RenderStats& s, double seconds,
                          const ErrorEstimate& e) {
    const Film::MeanEstimate mean = film.mean_luminance();
    const FilmGeometry& g = film.geometry();
    nlohmann::json j{
        {"width", g.crop_width},
        {"height", g.crop_height},
        {"spp", film.passes()},
        {"seconds", seconds},
        {"samples_per_second", double(film.passes()) * double(g.pixel_count()) / seconds},
        {"rays_per_second", double(s.rays()) / seconds},
        {"walk_rays", s.walk_rays},
        {"shadow_rays", s.shadow_rays},
        {"visible_shadow_rays", s.visible},
        {"pairs", s.pairs},
        {"visible_pairs", s.visible_pairs},
        {"trials", s.trials},
        {"trial_rays", s.trial_rays},
        {"pairs_by_trials", s.pairs_by_trials},
        {"chains", s.chains},
        {"chain_seeds", s.chain_seeds},
        {"chain_trials", s.chain_trials},
        {"chain_failures", s.chain_failures},
        {"chains_by_trials", s.chains_by_trials},
        {"chain_rays", s.chain_rays},
        {"bounds_exceeded", s.bounds_exceeded},
        {"runaways", s.runaways},
        {"eye_paths", s.eye_paths},
        {"light_paths", s.light_paths},
        {"vertices", s.vertices},
        {"rejected_contributions", s.rejected},
        {"warnings", warnings(s)},
        {"mean_luminance", mean.mean},
        {"mean_luminance_standard_error",
         mean.standard_error ? nlohmann::json(*mean.standard_error) : nlohmann::json()},
        {"mean_luminance_count", mean.count},
    };
    const PhaseSeconds& p = s.phases;
    j["phase_seconds"] = {{"light_paths", p.light_paths},
                          {"records", p.records},
                          {"eye_paths", p.eye_paths - p.connections},
                          {"connections", p.connections}};
    if (e.valid)
        j["relative_error"] = {
            {"estimate", e.relative_rms}, {"low_95", e.low}, {"high_95", e.high}};
    return j;
}

nlohmann::json to_json(const Renderer& r, const Scene& scene, const RenderSettings& settings,
                       const std::string& stopped_by, const PassLog& log,
                       const ErrorEstimate* error) {
    nlohmann::json j = statistics(r.film(), r.stats(), r.seconds(), error ? *error : r.error());
    j["scene"] = scene.file();
    j["integrator"] = settings.integrator.to_string();
    j["estimator"] = to_string(r.integrator().estimator());
    j["seed"] = settings.seed;
    if (settings.first_pass > 0) j["first_pass"] = settings.first_pass;
    if (settings.choice) j["auto"] = settings.choice->to_json();
    j["stopped_by"] = stopped_by;
    j["pass_seconds"] = log.seconds;
    j["pass_pairs"] = log.pairs;
    for (const auto& [name, value] : r.integrator().figures()) j[name] = value;
    return j;
}

ImageAttributes attributes_of(const nlohmann::json& report) {
    ImageAttributes attributes;
    for (const auto& [key, value] : report.items())
        if (value.is_string())
            attributes["etendue." + key] = value.get<std::string>();
        else if (value.is_number_unsigned() && value.get<uint64_t>() >> 53 != 0)
            attributes["etendue." + key] = value.dump();
        else if (value.is_number())
            attributes["etendue." + key] = value.get<double>();
    attributes["etendue.version"] = std::string(ETENDUE_VERSION);
    return attributes;
}

ImageRows image_rows(const Film& film, std::span<const AovImage> layers, bool has_variance,
                     const nlohmann::json& report) {
    std::vector<std::string> names{""};
    for (const AovImage& layer : layers) names.push_back(layer.name);
    if (has_variance) names.push_back("variance");
    const FilmGeometry& g = film.geometry();
    ImageRows rows{g.crop_width, g.crop_height, {}, attributes_of(report), {}};
    for (const std::string& name : names) add_rgb_channels(name, rows.channels);
    rows.make = [&film, layers, has_variance](int y, std::span<float> to) {
        const auto width = size_t(film.geometry().crop_width);
        const uint64_t first = uint64_t(y) * width;
        const size_t channels = to.size() / width;
        size_t at = 0;
        const auto add = [&](std::span<const Rgb> pixels) {
            for (size_t x = 0; x < width; ++x)
                for (int c = 0; c < 3; ++c) to[x * channels + at + size_t(c)] = pixels[x][c];
            at += 3;
        };
        std::vector<Rgb> row(width);
        film.image(first, row);
        add(row);
        for (const AovImage& layer : layers) add(std::span(layer.pixels).subspan(first, width));
        if (!has_variance) return;
        film.variance(first, row);
        add(row);
    };
    return rows;
}

}  // namespace etendue
