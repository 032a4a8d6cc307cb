#include "mcmc/chain_groups.h"

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "mcmc/pilot.h"
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

/// A finished pass is in the film already, so that nothing may fail any more.
TEST(ChainGroups, CommitAllocatesNoStates) {
    class CountingSpace : public PrimarySpace {
    public:
        using PrimarySpace::PrimarySpace;
        std::unique_ptr<ChainState> make_state() const override {
            ++made;
            return PrimarySpace::make_state();
        }
        mutable int made = 0;
    };
    ToyPasses toy;
    const CountingSpace space(1, toy_sample, TargetMap(toy.geometry()));
    ChainGroups groups(space, {.groups = 2, .chains = 4},
                       {{.chains = 4, .pool = 64, .c = toy_b()}});
    CellSums sums;
    for (uint32_t i = 0; i < 4; ++i) {
        groups.advance(toy.pass(i, 5, 100, sums));
        const int before = space.made;
        groups.commit();
        EXPECT_EQ(space.made, before) << i;
    }
}

TEST(SharedOut, ClassesThatThePilotDidNotSeeHaveChainsAndLargeSteps) {
    const std::vector<double> cost{3, 4, 5, 6};
    const std::vector<ClassPlan> plan = share_out(8, {5, 0, 3, 0}, cost, 4096, 256);
    ASSERT_EQ(plan.size(), 4u);
    int chains = 0;
    for (const ClassPlan& p : plan) {
        chains += p.chains;
        EXPECT_GT(p.chains, 8);
        EXPECT_GE(p.pool, 128u);
    }
    EXPECT_EQ(chains, 256);
    EXPECT_EQ(plan[0].c, 5);
    EXPECT_EQ(plan[2].c, 3);
    for (const size_t k : {1u, 3u}) EXPECT_EQ(plan[k].c, 0.5);
    // Few chains in all: each class has some nevertheless.
    for (const ClassPlan& p : share_out(1, {1, 0, 0, 0}, cost, 64, 4)) EXPECT_GE(p.chains, 4);
}

/// Classes of one cell each. The pools find no light in the last one, but later large steps do.
TEST(SharedOut, LargeStepsCountWhereNoChainHasStarted) {
    ToyPasses toy;
    const auto sample = [](int, const SampleContext& c, Workspace& work) {
        work.z.film_weight = 1;
        c.sampler.seek(Stream::Eye, 0);
        const float value = c.sampler.next_1d() < 1e-3f ? 1000.0f : 0.0f;
        c.sink.add({.technique = {Strategy::Splat, 3, 1},
                    .emitter = nullptr,
                    .contribution = Rgb(value),
                    .mis_weight = 1,
                    .film = {0.5f, 0.5f}},
                   Rgb(value));
    };
    const PrimarySpace space(1, sample, TargetMap(toy.geometry()));
    const std::vector<double> cost{3};
    const Pilot black{.map = TargetMap(toy.geometry()), .by_technique = {}};
    for (const double b : {1.0, black.constant()}) {
        const std::vector<ClassPlan> plan = share_out(b, {0}, cost, 4, 4);
        Moments large;  // Of groups whose pool was black.
        for (uint64_t run = 0; run < 200; ++run) {
            ChainGroups groups(space, {.groups = 2, .chains = 4, .p_large = 0.5},
                               {{.chains = 4, .pool = 16, .c = plan[0].c}});
            CellSums sums;
            groups.advance(toy.pass(0, hash_combine(23, run), 400, sums));
            groups.commit();
            if (groups.stats().chain_light == 0) large.add(sums.sums[0]);
        }
        EXPECT_GT(large.count(), 150);
        // Of large steps the part 1 - w counts, with I = 1000.
        const double part = 1 - 1000 / (1000 + plan[0].c * 0.5);
        EXPECT_NEAR(large.mean(), part, 0.5 * part) << b;
    }
}

}  // namespace
}  // namespace etendue::test
