#pragma once
// Settings in scene files for film, sampler and integrator; and absorbing media.

#include "description/params.h"
#include "film/film.h"

namespace etendue {

struct FilmEntry {
    PluginInfo info;
    FilmGeometry (*make)(const Params& params);
};
const std::vector<FilmEntry>& film_registry();
/// The filter of films without one: gaussian.
ReconstructionFilter default_filter();

/// Sampler plug-ins that scene files may name. Only their sample count is used; the random numbers are chosen on the
/// command line.
struct SamplerEntry {
    PluginInfo info;
};
const std::vector<SamplerEntry>& sampler_registry();

/// An integrator that scene files may name, and the integrator used for it unless the command line names one.
struct IntegratorAlias {
    PluginInfo info;
    const char* integrator;  ///< Empty for one that only wraps others: the first of these is used.
    bool is_substitute;      ///< Whether it computes something else, so that a warning is due.
    int max_depth = -1;      ///< Number of edges of its longest paths; -1: the parameter max_depth.
};
const std::vector<IntegratorAlias>& integrator_aliases();

const PluginInfo& medium_info();
/// σ_t, in 1/length, of a homogeneous medium without scattering; throws SceneError for any other.
Rgb read_absorption(const Params& params);

}  // namespace etendue
