#include "render/statistics_section.h"

namespace etendue {
namespace {

/// All numbers of the statistics; a new one does not compile until it is here.
template <class Stats, class Use>
void for_each_number(Stats& s, const Use& use) {
    auto& [phases, time_factor, eye_paths, light_paths, vertices, walk_rays, shadow_rays, visible,
           joins_skipped, pairs, visible_pairs, trials, trial_rays, pairs_by_trials, chains,
           chain_seeds, chain_trials, chain_rays, bounds_exceeded, runaways, rejected] = s;
    (void)time_factor;  // Of the current sample.
    auto& [of_light_paths, of_eye_paths, of_connections, of_records] = phases;
    use(of_light_paths), use(of_eye_paths), use(of_connections), use(of_records);
    use(eye_paths), use(light_paths), use(vertices), use(walk_rays), use(shadow_rays);
    use(visible), use(joins_skipped), use(pairs), use(visible_pairs), use(trials);
    use(chains), use(chain_seeds), use(chain_trials), use(chain_rays);
    use(trial_rays), use(pairs_by_trials), use(bounds_exceeded), use(runaways), use(rejected);
}

}  // namespace

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

}  // namespace etendue
