#pragma once
// What passes cost, from their counters and a fixed table, so that a choice by cost does not depend on the machine.

#include <string>

#include "pathspace/render_stats.h"

namespace etendue {

/// Seconds that one thread of a usual machine takes for what `stats` has counted of a method, in a scene of middle size. In
/// one scene, methods are to each other as these figures are, within about a fifth.
/// `is_guided`: whether a guide chooses directions at surfaces.
double simulated_seconds(const std::string& method, bool is_guided, const RenderStats& stats);
/// Cost of a sample relative to one of the same method without guide.
double guided_factor(bool is_guided);
/// The same for a sample of a method of which nothing is known yet.
double typical_sample_seconds(const std::string& method);
/// The same for the first decision about specular connections, see run_specular_pilot().
double typical_specular_pilot_seconds();
/// Seconds for the photons of a rendering with specular connections.
double specular_photon_seconds();
/// The same for a guide that is trained by so many walks of each kind.
double training_seconds(uint64_t walks);

}  // namespace etendue
