#pragma once
// The parts of a scene file that say how to render: film, sampler, integrator; and absorbing media.

#include "description/params.h"
#include "film/film.h"

namespace etendue {

struct FilmEntry {
    PluginInfo info;
    FilmGeometry (*make)(const Params& params);
};
const std::vector<FilmEntry>& film_registry();
/// What a film without a filter has.
ReconstructionFilter default_filter();

/// Sampler plug-ins that scene files may name. Only their sample count is taken: which random numbers to use is the
/// command line's choice.
struct SamplerEntry {
    PluginInfo info;
};
const std::vector<SamplerEntry>& sampler_registry();

/// Integrators that scene files name and what renders them here; the command line's choice is stronger.
struct IntegratorAlias {
    PluginInfo info;
    const char* integrator;
};
const std::vector<IntegratorAlias>& integrator_aliases();

const PluginInfo& medium_info();
/// σ_t of a homogeneous medium without scattering; an error for any other.
Rgb read_absorption(const Params& params);

}  // namespace etendue
