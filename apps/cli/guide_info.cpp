#include "guide_info.h"

#include <cmath>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "image/image_io.h"
#include "output_checks.h"
#include "render/learned_guide.h"
#include "render/render_request.h"
#include "system/output_file.h"

namespace etendue {
namespace {

using nlohmann::json;

constexpr std::array<const char*, kGuideClasses> kGloss{"matte", "somewhat glossy", "glossy"};

json to_json(Vec3 v) {
    return {v.x, v.y, v.z};
}

json to_json(const GuidedPlace::Field& field) {
    json lobes = json::array();
    for (const GuidedPlace::Lobe& l : field.lobes()) {
        json lobe{{"share", l.share},
                  {"weight", l.weight},
                  {"kappa", l.kappa},
                  {"direction", to_json(l.direction)}};
        if (std::isfinite(l.distance)) lobe["distance"] = l.distance;
        lobes.push_back(lobe);
    }
    return {{"share", field.share}, {"lobes", lobes}};
}

json to_json(const std::vector<EmitterChoice>& choices) {
    json j = json::array();
    for (const EmitterChoice& c : choices)
        j.push_back({{"emitter", c.name}, {"learned", c.learned}, {"by_power", c.by_power}});
    return j;
}

json to_json(const GuidedPlace& place, const std::vector<int>& pixel) {
    json j{{"pixel", pixel},
           {"delta_events", place.delta_events},
           {"emission", to_json(place.emission)}};
    if (!place.is_surface) return j;
    j["shape"] = place.shape;
    j["position"] = to_json(place.p);
    j["normal"] = to_json(place.normal);
    j["cell_center"] = to_json(place.cell_center);
    j["gloss"] = kGloss[size_t(place.gloss_class)];
    j["eye_walks"] = to_json(place.eye);
    j["light_walks"] = to_json(place.light);
    j["next_events"] = to_json(place.lights);
    return j;
}

std::string vector_text(const json& v) {
    return fmt::format("({:.4g}, {:.4g}, {:.4g})", v[0].get<float>(), v[1].get<float>(),
                       v[2].get<float>());
}

/// The lobes of one field, as a table.
std::string field_text(const char* title, const json& field) {
    const json& lobes = field["lobes"];
    if (lobes.empty()) return fmt::format("    {}: nothing learned\n", title);
    std::string text = fmt::format(
        "    {}: {:.3f} of the directions from {} {}\n"
        "      share   weight      kappa  direction                        distance\n",
        title, field["share"].get<double>(), lobes.size(), lobes.size() == 1 ? "lobe" : "lobes");
    for (const json& l : lobes) {
        const json& d = l["direction"];
        text += fmt::format(
            "      {:.4f}  {:.4f}  {:9.4g}  ({:8.5f}, {:8.5f}, {:8.5f})  {}\n",
            l["share"].get<double>(), l["weight"].get<double>(), l["kappa"].get<double>(),
            d[0].get<double>(), d[1].get<double>(), d[2].get<double>(),
            l.contains("distance") ? fmt::format("{:9.4g}", l["distance"].get<double>())
                                   : "  infinite");
    }
    return text;
}

std::string choices_text(const json& choices, const char* of) {
    std::string text;
    for (const json& c : choices)
        text += fmt::format("    \"{}\" has a share of {:.3f} {}, by power {:.3f}\n",
                            c["emitter"].get<std::string>(), c["learned"].get<double>(), of,
                            c["by_power"].get<double>());
    return text;
}

std::string place_text(const json& place) {
    std::string text = fmt::format("  pixel       {},{}", place["pixel"][0].get<int>(),
                                   place["pixel"][1].get<int>());
    const int events = place["delta_events"].get<int>();
    const std::string by_way = events == 0 ? ""
                                           : fmt::format(", after {} mirror{} or smooth glass",
                                                         events, events == 1 ? "" : "s");
    if (!place.contains("shape"))
        return text + fmt::format(": the environment{}\n", by_way) +
               field_text("emission from infinity", place["emission"]);
    text += fmt::format(": \"{}\", {}{}\n    position {}, normal {}, centre of the cell {}\n",
                        place["shape"].get<std::string>(), place["gloss"].get<std::string>(),
                        by_way, vector_text(place["position"]), vector_text(place["normal"]),
                        vector_text(place["cell_center"]));
    text += field_text("eye walks, toward radiance", place["eye_walks"]);
    text += field_text("light walks, toward importance", place["light_walks"]);
    if (!place["emission"]["lobes"].empty())
        text += field_text("emission, toward importance", place["emission"]);
    text += choices_text(place["next_events"], "of the next events there");
    return text;
}

}  // namespace

void GuideInfo::add_to(CLI::App& command) {
    CLI::Option* guide = command.add_flag(
        "--guide", is_wanted, "Train the guide of the method and summarise what it has learned");
    command
        .add_option("--shares", shares,
                    "Image to write: share of guided directions at the first surfaces, red for eye "
                    "walks, green for light walks")
        ->needs(guide);
    CLI::Option* at =
        command
            .add_option("--pixel", pixel, "List the lobes at this column and row of the image: x,y")
            ->delimiter(',')
            ->expected(2)
            ->needs(guide);
    command
        .add_option("--directions", directions,
                    "Image to write: learned directions at the pixel, red for eye walks, green for "
                    "light walks, blue for emission")
        ->needs(at);
}

void GuideInfo::check() const {
    refuse_same_file("image of shares", shares, "image of directions", directions);
    for (const std::string& file : {shares, directions})
        if (!file.empty()) {
            check_image_extension(file);
            OutputFile::check(file);
        }
}

json GuideInfo::run(const Scene& scene, const std::string& integrator, uint64_t seed,
                    int threads) const {
    const LearnedGuide learned(scene, choose_integrator(scene, integrator), seed, threads);
    const Guide& guide = learned.guide();
    json place;
    if (!pixel.empty()) {
        const GuidedPlace at = learned.at_pixel(pixel[0], pixel[1]);
        place = to_json(at, pixel);
        constexpr int kHeight = 256;
        if (!directions.empty()) write_image(directions, at.directions(2 * kHeight, kHeight));
    }
    const Image image = learned.shares();
    if (!shares.empty()) write_image(shares, image);
    const auto mean = LearnedGuide::mean_shares(image);
    json j{{"method", learned.method()},
           {"cells", guide.surfaces.cells().size()},
           {"bytes", guide.memory_bytes()},
           {"gain_eye", guide.surfaces.gain(TransportMode::Radiance)},
           {"gain_light", guide.surfaces.gain(TransportMode::Importance)},
           {"gain_emission", guide.emission_gain},
           {"gain_lights", guide.lights.gain()},
           {"share_eye", mean[0]},
           {"share_light", mean[1]},
           {"emitter_choices", to_json(learned.emitter_choices(5))}};
    if (!place.is_null()) j["place"] = place;
    return j;
}

std::string guide_text(const json& j) {
    const auto number = [&](const char* name) { return j[name].get<double>(); };
    std::string text =
        fmt::format("  guide       of {}, {} cells, {:.1f} MiB\n", j["method"].get<std::string>(),
                    j["cells"].get<size_t>(), number("bytes") / (1 << 20));
    text += fmt::format("    eye walks   gain {:.2f} nats, share {:.3f} at the first surfaces\n",
                        number("gain_eye"), number("share_eye"));
    text += fmt::format("    light walks gain {:.2f} nats, share {:.3f} at the first surfaces\n",
                        number("gain_light"), number("share_light"));
    text += fmt::format("    emission    gain {:.2f} nats\n", number("gain_emission"));
    text += fmt::format("    next events gain {:.2f} nats by the selection of emitters\n",
                        number("gain_lights"));
    text += choices_text(j["emitter_choices"], "of the light paths");
    return j.contains("place") ? text + place_text(j["place"]) : text;
}

}  // namespace etendue
