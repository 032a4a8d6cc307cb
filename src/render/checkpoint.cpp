#include "render/checkpoint.h"

#include <gnu/libc-version.h>

#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "description/fingerprint.h"
#include "description/json_text.h"
#include "geometry/ray_tracer.h"
#include "math/content_hash.h"
#include "render/method_choice.h"
#include "render/render_request.h"
#include "render/statistics_section.h"
#include "system/processor.h"

namespace etendue {
namespace {

std::string hexadecimal(uint64_t hash) {
    return fmt::format("{:016x}", hash);
}

const char* yes_or_no(bool b) {
    return b ? "yes" : "no";
}

/// The parameters with those that were not given, but without names of files, of which the contents matter.
std::string with_defaults(const IntegratorSpec& spec) {
    if (spec.make) return spec.to_string();
    IntegratorSpec full = spec;
    for (const ParamInfo& p : integrator_entry(spec.name).info.params)
        full.params.emplace(p.name, p.fallback);
    full.params.erase("user_paths");
    return as_utf8(full.to_string());
}

/// Hash of the file that the parameters name.
std::string files_of(const IntegratorSpec& spec) {
    const auto file = spec.params.find("user_paths");
    std::error_code ignored;
    if (file == spec.params.end() || !std::filesystem::is_regular_file(file->second, ignored))
        return "none";
    return hexadecimal(ContentHash().add(file->first).add(file_fingerprint(file->second)).value());
}

constexpr const char *kSceneCondition = "scene contents", *kSensorCondition = "sensor";

std::string describe(const FilmGeometry& g) {
    std::string text = fmt::format("{} x {}", g.width, g.height);
    if (g.crop_width != g.width || g.crop_height != g.height)
        text += fmt::format(", crop {},{},{},{}", g.crop_x, g.crop_y, g.crop_width, g.crop_height);
    return text;
}

CheckpointHeader header_of(const Renderer& renderer, const Scene& scene,
                           const Conditions& conditions, const RenderSettings& settings) {
    return {.scene = scene.file(),
            .integrator = settings.integrator.to_string(),
            .estimator = to_string(renderer.integrator().estimator()),
            .ranges = {{settings.seed, settings.first_pass, renderer.film().passes()}},
            .film = scene.film(),
            .technique_depth = settings.technique_depth,
            .conditions = conditions,
            .choice = settings.choice ? settings.choice->to_text() : ""};
}

}  // namespace

Conditions conditions_of(const Renderer& renderer, const Scene& scene, const SceneSource& source,
                         const RenderSettings& settings) {
    std::string shown = "all";
    if (!settings.shown.contains_all())
        shown = fmt::format("{} to {} edges{}", settings.shown.shortest, settings.shown.longest,
                            settings.shown.inner_only ? ", inner techniques" : "");
    return {{"program", ETENDUE_VERSION},
            {"build", hexadecimal(program_fingerprint())},
            {"C library", ::gnu_get_libc_version()},
            {"ray tracer", ray_tracer()},
            {"processor", hexadecimal(reciprocals_of_processor())},
            {kSceneCondition, hexadecimal(source.fingerprint)},
            {"lenient", yes_or_no(source.lenient)},
            {"watertight", yes_or_no(source.watertight)},
            {kSensorCondition, fmt::format("{}", scene.sensor_index())},
            {"image", describe(scene.film())},
            {"filter mode",
             to_string(renderer.film().spreads() ? FilterMode::Spread : FilterMode::Sample)},
            {kIntegratorCondition, with_defaults(settings.integrator)},
            {"files of the integrator", files_of(settings.integrator)},
            {"light paths", fmt::format("{}", renderer.light_paths())},
            {"paths shown", shown},
            {"sampler", to_string(settings.sampler)},
            {"seed", fmt::format("{}", settings.seed)},
            {"first pass", fmt::format("{}", settings.first_pass)},
            {"technique images", settings.technique_depth > 0
                                     ? fmt::format("up to {} edges", settings.technique_depth)
                                     : "none"}};
}

bool is_of(const CheckpointHeader& header, const Scene& scene, const SceneSource& source) {
    return header.condition(kSceneCondition) == hexadecimal(source.fingerprint) &&
           header.condition(kSensorCondition) == fmt::format("{}", scene.sensor_index()) &&
           describe(header.film) == describe(scene.film());
}

std::unique_ptr<SectionWriter> written_checkpoint(const std::string& file, const Renderer& renderer,
                                                  const Scene& scene, const Conditions& conditions,
                                                  const RenderSettings& settings,
                                                  const PassLog& log) {
    auto to = std::make_unique<SectionWriter>(file);
    save_header(header_of(renderer, scene, conditions, settings), *to);
    renderer.save(*to);
    save_log(log, *to);
    return to;
}

std::string partial_result(const Renderer& renderer, const Scene& scene,
                           const Conditions& conditions, const RenderSettings& settings,
                           const PassLog& log) {
    SectionWriter to;
    save_header(header_of(renderer, scene, conditions, settings), to);
    renderer.save_sums(to);
    save_log(log, to);
    return to.take();
}

std::string CheckpointFile::obstacle(const Conditions& conditions) const {
    if (header_.is_merged) return "it is the sum of several renderings (etendue merge)";
    if (!has_state()) return "it contains the sums of a rendering, but not its state";
    std::vector<std::string> differences;
    for (const auto& [condition_name, own] : conditions)
        if (const std::string theirs = header_.condition(condition_name); theirs != own)
            differences.push_back(
                fmt::format("{}: \"{}\" there, but \"{}\" here", condition_name, theirs, own));
    return differences.empty() ? ""
                               : fmt::format("the rendering would not go on with the same bits; {}",
                                             fmt::join(differences, "; "));
}

void CheckpointFile::resume(Renderer& renderer, const Conditions& conditions, PassLog& log) {
    if (const std::string why = obstacle(conditions); !why.empty())
        throw std::runtime_error(fmt::format("{} cannot be resumed: {}", name(), why));
    renderer.load(reader_);
    if (renderer.film().passes() != header_.passes())
        reader_.fail("the passes are not those of its film");
    log = load_log(reader_);
    reader_.close();
}

RenderTotals CheckpointFile::totals(bool with_techniques) {
    static const ReconstructionFilter kUnused = ReconstructionFilter::box();
    return in_memory(
        [&] {
            RenderTotals t;
            t.film = std::make_unique<Film>(header_.film, kUnused);
            t.film->load(reader_);
            if (t.film->passes() != header_.passes())
                reader_.fail("the passes are not those of its film");
            load_statistics(reader_, t.stats, t.seconds);
            if (header_.technique_depth > 0 && with_techniques) {
                t.techniques = std::make_unique<TechniqueImages>(header_.film, kUnused,
                                                                 header_.technique_depth);
                t.techniques->add_saved(reader_);
            }
            t.log = load_log(reader_);
            reader_.close();
            return t;
        },
        [&](const char* why) { reader_.fail(why); });
}

}  // namespace etendue
