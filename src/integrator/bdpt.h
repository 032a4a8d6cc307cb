#pragma once

#include "integrator/bidirectional.h"

namespace etendue {

IntegratorEntry bdpt_entry();

/// Traces the light path of a sample of bidirectional path tracing, whose eye path is work.z, and adds all techniques that
/// `counts` has.
void add_bdpt_joins(const Bidirectional& paths, const SampleContext& c,
                    const TechniqueCounts& counts, Workspace& work,
                    const LearnedPlaces* learned = nullptr);
/// The same after it has traced the eye path.
void add_bdpt_sample(const Bidirectional& paths, const SampleContext& c,
                     const TechniqueCounts& counts, Workspace& work,
                     const LearnedPlaces* learned = nullptr);

/// Traces the light paths of the pass, adds C(s,1) and C(s,0), and stores the first `kept` paths in `cache`. The caller
/// has called cache.begin().
void trace_light_paths(const Bidirectional& paths, const PassContext& pass,
                       const TechniqueCounts& counts, uint64_t kept, LightVertexCache& cache,
                       const LearnedPlaces* learned = nullptr);

}  // namespace etendue
