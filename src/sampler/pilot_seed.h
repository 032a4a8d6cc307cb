#pragma once
// Seeds of random numbers outside of the samples of a pass. What a method learns or decides before a pass must not depend
// on the random numbers of that pass: weights and sampling densities would then be correlated with its paths.

#include "math/hash.h"

namespace etendue {

/// What the numbers are used for. Each use has numbers of its own.
enum class PilotUse : uint64_t {
    OtherPaths = 0x6f74686572,      ///< PassContext::for_each_other_path()
    LightPathCount = 0x636f756e74,  ///< LightPathOptions::count()
    Pairs = 0x7061697273,           ///< run_pair_pilot()
    Guide = 0x67756964,             ///< Guiding::train(), plus the index of the pass.
    Lights = 0x6c69676874,          ///< The selection of emitters alone, in Guiding::train().
    Chains = 0x70696c6f74,          ///< run_pilot()
    Choice = 0x63686f696365,        ///< with_chosen_method(), plus the index of the pilot.
    PhotonScale = 0x6d7073,         ///< The scale of the importance of photons.
    PhotonPilot = 0x6d7074,         ///< MetropolisPhotons::run_pilot()
    PhotonPaths = 0x6d70737061,     ///< Paths as states of photons.
    SeenExtent = 0x7365656e,        ///< seen_extent()
    Specular = 0x7370656375,        ///< run_specular_pilot()
    SpecularSeeds = 0x73656564,     ///< trace_seed_photons()
};

/// The seed for a use in a rendering or pass with the given seed.
constexpr uint64_t pilot_seed(uint64_t seed, PilotUse use, uint64_t number = 0) {
    return hash_combine(seed, uint64_t(use) + number);
}

}  // namespace etendue
