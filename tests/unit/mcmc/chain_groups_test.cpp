#include "mcmc/chain_groups.h"

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "toy.h"

namespace etendue::test {
namespace {

struct RunOptions {
    ChainOptions chains;
    uint64_t pool;
    uint32_t passes;
    uint64_t mutations;  ///< Of a pass.
    int runs;
    double c = toy_b();
};

/// Means by cell from independent runs.
std::array<Moments, kCells> run_toy(const RunOptions& o) {
    ToyPasses toy;
    const PrimarySpace space(1, toy_sample, TargetMap(toy.geometry()));
    std::array<Moments, kCells> means;
    for (int run = 0; run < o.runs; ++run) {
        ChainGroups groups(space, o.chains,
                           {{.chains = o.chains.chains, .pool = o.pool, .c = o.c}});
        CellSums sums;
        for (uint32_t i = 0; i < o.passes; ++i) {
            groups.advance(toy.pass(i, hash_combine(21, uint64_t(run)), o.mutations, sums));
            groups.commit();
        }
        for (size_t k = 0; k < kCells; ++k) means[k].add(sums.sums[k] / o.passes);
    }
    return means;
}

/// Sum over cells of half the difference, and Welch's test of every cell.
void expect_exact(const std::array<Moments, kCells>& means, double resolution) {
    const std::array<double, kCells> exact = toy_means();
    const double level = sidak(1e-3, kCells);
    double distance = 0;
    for (size_t k = 0; k < kCells; ++k) {
        distance += 0.5 * std::fabs(means[k].mean() - exact[k]) / toy_b();
        EXPECT_GT(welch_p(means[k], Moments::exact(exact[k]), 1e-6 * exact[k]), level)
            << "cell " << k << ": " << means[k].mean() << " ± "
            << std::sqrt(means[k].squared_error()) << " for " << exact[k];
    }
    EXPECT_LT(distance, resolution) << "in total variation";
}

TEST(ChainGroups, StartUpIsUnbiased) {
    // Few steps from a pool of 64, in which the bright cell is often missing.
    expect_exact(run_toy({{.groups = 2, .chains = 4, .p_large = 0.05}, 64, 1, 20, 20000}), 0.01);
}

TEST(ChainGroups, FindAll) {
    expect_exact(run_toy({{.groups = 4, .chains = 8, .p_large = 0.3}, 64, 16, 256, 1000}), 0.005);
}

TEST(ChainGroups, AnyConstantWillDo) {
    for (const double c : {0.0, 0.1 * toy_b(), 10 * toy_b()})
        expect_exact(run_toy({{.groups = 2, .chains = 4, .p_large = 0.3}, 64, 4, 64, 2500, c}),
                     0.015);
}

TEST(ChainGroups, LargeStepsAloneAreIndependentSamples) {
    expect_exact(run_toy({{.groups = 2, .chains = 4, .p_large = 1}, 64, 2, 64, 4000}), 0.01);
}

TEST(ChainGroups, BlackPoolsMakeLargeSteps) {
    // Two samples: often both in the dark.
    expect_exact(run_toy({{.groups = 4, .chains = 2, .p_large = 0.5}, 2, 8, 16, 8000}), 0.02);
}

/// A quarter of the cells, which ones by chance, are bright in a pass, and the others are black.
TEST(ChainGroups, RestartsAllowAnotherTargetInEachPass) {
    ToyPasses toy;
    uint64_t bright = 0;  // two bits for each cell, 0 if it is bright
    class DimSink final : public ContributionSink {
    public:
        DimSink(ContributionSink& to, uint64_t bright) : to_(to), bright_(bright) {}
        void add(const Join& join, Rgb contribution) override {
            if ((bright_ >> 2 * uint64_t(join.film.x) & 3) == 0) to_.add(join, contribution * 4.0f);
        }

    private:
        ContributionSink& to_;
        uint64_t bright_;
    };
    const PrimarySpace space(
        1,
        [&](int chain_class, const SampleContext& c, Workspace& work) {
            DimSink sink(c.sink, bright);
            toy_sample(chain_class, c.with(c.sampler, sink), work);
        },
        TargetMap(toy.geometry()));
    std::array<Moments, kCells> means;
    constexpr uint32_t kPasses = 8;
    for (uint64_t run = 0; run < 4000; ++run) {
        ChainGroups groups(space, {.groups = 2, .chains = 4, .p_large = 0.1, .restarts = true},
                           {{.chains = 4, .pool = 64, .c = toy_b()}});
        CellSums sums;
        for (uint32_t i = 0; i < kPasses; ++i) {
            bright = mix64(hash_combine(run, i));
            groups.advance(toy.pass(i, hash_combine(22, run), 256, sums));
            groups.commit();
        }
        for (size_t k = 0; k < kCells; ++k) means[k].add(sums.sums[k] / kPasses);
    }
    expect_exact(means, 0.015);
}

/// Later passes know b better than the pools, from each other.
TEST(ChainGroups, NormalisationImproves) {
    ToyPasses toy;
    const PrimarySpace space(1, toy_sample, TargetMap(toy.geometry()));
    Moments b, pools;
    for (uint64_t run = 0; run < 300; ++run) {
        ChainGroups groups(space, {.groups = 4, .chains = 4},
                           {{.chains = 4, .pool = 64, .c = toy_b()}});
        CellSums sums;
        for (uint32_t i = 0; i < 40; ++i) {
            groups.advance(toy.pass(i, hash_combine(31, run), 200, sums));
            groups.commit();
            if (i == 3) pools.add(groups.b());
        }
        b.add(groups.b());
    }
    EXPECT_NEAR(b.mean(), toy_b(), 4 * std::sqrt(b.squared_error()));
    EXPECT_LT(b.variance(), 0.3 * pools.variance());
}

TEST(ChainGroups, APassThatIsNotCommittedLeavesNothing) {
    ToyPasses toy;
    const PrimarySpace space(1, toy_sample, TargetMap(toy.geometry()));
    const auto run = [&](bool repeats) {
        ChainGroups groups(space, {.groups = 2, .chains = 4},
                           {{.chains = 4, .pool = 64, .c = toy_b()}});
        CellSums kept;
        for (uint32_t i = 0; i < 6; ++i) {
            CellSums dropped;
            if (repeats) groups.advance(toy.pass(i, 5, 100, dropped));
            groups.advance(toy.pass(i, 5, 100, kept));
            groups.commit();
        }
        return std::pair(kept.sums, groups.b());
    };
    EXPECT_EQ(run(false), run(true));
}

}  // namespace
}  // namespace etendue::test
