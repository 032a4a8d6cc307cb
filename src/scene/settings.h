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

/// A parameter of a Mitsuba integrator that the integrator used for it does not have under this name.
struct MitsubaIntegratorParam {
    /// What becomes of it.
    enum class Use {
        Counterpart,  ///< It sets `counterpart`.
        OfTheScene,   ///< The scene builder uses it.
        NoEffect,     ///< It does not concern the image, only how Mitsuba computes it.
        Missing,      ///< A warning says that it is ignored, unless its value is `harmless`.
    };
    ParamInfo info;
    Use use;
    const char* counterpart = "";  ///< Parameter of the integrator used.
    bool is_relative =
        false;     ///< Whether the value is a fraction of the radius of the scene's bounds.
    int most = 0;  ///< Largest value that the counterpart takes; 0: no limit.
    const char* harmless = "";  ///< Value that asks for what is done anyway.
};

/// A name of Mitsuba for an integrator, and the integrator used for it unless the command line names one. Any integrator
/// can also be named by its own name. Both kinds of names take all parameters of the integrator used.
struct IntegratorAlias {
    PluginInfo info;         ///< With Mitsuba's parameters.
    const char* integrator;  ///< Empty for one that only wraps others: the first of these is used.
    bool is_substitute;      ///< Whether it computes something else, so that a warning is due.
    std::vector<MitsubaIntegratorParam> params;
    int max_depth = -1;  ///< Number of edges of its longest paths; -1: the parameter max_depth.
};
const std::vector<IntegratorAlias>& integrator_aliases();
/// The alias of this name; nullptr where there is none.
const IntegratorAlias* find_integrator_alias(std::string_view name);
/// Parameters that every integrator of a scene file takes.
const std::vector<MitsubaIntegratorParam>& shared_integrator_params();

const PluginInfo& medium_info();
/// σ_t, in 1/length, of a homogeneous medium without scattering; throws SceneError for any other.
Rgb read_absorption(const Params& params);

}  // namespace etendue
