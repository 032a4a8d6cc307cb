// Choice of the compared classes: a class lost by one side must not count as too rare.

#include "verify/common_classes.h"

#include <gtest/gtest.h>

#include "math/hash.h"
#include "verify/comparisons.h"

namespace etendue::test {
namespace {

constexpr int kRuns = 32;
const PathClass kDirect{.edges = 2}, kCaustic{.edges = 4, .delta_events = 0b0110};
const TechniqueCounts kPath{.hit = 1, .next_event = 1},
    kBdpt{.hit = 1, .next_event = 1, .connect = 1, .splat = 100}, kLight{.splat = 100};

/// A series with so many equal contributions to each class in each run, and a spread between the runs to match.
RunSeries series(const char* name, const TechniqueCounts& counts,
                 const std::map<PathClass, double>& contributions, uint64_t spp = 64) {
    RunSeries s;
    s.spec.name = name;
    s.counts = counts;
    s.spp = spp;
    s.renderings = 1;
    s.runs.resize(kRuns);
    for (size_t r = 0; r < s.runs.size(); ++r)
        for (const auto& [c, n] : contributions) {
            // Sums over the runs' spread: 1 ± 1/√n.
            const double u = double(to_unit_float(uint32_t(mix64(r + 100 * uint64_t(n)) >> 32)));
            const double mean = 1 + std::sqrt(12 / n) * (u - 0.5);
            s.runs[r].classes[c] = {mean, mean * mean / n, std::pow(mean / n, 4) * n};
        }
    return s;
}

TEST(CommonClasses, LostClassIsADeviation) {
    const std::vector<RunSeries> references{
        series("path", kPath, {{kDirect, 1000}, {kCaustic, 300}})};
    const RunSeries lost = series("bdpt", kBdpt, {{kDirect, 1000}});
    const CommonClasses common(lost, references);
    EXPECT_TRUE(common.contains(kCaustic));
    MethodReport report;
    VerifyOptions options;
    compare_lengths({lost, references, common}, options, std::vector<float>(9), report);
    const WelchTest& test = report.lengths[3].comparison;
    EXPECT_TRUE(test.is_tested());
    EXPECT_LT(test.p, 1e-10);
    EXPECT_EQ(report.lengths[3].too_rare, 0);
    EXPECT_GT(report.lengths[1].comparison.p, 1e-3);
}

/// A number of trials has no bound: bright contributions may be few.
TEST(CommonClasses, NothingIsImpliedOfSpecularConnections) {
    TechniqueCounts with_specular = kPath;
    with_specular.specular_depth = 4;
    // The next event makes another class, which is implied as ever.
    const PathClass next_event{.edges = 4, .delta_events = 0b0100};
    for (const bool is_method : {true, false}) {
        const std::vector<RunSeries> references{series("path", is_method ? kPath : with_specular,
                                                       {{kCaustic, 300}, {next_event, 300}})};
        const RunSeries method =
            series("other", is_method ? with_specular : kPath, {{kDirect, 1000}});
        const CommonClasses common(method, references);
        EXPECT_FALSE(common.contains(kCaustic)) << is_method;
        EXPECT_TRUE(common.contains(next_event)) << is_method;
    }
}

/// The reference has too few contributions to imply enough for the method: a tenth of 30 in each of 32 runs.
TEST(CommonClasses, LostClassIsTooRareWhereTheReferenceFindsItSeldom) {
    const std::vector<RunSeries> references{
        series("path", kPath, {{kDirect, 1000}, {kCaustic, 30}})};
    const RunSeries lost = series("bdpt", kBdpt, {{kDirect, 1000}});
    EXPECT_FALSE(CommonClasses(lost, references).contains(kCaustic));
    // With a quarter of the reference's samples.
    const std::vector<RunSeries> longer{series("path", kPath, {{kCaustic, 80}}, 256)};
    EXPECT_FALSE(CommonClasses(lost, longer).contains(kCaustic));
    EXPECT_TRUE(CommonClasses(lost, std::vector{series("path", kPath, {{kCaustic, 80}}, 64)})
                    .contains(kCaustic));
}

/// Light tracing has other techniques than path tracing, so that contributions of one imply nothing for the other.
TEST(CommonClasses, OtherTechniquesMayFindAClassSeldom) {
    const std::vector<RunSeries> references{
        series("path", kPath, {{kDirect, 1000}, {kCaustic, 300}})};
    const CommonClasses common(series("light", kLight, {{kDirect, 1000}}), references);
    ASSERT_TRUE(common.find(kCaustic));
    EXPECT_TRUE(common.find(kCaustic)->is_reachable);
    EXPECT_FALSE(common.contains(kCaustic));
    const auto left = common.left_out([](const PathClass&) { return true; });
    EXPECT_NEAR(left.too_rare, 0.5, 0.05);
    EXPECT_EQ(left.out_of_reach, 0);
}

/// States of a chain come from few independent ones: a class that one run has found, in many states, is too rare for a
/// test, and so is one that path tracing finds more often than the chains' independent samples do.
TEST(CommonClasses, StatesOfChainsAreNotIndependent) {
    const std::vector<RunSeries> references{
        series("path", kPath, {{kDirect, 1000}, {kCaustic, 300}})};
    RunSeries chains = series("mlt", kBdpt, {{kDirect, 1000}});
    chains.has_chains = true;
    EXPECT_FALSE(CommonClasses(chains, references).contains(kCaustic));
    chains.runs[5].classes[kCaustic] = {1, 1e-4, 1e-12};
    const CommonClasses common(chains, references);
    EXPECT_TRUE(common.contains(kDirect));
    EXPECT_FALSE(common.contains(kCaustic));
    EXPECT_NEAR(common.left_out([](const PathClass&) { return true; }).too_rare, 0.5, 0.05);
    // Found in all runs.
    RunSeries many = series("mlt", kBdpt, {{kDirect, 1000}, {kCaustic, 1000}});
    many.has_chains = true;
    EXPECT_TRUE(CommonClasses(many, references).contains(kCaustic));
}

/// A class that the first reference samples badly is compared with another one, but not with the method itself.
TEST(CommonClasses, LaterReferencesServeWhereTheyAreMuchBetter) {
    const PathClass caustic{.edges = 4, .delta_events = 0b0110};
    const std::vector<RunSeries> references{
        series("path", kPath, {{kDirect, 1000}, {caustic, 1}}),
        series("light", kLight, {{kDirect, 1200}, {caustic, 5000}})};
    const CommonClasses bdpt(series("bdpt", kBdpt, {{kDirect, 1000}, {caustic, 2000}}), references);
    EXPECT_TRUE(bdpt.contains(caustic));
    EXPECT_EQ(bdpt.find(caustic)->reference, 1u);
    EXPECT_EQ(bdpt.find(kDirect)->reference, 0u);
    const CommonClasses light(series("light", kLight, {{kDirect, 1000}, {caustic, 2000}}),
                              references);
    EXPECT_FALSE(light.contains(caustic));
    EXPECT_EQ(light.find(kDirect)->reference, 0u);
}

}  // namespace
}  // namespace etendue::test
