#pragma once
// What passes cost, from their counters and a fixed table, so that a choice by cost does not depend on the machine.

#include <string>

#include "pathspace/render_stats.h"

namespace etendue {

/// What a guide does for a method. Without guided directions at surfaces, emission and Russian roulette remain.
enum class GuideUse { None, WithoutSurfaces, WithSurfaces };

/// Seconds that one thread of a usual machine takes for what `stats` has counted of a method, in a scene of middle size. In
/// one scene, methods are to each other as these figures are, within about a fifth.
double simulated_seconds(const std::string& method, GuideUse guide, const RenderStats& stats);
/// Cost of what the counters count, relative to the same without a guide.
double guided_factor(GuideUse guide);
/// The same for a sample of a method of which nothing is known yet.
double typical_sample_seconds(const std::string& method);
/// The same for the first decision about specular connections, see run_specular_pilot().
double typical_specular_pilot_seconds();
/// Seconds for the photons of a rendering with specular connections.
double specular_photon_seconds();
/// The same for a guide that is trained by so many walks of each kind.
double training_seconds(uint64_t walks);

}  // namespace etendue
