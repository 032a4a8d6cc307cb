#include "render/statistics_section.h"

#include "math/padding.h"

namespace etendue {

void save_statistics(const RenderStats& stats, double seconds, SectionWriter& to) {
    to.begin("statistics");
    to.put(seconds);
    for_each_part(stats, [&](const auto& part) { to.put(part); });
}

void load_statistics(SectionReader& from, RenderStats& stats, double& seconds) {
    from.open("statistics");
    from.get(seconds);
    for_each_part(stats, [&](auto& part) { from.get(part); });
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
