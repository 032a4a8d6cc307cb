#pragma once
// A short run of independent samples, thrown away afterwards, that fixes what chains must have fixed before they begin: the
// weights W of the target, the constant c, how large pools are, and how chains and techniques are shared out.

#include <map>

#include "mcmc/chain_groups.h"
#include "mcmc/primary_space.h"

namespace etendue {

struct Pilot {
    TargetMap map;
    double b = 0;                  ///< Mean of the target.
    double relative_variance = 0;  ///< Of the target of one sample.
    uint64_t samples = 0;
    /// Mean of the target by length and number of light vertices.
    std::map<std::pair<int, int>, double> by_technique;  ///< (edges, s)

    void save(LearnedState& to) const;
    void load(LearnedState& from);
};

/// Samples of `sample`'s class 0, doubled until as many again promise b within 2 %, at most two a pixel.
Pilot run_pilot(const PassContext& pass, const PrimarySample& sample);

/// Samples of a group's pool: their mean is known as well as all groups' steps need it, and there are some for each chain
/// to choose from.
uint64_t pool_samples(uint64_t pilot_samples, const ChainOptions& options);

}  // namespace etendue
