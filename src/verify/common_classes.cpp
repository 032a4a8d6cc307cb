#include "verify/common_classes.h"

#include "verify/welch_test.h"

namespace etendue {
namespace {

/// See CommonClasses.
constexpr double kRouletteMargin = 10, kClusterMargin = 10;
/// A later reference replaces the first one where its squared error is smaller by the factor kMuchBetter and it has at
/// least kManyContributions effective contributions. With fewer, rare bright contributions may be missing, so that its
/// error only seems small.
constexpr double kMuchBetter = 4, kManyContributions = 4000;

/// Whether `method` has all techniques of `reference`, with at least the same counts.
bool has_techniques_of(const TechniqueCounts& method, const TechniqueCounts& reference) {
    if (reference.uses_pairs()) return false;
    for (const auto count :
         {&TechniqueCounts::hit, &TechniqueCounts::next_event, &TechniqueCounts::connect,
          &TechniqueCounts::splat, &TechniqueCounts::hit_lens, &TechniqueCounts::connect_emission})
        if (method.*count < reference.*count) return false;
    return true;
}

/// Whether eye paths share light paths.
bool shares_light_paths(const TechniqueCounts& counts) {
    return counts.uses_pairs() || counts.connect_emission > 0 ||
           (counts.connect > 0 && counts.connect != 1);
}

}  // namespace

CommonClasses::CommonClasses(const RunSeries& method, std::span<const RunSeries> references) {
    const std::map<PathClass, Tally> made = method.classes();
    std::vector<std::map<PathClass, Tally>> expected;
    for (size_t i = 0; i < references.size(); ++i) {
        const RunSeries& r = references[i];
        expected.push_back(r.classes());
        may_serve_.push_back(i == 0 || r.spec.name != method.spec.name);
        implies_.push_back(!method.has_chains && has_techniques_of(method.counts, r.counts));
        fewer_.push_back(kRouletteMargin *
                         (shares_light_paths(method.counts) ? kClusterMargin : 1.0) *
                         double(r.samples()) / double(method.samples()));
    }
    for (const auto& [c, tally] : made) classes_[c].found.method = tally;
    for (size_t i = 0; i < references.size(); ++i)
        if (may_serve_[i])
            for (const auto& [c, tally] : expected[i]) classes_[c];

    for (auto& [c, k] : classes_) {
        double light = k.found.method.sum, error = 0;
        for (size_t i = 0; i < references.size(); ++i) {
            if (!may_serve_[i]) continue;
            const auto at = expected[i].find(c);
            SideTallies found{k.found.method, at == expected[i].end() ? Tally{} : at->second, {}};
            light = std::max(light, found.reference.sum);
            const bool is_reachable =
                can_make(method.counts, c) && can_make(references[i].counts, c);
            if (!is_reachable && k.is_reachable) continue;
            const bool is_implied = implies_[i] && !makes_by_specular(method.counts, c) &&
                                    !makes_by_specular(references[i].counts, c);
            found.implied = is_implied ? implied_by(i, found.reference) : found.method;
            const bool is_common =
                is_reachable && found.effective_count() >= WelchTest::kEnoughContributions;
            double its_error = 0;
            bool is_better = !k.is_reachable && is_reachable;
            if (is_common) {
                its_error = references[i]
                                .moments([&, &c = c](const auto& r) { return r.light(c); })
                                .squared_error();
                is_better |=
                    !k.is_common || (kMuchBetter * its_error < error &&
                                     found.reference.effective_count() >= kManyContributions);
            } else if (!k.is_common) {
                is_better |=
                    found.reference.effective_count() > k.found.reference.effective_count();
            }
            if (!is_better) continue;
            k.is_reachable = is_reachable;
            k.is_common = is_common;
            k.reference = i;
            k.is_implied = is_implied;
            k.found = found;
            error = its_error;
        }
        k.light = k.is_common ? k.found.reference.sum : light;
    }
}

}  // namespace etendue
