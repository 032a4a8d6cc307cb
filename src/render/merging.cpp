#include "render/merging.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render/statistics_section.h"

namespace etendue {
namespace {

/// Conditions of which parts of a sum may differ: other passes, and what changes nothing but last bits.
const std::set<std::string> kMayDiffer{"seed",      "first pass", "build",
                                       "C library", "ray tracer", "processor"};

/// Adds `more` to totals of the same film.
void add(RenderTotals& sum, const RenderTotals& more) {
    sum.film->merge(*more.film);
    sum.stats += more.stats;
    sum.seconds += more.seconds;
    sum.log.append(more.log.seconds, more.log.pairs);
}

}  // namespace

Merging::Merging(std::vector<CheckpointFile> parts) : parts_(std::move(parts)) {
    std::sort(parts_.begin(), parts_.end(), [](const CheckpointFile& a, const CheckpointFile& b) {
        return a.header().ranges < b.header().ranges;
    });
    const CheckpointFile& a = first();
    for (const CheckpointFile& b : parts_) {
        std::vector<std::string> differences;
        for (const auto& [name, of_a] : a.header().conditions)
            if (const std::string of_b = b.header().condition(name);
                of_b != of_a && !kMayDiffer.count(name))
                differences.push_back(fmt::format("{}: \"{}\" and \"{}\"", name, of_a, of_b));
        if (!differences.empty())
            throw std::runtime_error(fmt::format("{} and {} cannot be merged; {}", a.name(),
                                                 b.name(), fmt::join(differences, "; ")));
    }
    // Sorted by seed and first pass, a range can overlap the one before it only.
    std::vector<std::pair<PassRange, const CheckpointFile*>> all;
    for (const CheckpointFile& part : parts_)
        for (const PassRange& r : part.header().ranges) all.emplace_back(r, &part);
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
        if (!sum.techniques) continue;
        sum.techniques->add_saved(part.sections());
        part.sections().close();
    }
    return sum;
}

std::vector<std::string> Merging::warnings() const {
    const std::string& estimator = first().header().estimator;
    std::set<uint64_t> seeds;
    for (const PassRange& r : ranges_) seeds.insert(r.seed);
    if (estimator == to_string(Estimator::Biased) && ranges_.size() > 1)
        return {fmt::format("{} is biased here: more passes reduce its noise, but not its bias",
                            first().header().integrator)};
    if (estimator == to_string(Estimator::Consistent) && seeds.size() > 1)
        return {fmt::format("the bias of {} falls with the number of passes of one seed: several "
                            "seeds reduce its noise alone; ranges of passes (render --passes) "
                            "reduce both",
                            first().header().integrator)};
    return {};
}

nlohmann::json Merging::report(const RenderTotals& totals) const {
    nlohmann::json j = statistics(*totals.film, totals.stats, totals.seconds, totals.film->error());
    j["scene"] = first().header().scene;
    j["integrator"] = first().header().integrator;
    j["estimator"] = first().header().estimator;
    j["pass_seconds"] = totals.log.seconds;
    j["pass_pairs"] = totals.log.pairs;
    for (const PassRange& r : ranges_)
        j["merged"].push_back({{"seed", r.seed}, {"first_pass", r.first}, {"passes", r.passes}});
    return j;
}

void Merging::save(const RenderTotals& totals, SectionWriter& to) const {
    CheckpointHeader header = first().header();
    std::erase_if(header.conditions, [](const auto& c) { return kMayDiffer.count(c.first) > 0; });
    header.ranges = ranges_;
    header.is_merged = ranges_.size() > 1;
    save_header(header, to);
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
