#include "render/checkpoint.h"

#include <gnu/libc-version.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "description/fingerprint.h"
#include "description/json_text.h"
#include "geometry/ray_tracer.h"
#include "math/content_hash.h"
#include "render/render_request.h"
#include "render/statistics_section.h"

namespace etendue {
namespace {

using Json = nlohmann::ordered_json;

/// The longest paths that technique images may have.
constexpr int kMostTechniqueEdges = 64;
/// Conditions of which parts of a sum may differ: other passes, and what changes nothing but last bits.
const std::set<std::string> kMayDiffer{"seed", "first pass", "build", "C library", "ray tracer"};

std::string hexadecimal(uint64_t hash) {
    return fmt::format("{:016x}", hash);
}

const char* yes_or_no(bool b) {
    return b ? "yes" : "no";
}

/// The parameters with those that were not given.
std::string with_defaults(const IntegratorSpec& spec) {
    if (spec.make) return spec.to_string();
    IntegratorSpec full = spec;
    for (const ParamInfo& p : integrator_entry(spec.name).info.params)
        full.params.emplace(p.name, p.fallback);
    return full.to_string();
}

/// Hash of the files that the parameters name.
std::string files_of(const IntegratorSpec& spec) {
    ContentHash hash;
    bool has_files = false;
    for (const auto& [name, value] : spec.params) {
        std::error_code ignored;
        if (value.empty() || !std::filesystem::is_regular_file(value, ignored)) continue;
        hash.add(name).add(file_fingerprint(value));
        has_files = true;
    }
    return has_files ? hexadecimal(hash.value()) : "none";
}

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

std::string describe(const FilmGeometry& g) {
    std::string text = fmt::format("{} x {}", g.width, g.height);
    if (g.crop_width != g.width || g.crop_height != g.height)
        text += fmt::format(", crop {},{},{},{}", g.crop_x, g.crop_y, g.crop_width, g.crop_height);
    return text;
}

// -- Sections.

}  // namespace

/// All numbers of the statistics; a new one does not compile until it is here.
template <class Stats, class Use>
static void for_each_number(Stats& s, const Use& use) {
    auto& [phases, is_timed, eye_paths, light_paths, vertices, walk_rays, shadow_rays, visible,
           joins_skipped, pairs, visible_pairs, trials, trial_rays, pairs_by_trials,
           bounds_exceeded, runaways, rejected] = s;
    (void)is_timed;  // Of the current sample.
    auto& [of_light_paths, of_eye_paths, of_connections, of_records] = phases;
    use(of_light_paths), use(of_eye_paths), use(of_connections), use(of_records);
    use(eye_paths), use(light_paths), use(vertices), use(walk_rays), use(shadow_rays);
    use(visible), use(joins_skipped), use(pairs), use(visible_pairs), use(trials);
    use(trial_rays), use(pairs_by_trials), use(bounds_exceeded), use(runaways), use(rejected);
}

void save_statistics(const RenderStats& stats, double seconds, SectionWriter& to) {
    to.begin("statistics");
    to.put(seconds);
    for_each_number(stats, [&](const auto& v) { to.put(v); });
}

void load_statistics(SectionReader& from, RenderStats& stats, double& seconds) {
    from.open("statistics");
    from.get(seconds);
    for_each_number(stats, [&](auto& v) { from.get(v); });
    from.finish();
}

namespace {

void save_log(const PassLog& log, SectionWriter& to) {
    to.begin("passes");
    to.put(log.seconds);
    to.put(log.pairs);
}

PassLog load_log(SectionReader& from) {
    PassLog log;
    from.open("passes");
    std::vector<double> seconds;
    std::vector<uint64_t> pairs;
    from.get(seconds);
    from.get(pairs, seconds.size(), "numbers of pairs");
    from.finish();
    log.append(seconds, pairs);
    return log;
}

void save_header(const Json& header, SectionWriter& to) {
    to.begin("rendering");
    to.put(header.dump(2, ' ', false, Json::error_handler_t::replace));
}

Json make_header(const Conditions& conditions, const std::vector<PassRange>& ranges,
                 const FilmGeometry& g, int technique_depth, const std::string& scene,
                 const std::string& integrator, const std::string& estimator, bool is_merged) {
    Json of_conditions = Json::array(), of_ranges = Json::array();
    for (const auto& [name, value] : conditions) of_conditions.push_back({name, value});
    for (const PassRange& r : ranges) of_ranges.push_back({r.seed, r.first, r.passes});
    return {{"scene", scene},
            {"integrator", integrator},
            {"estimator", estimator},
            {"passes", of_ranges},
            {"merged", is_merged},
            {"film", {g.width, g.height, g.crop_x, g.crop_y, g.crop_width, g.crop_height}},
            {"technique_depth", technique_depth},
            {"conditions", of_conditions}};
}

Json make_header(const Renderer& renderer, const Scene& scene, const Conditions& conditions,
                 const RenderSettings& settings) {
    return make_header(conditions, {{settings.seed, settings.first_pass, renderer.film().passes()}},
                       scene.film(), settings.technique_depth, scene.file(),
                       settings.integrator.to_string(),
                       to_string(renderer.integrator().estimator()), false);
}

/// Adds `more` to totals of the same film.
void add(RenderTotals& sum, const RenderTotals& more) {
    sum.film->merge(*more.film);
    sum.stats += more.stats;
    sum.seconds += more.seconds;
    sum.log.append(more.log.seconds, more.log.pairs);
}

}  // namespace

std::string to_string(const PassRange& range) {
    return fmt::format("passes {}:{} of seed {}", range.first, range.first + range.passes,
                       range.seed);
}

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
            {"scene contents", hexadecimal(source.fingerprint)},
            {"lenient", yes_or_no(source.lenient)},
            {"watertight", yes_or_no(source.watertight)},
            {"sensor", fmt::format("{}", scene.sensor_index())},
            {"image", describe(scene.film())},
            {"filter mode", renderer.film().spreads() ? "spread" : "sample"},
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

void write_checkpoint(const std::string& file, const Renderer& renderer, const Scene& scene,
                      const Conditions& conditions, const RenderSettings& settings,
                      const PassLog& log) {
    SectionWriter to(file);
    save_header(make_header(renderer, scene, conditions, settings), to);
    renderer.save(to);
    save_log(log, to);
    to.commit();
}

std::string partial_result(const Renderer& renderer, const Scene& scene,
                           const Conditions& conditions, const RenderSettings& settings,
                           const PassLog& log) {
    SectionWriter to;
    save_header(make_header(renderer, scene, conditions, settings), to);
    renderer.save_sums(to);
    save_log(log, to);
    return to.take();
}

CheckpointFile::CheckpointFile(SectionReader reader) : reader_(std::move(reader)) {
    const char* const kDamaged = "the description of the rendering is damaged";
    try {
        read_header();
    } catch (const nlohmann::json::exception&) {
        reader_.fail(kDamaged);
    } catch (const WrongNumber&) {
        reader_.fail(kDamaged);
    }
}

void CheckpointFile::read_header() {
    std::string text;
    reader_.open("rendering");
    reader_.get(text);
    reader_.finish();
    const nlohmann::json j = parse_json(text, reader_.name());
    scene_ = j.at("scene").get<std::string>();
    integrator_ = j.at("integrator").get<std::string>();
    estimator_ = j.at("estimator").get<std::string>();
    is_merged_ = j.at("merged").get<bool>();
    const nlohmann::json& film = j.at("film");
    const auto size = [&](size_t i) { return small_natural(film.at(i)); };
    geometry_ = {size(0), size(1), size(2), size(3), size(4), size(5)};
    technique_depth_ = small_natural(j.at("technique_depth"));
    for (const auto& c : j.at("conditions"))
        conditions_.emplace_back(c.at(0).get<std::string>(), c.at(1).get<std::string>());
    uint64_t sum = 0;
    for (const auto& r : j.at("passes")) {
        const PassRange range{natural(r.at(0)), natural(r.at(1)), natural(r.at(2))};
        if (range.passes == 0 || range.first >= kMostPasses ||
            range.passes > kMostPasses - range.first)
            reader_.fail("a range of passes cannot be");
        ranges_.push_back(range);
        sum += range.passes;
    }
    const FilmGeometry& g = geometry_;
    if (g.crop_width == 0 || g.crop_height == 0) reader_.fail("the image has no pixels");
    if (technique_depth_ > kMostTechniqueEdges)
        reader_.fail("the length of paths with technique images cannot be");
    if (ranges_.empty() || (ranges_.size() > 1) != is_merged_)
        reader_.fail("the ranges of passes cannot be");
    // What is read later is no larger than the file, and what is allocated before, not much larger.
    const uint64_t bytes = reader_.size("film");
    if (g.pixel_count() > bytes / sizeof(Film::Moments) || sum > bytes / sizeof(double))
        reader_.fail("section \"film\" is too short for the image");
}

std::string CheckpointFile::condition(const std::string& name) const {
    for (const auto& [own, value] : conditions_)
        if (own == name) return value;
    return "";
}

uint64_t CheckpointFile::passes() const {
    uint64_t sum = 0;
    for (const PassRange& r : ranges_) sum += r.passes;
    return sum;
}

void CheckpointFile::resume(Renderer& renderer, const Conditions& conditions, PassLog& log) {
    if (is_merged_)
        throw std::runtime_error(fmt::format(
            "{} cannot be resumed: it is the sum of several renderings (etendue merge)", name()));
    std::vector<std::string> differences;
    for (const auto& [condition_name, own] : conditions)
        if (const std::string theirs = condition(condition_name); theirs != own)
            differences.push_back(
                fmt::format("{}: \"{}\" there, but \"{}\" here", condition_name, theirs, own));
    if (!differences.empty())
        throw std::runtime_error(fmt::format(
            "{} cannot be resumed, since the rendering would not go on with the same bits; {}",
            name(), fmt::join(differences, "; ")));
    renderer.load(reader_);
    if (renderer.film().passes() != passes()) reader_.fail("the passes are not those of its film");
    log = load_log(reader_);
}

RenderTotals CheckpointFile::totals(bool with_techniques) {
    static const ReconstructionFilter kUnused = ReconstructionFilter::box();
    RenderTotals t;
    t.film = std::make_unique<Film>(geometry_, kUnused);
    t.film->load(reader_);
    if (t.film->passes() != passes()) reader_.fail("the passes are not those of its film");
    load_statistics(reader_, t.stats, t.seconds);
    if (technique_depth_ > 0 && with_techniques) {
        t.techniques = std::make_unique<TechniqueImages>(geometry_, kUnused, technique_depth_);
        t.techniques->add_saved(reader_);
    }
    t.log = load_log(reader_);
    return t;
}

Merging::Merging(std::vector<CheckpointFile> parts) : parts_(std::move(parts)) {
    std::sort(parts_.begin(), parts_.end(), [](const CheckpointFile& a, const CheckpointFile& b) {
        return a.ranges() < b.ranges();
    });
    const CheckpointFile& a = first();
    for (const CheckpointFile& b : parts_) {
        std::vector<std::string> differences;
        for (const auto& [name, of_a] : a.conditions())
            if (const std::string of_b = b.condition(name); of_b != of_a && !kMayDiffer.count(name))
                differences.push_back(fmt::format("{}: \"{}\" and \"{}\"", name, of_a, of_b));
        if (!differences.empty())
            throw std::runtime_error(fmt::format("{} and {} cannot be merged; {}", a.name(),
                                                 b.name(), fmt::join(differences, "; ")));
    }
    // Sorted by seed and first pass, a range can overlap the one before it only.
    std::vector<std::pair<PassRange, const CheckpointFile*>> all;
    for (const CheckpointFile& part : parts_)
        for (const PassRange& r : part.ranges()) all.emplace_back(r, &part);
    std::sort(all.begin(), all.end(),
              [](const auto& x, const auto& y) { return x.first < y.first; });
    for (size_t i = 1; i < all.size(); ++i) {
        const auto& [before, one] = all[i - 1];
        const auto& [after, other] = all[i];
        if (before.seed == after.seed && after.first < before.first + before.passes)
            throw std::runtime_error(
                fmt::format("{} and {} cannot be merged, since they share passes: {} has {}, and "
                            "{} has {}",
                            one->name(), other->name(), one->name(), to_string(before),
                            other->name(), to_string(after)));
    }
    for (const auto& [range, part] : all) ranges_.push_back(range);
}

RenderTotals Merging::totals() {
    RenderTotals sum = parts_.front().totals();
    for (size_t i = 1; i < parts_.size(); ++i) {
        CheckpointFile& part = parts_[i];
        add(sum, part.totals(false));
        if (sum.techniques) sum.techniques->add_saved(part.reader_);
    }
    return sum;
}

std::vector<std::string> Merging::warnings() const {
    const std::string& estimator = first().estimator();
    std::set<uint64_t> seeds;
    for (const PassRange& r : ranges_) seeds.insert(r.seed);
    if (estimator == to_string(Estimator::Biased) && ranges_.size() > 1)
        return {fmt::format("{} is biased here: more passes reduce its noise, but not its bias",
                            first().integrator())};
    if (estimator == to_string(Estimator::Consistent) && seeds.size() > 1)
        return {fmt::format("the bias of {} falls with the number of passes of one seed: several "
                            "seeds reduce its noise alone; ranges of passes (render --passes) "
                            "reduce both",
                            first().integrator())};
    return {};
}

nlohmann::json Merging::report(const RenderTotals& totals) const {
    nlohmann::json j = statistics(*totals.film, totals.stats, totals.seconds, totals.film->error());
    j["scene"] = first().scene();
    j["integrator"] = first().integrator();
    j["estimator"] = first().estimator();
    j["pass_seconds"] = totals.log.seconds;
    j["pass_pairs"] = totals.log.pairs;
    for (const PassRange& r : ranges_)
        j["merged"].push_back({{"seed", r.seed}, {"first_pass", r.first}, {"passes", r.passes}});
    return j;
}

void Merging::save(const RenderTotals& totals, SectionWriter& to) const {
    const CheckpointFile& a = first();
    Conditions shared;
    for (const auto& c : a.conditions())
        if (!kMayDiffer.count(c.first)) shared.push_back(c);
    save_header(make_header(shared, ranges_, a.geometry_, a.technique_depth_, a.scene(),
                            a.integrator(), a.estimator(), ranges_.size() > 1),
                to);
    save_statistics(totals.stats, totals.seconds, to);
    totals.film->save(to);
    if (totals.techniques) totals.techniques->save(to);
    save_log(totals.log, to);
}

void Merging::write(const std::string& file, const RenderTotals& totals) const {
    SectionWriter to(file);
    save(totals, to);
    to.commit();
}

std::string Merging::bytes(const RenderTotals& totals) const {
    SectionWriter to;
    save(totals, to);
    return to.take();
}

}  // namespace etendue
