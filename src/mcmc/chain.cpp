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
    large_sum += o.large_sum;
    chain_light += o.chain_light, large_light += o.large_light;
    return *this;
}

Chain::Chain(const StateSpace& space, int chain_class)
    : space_(space), class_(chain_class), x_(space.make_state()), y_(space.make_state()) {}

void Chain::start(uint64_t key, const ChainContext& c) {
    space_.draw(class_, key, c, *x_);
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

void Chain::add(const ChainState& state, double chain_share, double large_share,
                const ChainTerms& terms, double scale, StateSink& states, ChainStats& stats) const {
    const double inverse = state.target + terms.c * terms.p_large * state.independent_density;
    if (!(inverse > 0) || !(state.target > 0)) return;
    stats.chain_light += chain_share * state.target / inverse;
    stats.large_light += large_share * terms.c * state.target / inverse;
    const double factor = scale * (chain_share + large_share * terms.c) / inverse;
    if (factor != 0) states.add(state, factor);
}

void StateSpace::contribute(int chain_class, const ChainState& x, double factor,
                            const ChainContext& c, SplatSink& film) const {
    if (c.work.is_observed) {
        Repeater sink(film, factor, c.work);
        repeat(chain_class, x, c, sink);
    }
    for (const Splat& s : x.splats) film.add(s.film, s.value * float(factor));
}

void Chain::advance(const ChainTerms& terms, double b, double scale, uint64_t key, uint64_t first,
                    uint64_t count, const ChainContext& c, StateSink& states, ChainStats& stats) {
    double x_share = 0;  // Sum of b·a of the present state that is not yet added.
    double x_large = 0;  // 1 if it comes from a large step that is not yet added.
    for (uint64_t step = first; step < first + count; ++step) {
        const uint64_t step_key = hash_combine(key, step);
        const bool is_large = to_unit_double(hash_combine(step_key, 0)) < terms.p_large;
        if (!is_large && !is_started_) continue;
        const uint64_t y_key = hash_combine(step_key, 1);

        double accept = 0;
        Proposal proposal;
        if (is_large) {
            space_.draw(class_, y_key, c, *y_);
            ++stats.large_steps;
            stats.large_sum += y_->importance();
            if (is_started_) accept = y_->importance() / x_->importance();
        } else {
            proposal = space_.propose(class_, *x_, y_key, c, *y_);
            if (!proposal.has_failed) accept = y_->target * proposal.Q_ratio / x_->target;
        }
        if (!std::isfinite(accept)) {
            // Of a NaN, std::min(1.0, accept) would make 1.
            c.work.stats.rejected += std::isnan(accept);
            accept = std::isnan(accept) ? 0 : 1;
        }
        accept = std::min(1.0, accept);

        StepCounts& counts = is_large
                                 ? stats.steps[0][length_index(*y_)]
                                 : stats.steps[size_t(proposal.mutation) + 1][length_index(*x_)];
        ++counts.proposed;
        counts.failed += proposal.has_failed;
        counts.zero += !proposal.has_failed && !(y_->target > 0);
        counts.accepted += accept;

        const double y_share = b * accept, y_large = is_large ? 1 : 0;
        if (is_started_) x_share += b * (1 - accept);
        if (is_started_ && to_unit_double(hash_combine(step_key, 2)) < accept) {
            add(*x_, x_share, x_large, terms, scale, states, stats);
            std::swap(x_, y_);
            x_share = y_share, x_large = y_large;
            stay_ = 0;
            continue;
        }
        if (!proposal.has_failed && y_->target > 0)
            add(*y_, y_share, y_large, terms, scale, states, stats);
        if (is_started_) stats.longest_stay = std::max(stats.longest_stay, ++stay_);
    }
    if (is_started_) add(*x_, x_share, x_large, terms, scale, states, stats);
}

}  // namespace etendue
