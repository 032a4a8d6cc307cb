#include "mcmc/primary_space.h"

namespace etendue {

SplatCollector::SplatCollector(const Film& film, const TargetMap* map, ChainState& state,
                               Workspace& work)
    : region_(reached_region(film.geometry(), film.filter())), map_(map), state_(state),
      work_(work) {
    state_.target = 0;
    state_.edges = 0;
    state_.splats.clear();
}

void SplatCollector::add(const Join& join, Rgb contribution) {
    const bool is_eye = join.technique.t >= 2;
    const Rgb value = contribution * (join.mis_weight * (is_eye ? work_.z.film_weight : 1.0f));
    if (!is_finite(value)) {
        ++work_.stats.rejected;
        return;
    }
    const double y = double(luminance(value));
    if (!(y > 0) || !region_.contains(join.film)) return;
    if (observer) observer(join, y);
    // All joins of the eye path have one film point, and come one after the other.
    std::vector<Splat>& splats = state_.splats;
    const bool is_same = is_eye && !splats.empty() && splats.back().film.x == join.film.x &&
                         splats.back().film.y == join.film.y;
    if (map_ && !is_same) W_ = (*map_)(join.film);
    const double part = y * W_;
    state_.target += part;
    if (part > largest_) {
        largest_ = part;
        state_.edges = join.technique.vertices() - 1;
    }
    if (is_same)
        splats.back().value += value;
    else
        splats.push_back({join.film, value});
}

void evaluate_sample(const PrimarySample& sample, int chain_class, NumberSource& source,
                     const ChainContext& c, ContributionSink& sink) {
    Sampler sampler(source);
    sample(chain_class, c.sample.with(sampler, sink), c.work);
}

void PrimarySpace::evaluate(int chain_class, NumberSource& source, const ChainContext& c,
                            ChainState& y) const {
    SplatCollector splats(c.sample.film, &map_, y, c.work);
    evaluate_sample(sample_, chain_class, source, c, splats);
}

void NumberSpace::draw(int chain_class, uint64_t key, const ChainContext& c, ChainState& y) const {
    NumberSource source(NumberStep::Fresh, key, nullptr, &static_cast<NumberState&>(y).numbers);
    evaluate(chain_class, source, c, y);
}

Proposal NumberSpace::propose(int chain_class, const ChainState& x, uint64_t key,
                              const ChainContext& c, ChainState& y) const {
    const Mutation mutation = to_unit_double(mix64(key)) < blocks_ ? Block : Small;
    NumberSource source(mutation == Block ? NumberStep::Block : small_, key,
                        &static_cast<const NumberState&>(x).numbers,
                        &static_cast<NumberState&>(y).numbers);
    evaluate(chain_class, source, c, y);
    return {.mutation = mutation};
}

void PrimarySpace::repeat(int chain_class, const ChainState& x, const ChainContext& c,
                          ContributionSink& sink) const {
    NumberSource source(NumberStep::Same, 0, &static_cast<const NumberState&>(x).numbers, nullptr);
    evaluate_sample(sample_, chain_class, source, c, sink);
}

}  // namespace etendue
