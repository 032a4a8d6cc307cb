#include "session/run_record.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "description/json_text.h"

namespace etendue {
namespace {

using nlohmann::json;

constexpr const char *kSection = "session", *kSeeds = "seeds";

/// What is thrown for a number that cannot be.
struct ImpossibleNumber {};

double positive(const json& value) {
    const auto v = value.get<double>();
    if (!(v > 0)) throw ImpossibleNumber();
    return v;
}
uint64_t passes_of(const json& value) {
    if (!value.is_number_unsigned() || value.get<uint64_t>() == 0 ||
        value.get<uint64_t>() > kMostPasses)
        throw ImpossibleNumber();
    return value.get<uint64_t>();
}
int count_of(const json& value) {
    constexpr int kMost = 1 << 20;
    if (!value.is_number_unsigned() || value.get<uint64_t>() > kMost) throw ImpossibleNumber();
    return value.get<int>();
}

}  // namespace

void save_record(const RunStatus& run, SectionWriter& to) {
    json limits = json::object(), history = json::array(), figures = json::array();
    if (run.request.spp) limits["spp"] = *run.request.spp;
    if (run.request.seconds) limits["seconds"] = *run.request.seconds;
    if (run.request.error) limits["error"] = *run.request.error;
    for (const ConvergencePoint& p : run.history)
        history.push_back({p.passes, p.seconds, p.error.relative_rms, p.error.low, p.error.high});
    for (const auto& [name, value] : run.figures)
        if (std::isfinite(value)) figures.push_back({name, value});
    json record = {{"limits", limits},
                   {"finished", run.state == RunState::Finished},
                   {"history", history},
                   {"figures", figures}};
    if (run.seeds > 1)
        record["seeds"] = {
            {"all", run.seeds}, {"finished", run.finished_seeds}, {"passes", run.passes}};
    to.begin(kSection);
    to.put(record.dump(-1, ' ', false, json::error_handler_t::replace));
}

bool load_record(SectionReader& from, RunStatus& run) {
    if (!from.has(kSection)) return false;
    std::string text;
    from.open(kSection);
    from.get(text);
    from.finish();
    const char* const kDamaged = "the record of the run is damaged";
    try {
        const json record = parse_json(text, from.name());
        const json& limits = record.at("limits");
        if (limits.contains("spp")) run.request.spp = passes_of(limits["spp"]);
        if (limits.contains("seconds")) run.request.seconds = positive(limits["seconds"]);
        if (limits.contains("error")) run.request.error = positive(limits["error"]);
        run.state = record.at("finished").get<bool>() ? RunState::Finished : RunState::Stopped;
        if (record.contains("seeds")) {
            const json& seeds = record["seeds"];
            run.seeds = count_of(seeds.at("all"));
            run.finished_seeds = count_of(seeds.at("finished"));
            run.passes = passes_of(seeds.at("passes"));
            if (run.seeds < 2 || run.finished_seeds > run.seeds) throw ImpossibleNumber();
        }
        for (const json& p : record.at("history")) {
            const auto number = [&](size_t i) { return p.at(i).get<double>(); };
            run.history.push_back(
                {passes_of(p.at(0)), number(1), {number(2), number(3), number(4), true}});
        }
        for (const json& f : record.at("figures"))
            run.figures.emplace_back(f.at(0).get<std::string>(), f.at(1).get<double>());
    } catch (const json::exception&) {
        from.fail(kDamaged);
    } catch (const ImpossibleNumber&) {
        from.fail(kDamaged);
    }
    from.close();
    return true;
}

void begin_seeds(uint64_t first, bool is_counted, const SeedMean& mean, SectionWriter& to) {
    to.begin(kSeeds);
    to.put(first);
    to.put(uint8_t(is_counted));
    mean.save(to);
}

SavedSeeds open_seeds(SectionReader& from, uint64_t pixels, int finished) {
    SavedSeeds seeds;
    from.open(kSeeds);
    from.get(seeds.first);
    seeds.is_counted = from.get<uint8_t>() != 0;
    seeds.mean.load(from, pixels);
    if (seeds.mean.count() != finished || (seeds.is_counted && finished == 0))
        from.fail("the seeds of the run are damaged");
    return seeds;
}

}  // namespace etendue
