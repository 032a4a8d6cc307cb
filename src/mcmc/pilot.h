#pragma once
// A short run of independent samples that fixes the parameters of chains before they start: the weights W of the target,
// the constant c, the sizes of pools, and the probabilities of path lengths and techniques. Its samples are then discarded.

#include "mcmc/chain_groups.h"
#include "mcmc/primary_space.h"
#include "mcmc/technique_choice.h"

namespace etendue {

struct Pilot {
    TargetMap map;
    double b = 0;                  ///< Mean of the target.
    double relative_variance = 0;  ///< Variance of the target of one sample, divided by b².
    /// Variances of a pixel with the weights W of the whole image, direct light included: their means over the pixels.
    double direct_variance = 0;  ///< Of one sample of direct light, given the film point.
    double chain_variance = 0;   ///< Of one independent state of density I/b per pixel.
    double typical = 0;          ///< Median of the target over the states of a chain.
    uint64_t samples = 0;
    uint64_t precise_samples = 0;  ///< Those that sufficed for b; the others improve the map.
    TechniqueLight by_technique;   ///< Mean of the target.
    /// The same of samples without guide, see unguided_light(); empty unless it was called.
    TechniqueLight by_unguided_technique{};

    /// The constant c of chains (chain.h): b. If the pilot found nothing, large steps alone find light, and count as
    /// independent samples.
    double constant() const { return b > 0 ? b : 1e30; }

    void save(LearnedState& to) const;
    void load(LearnedState& from);
};

/// Samples class 0 of `sample`, and twice as often `direct`, the paths that chains do not make. The number of samples is
/// doubled until there is one for each pixel and the relative standard error of b is at most 2 %; at most two samples per
/// pixel, and 2^18 in total.
Pilot run_pilot(const PassContext& pass, const PrimarySample& sample, const PrimarySample& direct);

/// The light by technique of `unguided` samples, as many as the pilot needed for b: a guide makes other techniques good than
/// those of walks without it.
TechniqueLight unguided_light(const PassContext& pass, const PrimarySample& unguided,
                              const Pilot& pilot);

/// Number of samples in the pool of a group: a quarter of Pilot::precise_samples, and at least four for each chain.
uint64_t pool_samples(uint64_t precise_samples, const ChainOptions& options);

}  // namespace etendue
