#include "mcmc/chain.h"

#include <algorithm>
#include <cmath>

#include "math/hash.h"

namespace etendue {
namespace {

/// Passes on the joins of a state that is evaluated again, with its factor.
class Repeater final : public ContributionSink {
public:
    Repeater(SplatSink& to, double factor, const Workspace& work)
        : to_(to), factor_(float(factor)), work_(work) {}
    void add(const Join& join, Rgb contribution) override {
        to_.tell(join, contribution,
                 join.technique.t >= 2 ? factor_ * work_.z.film_weight : factor_);
    }

private:
    SplatSink& to_;
    float factor_;
    const Workspace& work_;
};

size_t length_index(const ChainState& state) {
    return size_t(std::clamp(state.edges, 0, ChainStats::kLengths - 1));
}

}  // namespace

ChainStats& ChainStats::operator+=(const ChainStats& o) {
    for (size_t m = 0; m < steps.size(); ++m)
        for (size_t k = 0; k < steps[m].size(); ++k) steps[m][k] += o.steps[m][k];
    longest_stay = std::max(longest_stay, o.longest_stay);
    large_steps += o.large_steps;
    later_samples += o.later_samples;
    large_sum += o.large_sum;
    chain_light += o.chain_light, large_light += o.large_light;
    return *this;
}

Chain::Chain(const StateSpace& space, int chain_class)
    : space_(space), class_(chain_class), x_(space.make_state()), y_(space.make_state()) {}

void Chain::start(const Find& find, const ChainContext& c) {
    space_.recall(find, c, *x_);
    is_started_ = x_->target > 0;
    stay_ = 0;
}

void Chain::copy(const Chain& from) {
    class_ = from.class_;
    is_started_ = from.is_started_;
    stay_ = from.stay_;
    if (is_started_) space_.copy(*from.x_, *x_);
}

void Chain::save(LearnedState& to) const {
    to.put(is_started_);
    to.put(stay_);
    if (is_started_) x_->save(to);
}

void Chain::load(LearnedState& from) {
    from.get(is_started_);
    from.get(stay_);
    if (is_started_) x_->load(from);
}

void StateSpace::contribute(int chain_class, const ChainState& x, double factor,
                            const ChainContext& c, SplatSink& film) const {
    if (c.work.is_observed) {
        Repeater sink(film, factor, c.work);
        repeat(chain_class, x, c, sink);
    }
    for (const Splat& s : x.splats) film.add(s.film, s.value * float(factor));
}

void StateSpace::sample(uint64_t key, const ChainContext& c, std::vector<Find>& finds) const {
    const auto state = make_state();
    for (int k = 0; k < classes(); ++k) {
        const uint64_t own = k == 0 ? key : hash_combine(key, uint64_t(k));
        draw(k, own, c, *state);
        if (state->target > 0) finds.push_back({own, 0, k, state->target});
    }
}

Proposal Chain::propose(bool is_large, uint64_t key, const ChainContext& c) {
    if (!is_large) return space_.propose(class_, *x_, key, c, *y_);
    space_.draw(class_, key, c, *y_);
    return {};
}

double Chain::acceptance(const Proposal& proposal, RenderStats& stats) const {
    if (!is_started_) return 0;
    const double a = y_->target * proposal.Q_ratio / x_->target;
    // Of a NaN, std::min(1.0, a) would make 1.
    stats.rejected += std::isnan(a);
    return std::isnan(a) ? 0.0 : std::min(1.0, a);
}

void Chain::advance(const ChainTerms& terms, double b, double scale, uint64_t key, uint64_t count,
                    const ChainContext& c, StateSink& states, ChainStats& stats,
                    std::vector<Find>* finds) {
    /// What a state is worth: the sum of its factors b·a, and 1 if it comes from a large step.
    struct Shares {
        double chain = 0, large = 0;
    };
    const auto add = [&](const ChainState& state, const Shares& shares) {
        if (!(state.target > 0)) return;
        const double sum = state.target + terms.c * terms.p_large;
        stats.chain_light += shares.chain * state.target / sum;
        stats.large_light += shares.large * terms.c * state.target / sum;
        const double factor = scale * (shares.chain + shares.large * terms.c) / sum;
        if (factor != 0) states.add(state, factor);
    };
    Shares of_x;  // Not yet added.
    for (uint64_t step = 0; step < count; ++step) {
        c.work.go_on();
        const uint64_t step_key = hash_combine(key, step);
        const bool is_large = to_unit_double(hash_combine(step_key, 0)) < terms.p_large;
        if (!is_large && !is_started_) continue;
        const uint64_t proposal_key = hash_combine(step_key, 1);
        const Proposal proposal = propose(is_large, proposal_key, c);
        const double a = acceptance(proposal, c.work.stats);

        StepCounts& counts = is_large
                                 ? stats.steps[0][length_index(*y_)]
                                 : stats.steps[size_t(proposal.mutation) + 1][length_index(*x_)];
        ++counts.proposed;
        counts.failed += proposal.has_failed;
        counts.zero += !proposal.has_failed && !(y_->target > 0);
        counts.accepted += a;
        if (is_large) {
            ++stats.large_steps, stats.large_sum += y_->target;
            if (finds && y_->target > 0)
                finds->push_back({proposal_key, Find::kLargeStep, class_, y_->target});
        }

        const Shares of_y{b * a, is_large ? 1.0 : 0.0};
        if (is_started_) of_x.chain += b * (1 - a);
        if (is_started_ && to_unit_double(hash_combine(step_key, 2)) < a) {
            add(*x_, of_x);
            std::swap(x_, y_);
            of_x = of_y;
            stay_ = 0;
        } else {
            add(*y_, of_y);
            if (is_started_) stats.longest_stay = std::max(stats.longest_stay, ++stay_);
        }
    }
    if (is_started_) add(*x_, of_x);
}

}  // namespace etendue
