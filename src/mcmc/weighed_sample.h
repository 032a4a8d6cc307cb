#pragma once
// Samples of bidirectional path tracing, each join of which is a state that chains can start from.

#include "mcmc/primary_space.h"

namespace etendue {

struct WeighedSample {
    PrimarySample sample;
    TargetMap map;

    /// Calls use(join, weight) for each join of a sample that contributes, with its part of the target.
    template <class Use>
    void for_each_part(Sampler& sampler, const ChainContext& c, const Use& use) const {
        ChainState unused;
        SplatCollector collector(c.sample.film, nullptr, unused, c.work);
        collector.observer = [&](const Join& join, double luminance) {
            use(join, luminance * map(join.film));
        };
        sample(0, c.sample.with(sampler, collector), c.work);
    }
};

}  // namespace etendue
