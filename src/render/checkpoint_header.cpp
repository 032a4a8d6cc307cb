#include "render/checkpoint_header.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "description/json_text.h"
#include "render/renderer.h"

namespace etendue {
namespace {

using Json = nlohmann::ordered_json;

/// The longest paths that technique images may have.
constexpr int kMostTechniqueEdges = 64;
/// What is thrown for a number in a description that is none of this kind.
struct WrongNumber {};

uint64_t natural(const nlohmann::json& j) {
    if (!j.is_number_unsigned()) throw WrongNumber();
    return j.get<uint64_t>();
}
int small_natural(const nlohmann::json& j) {
    constexpr uint64_t kMost = 1 << 20;
    if (natural(j) > kMost) throw WrongNumber();
    return int(natural(j));
}

CheckpointHeader parse_header(const nlohmann::json& j) {
    CheckpointHeader h;
    h.scene = j.at("scene").get<std::string>();
    h.integrator = j.at("integrator").get<std::string>();
    h.estimator = j.at("estimator").get<std::string>();
    h.is_merged = j.at("merged").get<bool>();
    const nlohmann::json& film = j.at("film");
    const auto size = [&](size_t i) { return small_natural(film.at(i)); };
    h.film = {size(0), size(1), size(2), size(3), size(4), size(5)};
    h.technique_depth = small_natural(j.at("technique_depth"));
    for (const auto& c : j.at("conditions"))
        h.conditions.emplace_back(c.at(0).get<std::string>(), c.at(1).get<std::string>());
    for (const auto& r : j.at("passes"))
        h.ranges.push_back({natural(r.at(0)), natural(r.at(1)), natural(r.at(2))});
    h.choice = j.value("choice", "");
    return h;
}

}  // namespace

std::string to_string(const PassRange& range) {
    return fmt::format("passes {}:{} of seed {}", range.first, range.first + range.passes,
                       range.seed);
}

uint64_t CheckpointHeader::passes() const {
    uint64_t sum = 0;
    for (const PassRange& r : ranges) sum += r.passes;
    return sum;
}

std::string CheckpointHeader::condition(const std::string& name) const {
    for (const auto& [own, value] : conditions)
        if (own == name) return value;
    return "";
}

void save_header(const CheckpointHeader& h, SectionWriter& to) {
    Json conditions = Json::array(), ranges = Json::array();
    for (const auto& [name, value] : h.conditions) conditions.push_back({name, value});
    for (const PassRange& r : h.ranges) ranges.push_back({r.seed, r.first, r.passes});
    const FilmGeometry& g = h.film;
    Json header{{"scene", h.scene},
                {"integrator", h.integrator},
                {"estimator", h.estimator},
                {"passes", ranges},
                {"merged", h.is_merged},
                {"film", {g.width, g.height, g.crop_x, g.crop_y, g.crop_width, g.crop_height}},
                {"technique_depth", h.technique_depth},
                {"conditions", conditions}};
    if (!h.choice.empty()) header["choice"] = h.choice;
    to.begin("rendering");
    to.put(header.dump(2, ' ', false, Json::error_handler_t::replace));
}

CheckpointHeader load_header(SectionReader& from) {
    std::string text;
    from.open("rendering");
    from.get(text);
    from.finish();
    from.close();
    const char* const kDamaged = "the description of the rendering is damaged";
    CheckpointHeader h;
    try {
        h = parse_header(parse_json(text, from.name()));
    } catch (const nlohmann::json::exception&) {
        from.fail(kDamaged);
    } catch (const WrongNumber&) {
        from.fail(kDamaged);
    }
    for (const PassRange& r : h.ranges)
        if (r.passes == 0 || r.first >= kMostPasses || r.passes > kMostPasses - r.first)
            from.fail("a range of passes cannot be");
    const FilmGeometry& g = h.film;
    if (g.crop_width == 0 || g.crop_height == 0) from.fail("the image has no pixels");
    if (h.technique_depth > kMostTechniqueEdges)
        from.fail("the length of paths with technique images cannot be");
    if (h.ranges.empty() || (h.ranges.size() > 1) != h.is_merged)
        from.fail("the ranges of passes cannot be");
    // What is read later is no larger than the file, and what is allocated before, not much larger.
    const uint64_t bytes = from.size("film");
    if (g.pixel_count() > bytes / sizeof(PixelMoments) || h.passes() > bytes / sizeof(double))
        from.fail("section \"film\" is too short for the image");
    return h;
}

}  // namespace etendue
