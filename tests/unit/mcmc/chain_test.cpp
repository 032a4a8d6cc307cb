#include "mcmc/chain.h"

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "toy.h"

namespace etendue::test {
namespace {

TEST(PrimarySpace, StatesAreRepeatedToTheBit) {
    ToyPasses toy;
    const PrimarySpace space(1, toy_sample, TargetMap(toy.geometry()));
    CellSums sums;
    const PassContext pass = toy.pass(0, 1, 8, sums);
    const WholeFilm whole(pass);
    const ChainContext c{whole.sample, toy.work()};
    const auto x = space.make_state(), y = space.make_state(), again = space.make_state();
    space.draw(0, 99, c, *x);
    for (uint64_t key = 0; key < 2000; ++key) {
        // What is drawn from a key can be drawn again, as seeds are from a pool.
        space.draw(0, hash_combine(5, key), c, *y);
        space.draw(0, hash_combine(5, key), c, *again);
        EXPECT_EQ(y->target, again->target);
        space.propose(0, *x, hash_combine(6, key), c, *y);
        // As an observer sees it, which may come later.
        ChainState seen;
        SplatCollector collector(toy.pass(0, 1, 8, sums).film, nullptr, seen, toy.work());
        space.repeat(0, *y, c, collector);
        EXPECT_EQ(seen.target, y->target);
        ASSERT_EQ(seen.splats.size(), y->splats.size());
        if (y->target > 0) space.copy(*y, *x);
    }
}

/// From states that are distributed as the target, a step must leave equal flux between cells, in both directions.
TEST(Chain, MutationsKeepDetailedBalance) {
    ToyPasses toy;
    const PrimarySpace space(1, toy_sample, TargetMap(toy.geometry()));
    CellSums sums;
    const PassContext pass = toy.pass(0, 1, 8, sums);
    const WholeFilm whole(pass);
    const ChainContext c{whole.sample, toy.work()};
    const auto x = space.make_state(), y = space.make_state();
    // Independent states weighted by their target, one step each: Σ I(x) a(x→y) from one cell to another.
    std::array<std::array<Moments, kCells>, kCells> net;
    std::array<std::array<double, kCells>, kCells> flux{};
    constexpr int kSamples = 400000;
    for (uint64_t i = 0; i < kSamples; ++i) {
        space.draw(0, hash_combine(11, i), c, *x);
        int from = -1, to = -1;
        double rate = 0;
        if (x->target > 0) {
            const Proposal p = space.propose(0, *x, hash_combine(12, i), c, *y);
            if (y->target > 0) {
                from = int(x->splats[0].film.x);
                to = int(y->splats[0].film.x);
                rate = std::min(x->target, y->target * p.Q_ratio);
                flux[size_t(from)][size_t(to)] += rate / kSamples;
            }
        }
        for (int a = 0; a < kCells; ++a)
            for (int b = 0; b < a; ++b)
                net[size_t(a)][size_t(b)].add(from == a && to == b   ? rate
                                              : from == b && to == a ? -rate
                                                                     : 0.0);
    }
    const double level = sidak(1e-3, kCells * (kCells - 1) / 2);
    int tested = 0;
    for (size_t a = 0; a < kCells; ++a)
        for (size_t b = 0; b < a; ++b) {
            if (flux[a][b] == 0) continue;
            ++tested;
            EXPECT_GT(welch_p(net[a][b], Moments::exact(0), 0), level)
                << a << " and " << b << ": net " << net[a][b].mean() << " of " << flux[a][b];
        }
    EXPECT_GT(tested, 15);
}

/// Proposals whose acceptance cannot be computed are counted and left out. The others are symmetric.
TEST(Chain, NothingIsAcceptedWithoutAnAcceptance) {
    class Space final : public PrimarySpace {
    public:
        explicit Space(const FilmGeometry& g) : PrimarySpace(1, toy_sample, TargetMap(g)) {}
        Proposal propose(int chain_class, const ChainState& x, uint64_t key, const ChainContext& c,
                         ChainState& y) const override {
            Proposal p = PrimarySpace::propose(chain_class, x, key, c, y);
            p.Q_ratio = std::nan("");
            return p;
        }
    };
    class NoStates final : public StateSink {
        void add(const ChainState&, double) override {}
    };
    ToyPasses toy;
    const Space space(toy.geometry());
    CellSums sums;
    const PassContext pass = toy.pass(0, 1, 8, sums);
    const WholeFilm whole(pass);
    const ChainContext c{whole.sample, toy.work()};
    Chain chain(space, 0);
    chain.start({.key = 1}, c);
    NoStates none;
    ChainStats stats;
    chain.advance({.p_large = 0.5, .c = 1}, 1, 1, 2, 1000, c, none, stats);
    EXPECT_GT(stats.steps[0][3].accepted, 0);
    double accepted = 0;
    uint64_t proposed = 0;
    for (size_t m = 1; m < stats.steps.size(); ++m)
        for (const StepCounts& n : stats.steps[m]) accepted += n.accepted, proposed += n.proposed;
    EXPECT_GT(proposed, 300u);
    EXPECT_EQ(accepted, 0);
    EXPECT_EQ(toy.work().stats.rejected, proposed);
}

TEST(Chain, ResamplingIsSystematic) {
    const std::vector<double> weights{0, 3, 0, 1, 4, 0};
    std::array<Moments, 6> times;
    for (int i = 0; i < 1000; ++i) {
        std::array<int, 6> n{};
        for (const size_t item : resample(weights, 6, (i + 0.5) / 1000)) ++n[item];
        for (size_t k = 0; k < 6; ++k) {
            times[k].add(n[k]);
            EXPECT_LT(std::fabs(n[k] - 6 * weights[k] / 8), 1);
        }
    }
    for (size_t k = 0; k < 6; ++k) EXPECT_NEAR(times[k].mean(), 6 * weights[k] / 8, 1e-2);
    EXPECT_TRUE(resample(std::vector<double>{0, 0}, 3, 0.5).empty());
}

}  // namespace
}  // namespace etendue::test
