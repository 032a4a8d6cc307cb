#pragma once
// Light walks that make the photons from which searches of specular connections begin.

#include "integrator/integrator.h"
#include "manifold/seed_photons.h"

namespace etendue {

/// Traces `walks` light walks, a multiple of 1024, that go on by at most `depth` delta events, with random numbers that no pass
/// uses. The photons are where these walks arrive at surfaces that scatter. Fewer walks are the first ones of more walks.
SeedPhotons trace_seed_photons(const PassContext& pass, int depth, uint64_t walks);

}  // namespace etendue
