#include "mcmc/chain_groups.h"

#include <gtest/gtest.h>

#include "error_of.h"
#include "math/statistics.h"
#include "mcmc/pilot.h"
#include "toy.h"

namespace etendue::test {
namespace {

struct RunOptions {
    ChainOptions chains;
    uint64_t pool;  ///< Samples in the first pool of a group.
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
        ChainOptions options = o.chains;
        options.pool = o.pool;
        ChainGroups groups(space, options, {{.chains = o.chains.chains, .c = o.c}});
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

/// A pool of 16 rarely has the bright cell; later samples and large steps find it. After 1, 3, 9 and 34 passes of two groups
/// they have started once, twice and more often, and are in the midst of a generation.
TEST(ChainGroups, GenerationsAreUnbiased) {
    for (const uint32_t passes : {1u, 3u, 9u, 34u})
        expect_exact(
            run_toy({{.groups = 2, .chains = 4, .p_large = 0.1, .later = 0.1, .large_step = 0.5},
                     16,
                     passes,
                     40,
                     int(80000 / passes)}),
            0.015);
}

/// Its chains cannot leave their state by small steps.
class StayingSpace final : public PrimarySpace {
public:
    using PrimarySpace::PrimarySpace;
    Proposal propose(int, const ChainState&, uint64_t, const ChainContext&,
                     ChainState& y) const override {
        y.target = 0;
        y.splats.clear();
        return {.has_failed = true};
    }
};

/// Two cells: a tenth of the states is in the first one, and bright. An independent sample consists of many states.
class SamplesOfManyStates final : public PrimarySpace {
public:
    static constexpr float kBright = 10;
    explicit SamplesOfManyStates(const FilmGeometry& geometry)
        : PrimarySpace(1, add, TargetMap(geometry)) {}
    void sample(uint64_t key, const ChainContext& c, std::vector<Find>& finds) const override {
        constexpr int kStates = 32;
        for (int i = 0; i < kStates; ++i) {
            StateSpace::sample(hash_combine(key, uint64_t(i)), c, finds);
            finds.back().weight /= kStates;
        }
    }
    static std::array<double, 2> means() { return {0.1 * double(kBright), 0.9}; }

private:
    static void add(int, const SampleContext& c, Workspace& work) {
        work.z.film_weight = 1;
        c.sampler.seek(Stream::Eye, 0);
        const bool is_bright = c.sampler.next_1d() < 0.1f;
        const Rgb value(is_bright ? kBright : 1.0f);
        c.sink.add({.technique = {Strategy::Splat, 3, 1},
                    .emitter = nullptr,
                    .contribution = value,
                    .mis_weight = 1,
                    .film = {is_bright ? 0.5f : 1.5f, 0.5f}},
                   value);
    }
};

/// The second generation of a group, from two samples and some large steps. A large step counts as a tenth of a sample, both
/// in the normalisation and among the states from which chains start.
TEST(ChainGroups, LargeStepsCountLessThanSamples) {
    ToyPasses toy;
    const SamplesOfManyStates space(toy.geometry());
    std::array<Moments, 2> means;
    for (uint64_t run = 0; run < 20000; ++run) {
        ChainGroups groups(space,
                           {.groups = 2, .chains = 1, .p_large = 0.5, .pool = 2, .large_step = 0.1},
                           {{.chains = 1, .c = 0}});
        CellSums first, second;
        groups.advance(toy.pass(0, hash_combine(28, run), 8, first));
        groups.commit();
        groups.advance(toy.pass(2, hash_combine(28, run), 1, second));
        for (size_t k = 0; k < 2; ++k) means[k].add(second.sums[k]);
    }
    for (size_t k = 0; k < 2; ++k)
        EXPECT_NEAR(means[k].mean(), SamplesOfManyStates::means()[k],
                    4 * std::sqrt(means[k].squared_error()))
            << k;
}

/// In the midst of a generation, what the large steps of a group have found since its start says where its chains are, and
/// improves only the scale of the other groups.
TEST(ChainGroups, OwnFindsDoNotScale) {
    ToyPasses toy;
    const StayingSpace space(1, toy_sample, TargetMap(toy.geometry()));
    std::array<Moments, kCells> means;
    for (uint64_t run = 0; run < 40000; ++run) {
        ChainGroups groups(space, {.groups = 2, .chains = 2, .p_large = 0.5, .pool = 4},
                           {{.chains = 2, .c = 0}});
        CellSums sums;
        for (const uint32_t i : {0u, 2u, 4u}) {  // of the first group
            sums.sums = {};
            groups.advance(toy.pass(i, hash_combine(29, run), 8, sums));
            groups.commit();
        }
        for (size_t k = 0; k < kCells; ++k) means[k].add(sums.sums[k]);
    }
    expect_exact(means, 0.01);
}

/// A pool that is thinned out before chains start has, in the mean, all of its samples, whatever their numbers are.
TEST(ChainGroups, ThinningDoesNotDependOnTheSamples) {
    ToyPasses toy;
    const auto sample = [](int, const SampleContext& c, Workspace& work) {
        work.z.film_weight = 1;
        c.sampler.seek(Stream::Eye, 0);
        const int cell = std::min(int(c.sampler.next_1d() * kCells), kCells - 1);
        c.sink.add({.technique = {Strategy::Splat, 3, 1},
                    .emitter = nullptr,
                    .contribution = Rgb(1),
                    .mis_weight = 1,
                    .film = {float(cell) + 0.5f, 0.5f}},
                   Rgb(1));
    };
    const StayingSpace space(1, sample, TargetMap(toy.geometry()));
    std::array<Moments, kCells> means;
    for (uint64_t run = 0; run < 20000; ++run) {
        ChainGroups groups(space, {.groups = 1, .chains = 16, .p_large = 0.01, .pool = 64},
                           {{.chains = 16, .c = 0}});
        CellSums sums;
        groups.advance(toy.pass(0, hash_combine(27, run), 32, sums));
        groups.commit();
        for (size_t k = 0; k < kCells; ++k) means[k].add(sums.sums[k]);
    }
    for (size_t k = 0; k < kCells; ++k)
        EXPECT_NEAR(means[k].mean(), 1.0 / kCells, 4 * std::sqrt(means[k].squared_error())) << k;
}

/// Chains that make many large steps keep few of what they find, with the same means.
TEST(ChainGroups, ManyFindsOfAPassAreThinnedOut) {
    expect_exact(
        run_toy(
            {{.groups = 2, .chains = 4, .p_large = 0.5, .large_step = 0.5}, 16, 10, 1600, 1000}),
        0.005);
}

/// A group whose chains cannot leave their cell knows of the bright one by its finds alone: after many turns it has its
/// share of the chains. Where groups start once, it has that of the first pool.
TEST(ChainGroups, GenerationsStartFromAllFinds) {
    ToyPasses toy;
    const StayingSpace space(1, toy_sample, TargetMap(toy.geometry()));
    const auto variance = [&](Starts starts) {
        Moments bright;
        for (uint64_t run = 0; run < 400; ++run) {
            ChainGroups groups(space,
                               {.groups = 2,
                                .chains = 16,
                                .p_large = 0.01,
                                .starts = starts,
                                .pool = 64,
                                .later = 0.5},
                               {{.chains = 16, .c = 0}});
            CellSums sums;
            constexpr uint32_t kPasses = 40;
            for (uint32_t i = 0; i < kPasses; ++i) {
                if (i == 32) sums.sums = {};
                groups.advance(toy.pass(i, hash_combine(24, run), 64, sums));
                groups.commit();
            }
            bright.add(sums.sums[6] / 8);
        }
        EXPECT_NEAR(bright.mean(), toy_means()[6], 4 * std::sqrt(bright.squared_error()));
        return bright.variance();
    };
    EXPECT_LT(variance(Starts::ByGeneration), 0.4 * variance(Starts::Once));
}

/// What is saved is everything on which later passes depend.
TEST(ChainGroups, GoOnAfterTheyWereSaved) {
    ToyPasses toy;
    const PrimarySpace space(1, toy_sample, TargetMap(toy.geometry()));
    const ChainOptions options{
        .groups = 2, .chains = 4, .pool = 16, .later = 0.1, .large_step = 0.5};
    const std::vector<ClassPlan> plan{{.chains = 4, .c = toy_b()}};
    auto groups = std::make_unique<ChainGroups>(space, options, plan);
    auto saved = std::make_unique<ChainGroups>(space, options, plan);
    CellSums sums, sums_of_saved;
    for (uint32_t i = 0; i < 20; ++i) {
        LearnedState state;
        saved->save(state);
        LearnedState read(state.bytes());
        saved = std::make_unique<ChainGroups>(space, options, plan);
        saved->load(read);
        groups->advance(toy.pass(i, 25, 64, sums));
        saved->advance(toy.pass(i, 25, 64, sums_of_saved));
        groups->commit(), saved->commit();
        ASSERT_EQ(sums.sums, sums_of_saved.sums) << i;
    }
}

/// A damaged state says so, and is not used.
TEST(ChainGroups, RefuseStatesOfOtherChains) {
    ToyPasses toy;
    const PrimarySpace space(1, toy_sample, TargetMap(toy.geometry()));
    // What a group has, as save() writes it.
    struct Saved {
        uint64_t chains = 0;
        std::vector<std::array<double, 4>> normalisation{};
        uint32_t turns = 0;
        std::vector<std::vector<Find>> finds{};
    };
    const auto error = [&](const Saved& s) {
        LearnedState state;
        state.put(s.chains);
        state.put(s.normalisation);
        state.put(s.turns);
        state.put(uint64_t(s.finds.size()));
        for (const auto& f : s.finds) state.put(f);
        if (s.chains == 4)
            for (int i = 0; i < 4; ++i) state.put(false), state.put(uint64_t(0));
        state.put(ChainStats());
        state.put(1.0);
        LearnedState read(state.bytes());
        ChainGroups groups(space, {.groups = 1, .chains = 4}, {{.chains = 4, .c = 1}});
        return error_of([&] { groups.load(read); });
    };
    const std::vector<std::array<double, 4>> one(1), two(2);
    const std::vector<Find> good{{.key = 1, .weight = 1}}, other{{.chain_class = 1, .weight = 1}};
    EXPECT_EQ(error({}), "");
    EXPECT_EQ(error({4, one, 1, {good}}), "");
    for (const Saved& s :
         {Saved{4, two, 1, {good}}, Saved{4, {}, 1, {good}}, Saved{0, one, 1, {good}},
          Saved{4, one, 0, {good}}, Saved{4, one, 1, {}}, Saved{4, one, 1, {good, good}},
          Saved{4, one, 1, {other}}, Saved{3, one, 1, {good}}})
        EXPECT_NE(error(s).find("of other chains"), std::string::npos) << error(s);
}

TEST(Finds, AreThinnedOutWithTheirExpectedWeights) {
    const std::vector<double> weights{0.1, 3, 0.4, 0.4, 12, 1e-3, 2, 0.7, 0.7, 0.7};
    std::array<Moments, 10> mean;
    for (uint64_t run = 0; run < 20000; ++run) {
        std::vector<Find> finds;
        for (size_t i = 0; i < weights.size(); ++i)
            finds.push_back({.key = i, .weight = weights[i]});
        thin(finds, 4, to_unit_double(hash_combine(26, run)));
        ASSERT_LE(finds.size(), 4u);
        std::array<double, 10> kept{};
        double sum = 0;
        for (const Find& f : finds) kept[f.key] += f.weight, sum += f.weight;
        ASSERT_NEAR(sum, 20.001, 1e-9);
        for (size_t i = 0; i < kept.size(); ++i) mean[i].add(kept[i]);
    }
    for (size_t i = 0; i < weights.size(); ++i)
        EXPECT_NEAR(mean[i].mean(), weights[i], 4 * std::sqrt(mean[i].squared_error()) + 1e-9) << i;
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
        ChainGroups groups(
            space,
            {.groups = 2, .chains = 4, .p_large = 0.1, .starts = Starts::EachPass, .pool = 64},
            {{.chains = 4, .c = toy_b()}});
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
        ChainGroups groups(space, {.groups = 4, .chains = 4, .pool = 64},
                           {{.chains = 4, .c = toy_b()}});
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
        ChainGroups groups(space, {.groups = 2, .chains = 4, .pool = 64},
                           {{.chains = 4, .c = toy_b()}});
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
    ChainGroups groups(space, {.groups = 2, .chains = 4, .pool = 64},
                       {{.chains = 4, .c = toy_b()}});
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
    const std::vector<ClassPlan> plan = share_out(8, {5, 0, 3, 0}, cost, 256);
    ASSERT_EQ(plan.size(), 4u);
    int chains = 0;
    for (const ClassPlan& p : plan) {
        chains += p.chains;
        EXPECT_GT(p.chains, 8);
    }
    EXPECT_EQ(chains, 256);
    EXPECT_EQ(plan[0].c, 5);
    EXPECT_EQ(plan[2].c, 3);
    for (const size_t k : {1u, 3u}) EXPECT_EQ(plan[k].c, 0.5);
    // Few chains in all: each class has some nevertheless.
    for (const ClassPlan& p : share_out(1, {1, 0, 0, 0}, cost, 4)) EXPECT_GE(p.chains, 4);
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
        const std::vector<ClassPlan> plan = share_out(b, {0}, cost, 4);
        Moments large;  // Of groups whose pool was black.
        for (uint64_t run = 0; run < 200; ++run) {
            ChainGroups groups(space, {.groups = 2, .chains = 4, .p_large = 0.5, .pool = 16},
                               {{.chains = 4, .c = plan[0].c}});
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
