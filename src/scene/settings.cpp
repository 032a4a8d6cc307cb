#include "scene/settings.h"

#include <fmt/format.h>

namespace etendue {

const std::vector<FilmEntry>& film_registry() {
    static const std::vector<FilmEntry> entries = [] {
        const std::vector<ParamInfo> params = {
            {"width", ParamKind::Int, "768", "Width in pixels."},
            {"height", ParamKind::Int, "576", "Height in pixels."},
            {"crop_offset_x", ParamKind::Int, "0", "Left edge of the part that is rendered."},
            {"crop_offset_y", ParamKind::Int, "0", "Upper edge of the part that is rendered."},
            {"crop_width", ParamKind::Int, "width", "Width of the part that is rendered."},
            {"crop_height", ParamKind::Int, "height", "Height of the part that is rendered."},
            {"rfilter", ParamKind::Object, "gaussian", "Reconstruction filter."},
            {"file_format", ParamKind::String, "",
             "Accepted; the extension of the output file "
             "selects the format."},
            {"pixel_format", ParamKind::String, "", "Accepted; RGB is always written."},
            {"component_format", ParamKind::String, "", "Accepted; floats are written."},
            {"banner", ParamKind::Bool, "", "Accepted; without effect."},
            {"high_quality_edges", ParamKind::Bool, "",
             "Accepted; pixels at the edge are always as with this option on."},
            {"sample_border", ParamKind::Bool, "", "Accepted; borders are always sampled."},
            {"compensate", ParamKind::Bool, "", "Accepted; sums are always in double precision."},
            {"attach_log", ParamKind::Bool, "", "Accepted; without effect."},
            {"gamma", ParamKind::Float, "", "Accepted; output is linear."},
            {"exposure", ParamKind::Float, "", "Accepted; output is linear."},
            {"tonemap_method", ParamKind::String, "", "Accepted; output is linear."},
        };
        const auto make = [](const Params& p) {
            FilmGeometry f;
            constexpr int kMost = 1 << 16;
            f.width = int(p.integer("width", 768, 1, kMost));
            f.height = int(p.integer("height", 576, 1, kMost));
            f.crop_x = int(p.integer("crop_offset_x", 0, 0, kMost));
            f.crop_y = int(p.integer("crop_offset_y", 0, 0, kMost));
            f.crop_width = int(p.integer("crop_width", f.width, 1, kMost));
            f.crop_height = int(p.integer("crop_height", f.height, 1, kMost));
            if (f.crop_x + f.crop_width > f.width || f.crop_y + f.crop_height > f.height)
                p.fail(fmt::format("the crop of {} x {} pixels at ({}, {}) does not lie within the "
                                   "image of {} x {}",
                                   f.crop_width, f.crop_height, f.crop_x, f.crop_y, f.width,
                                   f.height));
            return f;
        };
        std::vector<FilmEntry> all;
        for (const char* name : {"hdrfilm", "ldrfilm", "mfilm"})
            all.push_back({{"film", name, "Image of linear colours.", params}, make});
        return all;
    }();
    return entries;
}

ReconstructionFilter default_filter() {
    SceneDescription empty;
    empty.objects = {{"rfilter", "gaussian", "", {}, {}, {}}};
    for (const FilterEntry& e : filter_registry())
        if (std::string_view(e.info.name) == "gaussian") return e.make({empty, 0});
    return ReconstructionFilter::box();
}

const std::vector<SamplerEntry>& sampler_registry() {
    static const std::vector<SamplerEntry> entries = [] {
        std::vector<SamplerEntry> all;
        const std::vector<ParamInfo> params = {
            {"sample_count", ParamKind::Int, "4",
             "Samples per pixel, unless the command line sets a limit."},
            {"seed", ParamKind::Int, "", "Accepted; the option --seed is used instead."},
            {"dimension", ParamKind::Int, "", "Accepted; there is no limit."},
            {"scramble", ParamKind::Int, "", "Accepted; points are always scrambled."},
            {"jitter", ParamKind::Bool, "", "Accepted; points are always jittered."}};
        for (const char* name : {"independent", "sobol", "ldsampler", "stratified", "multijitter",
                                 "orthogonal", "halton", "hammersley"})
            all.push_back(
                {{"sampler", name,
                  "Only the sample count is used; the option --sampler selects the random numbers.",
                  params}});
        return all;
    }();
    return entries;
}

namespace {

using Use = MitsubaIntegratorParam::Use;

/// A parameter that becomes one of the integrator used.
MitsubaIntegratorParam becomes(const char* name, ParamKind kind, const char* counterpart,
                               const char* doc) {
    return {{name, kind, "", doc}, Use::Counterpart, counterpart};
}
/// A parameter without counterpart.
MitsubaIntegratorParam missing(const char* name, ParamKind kind) {
    return {{name, kind, "", "Ignored, with a warning."}, Use::Missing};
}
/// A switch of what is always done, or never.
MitsubaIntegratorParam fixed(const char* name, bool always) {
    return {{name, ParamKind::Bool, always ? "true" : "false",
             always ? "Always true; a warning says so otherwise."
                    : "Always false; a warning says so otherwise."},
            Use::Missing,
            "",
            false,
            0,
            always ? "true" : "false"};
}
/// A parameter that changes no image.
MitsubaIntegratorParam of_the_work(const char* name, ParamKind kind) {
    return {{name, kind, "", "Accepted; it divides the work, and changes no image."},
            Use::NoEffect};
}

using IntegratorParamList = std::vector<MitsubaIntegratorParam>;

IntegratorParamList all_missing(ParamKind kind, std::initializer_list<const char*> names) {
    IntegratorParamList all;
    for (const char* name : names) all.push_back(missing(name, kind));
    return all;
}

IntegratorParamList operator+(IntegratorParamList a, const IntegratorParamList& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

/// Parameters of ppm and sppm.
IntegratorParamList progressive_params() {
    IntegratorParamList all = {
        becomes("photon_count", ParamKind::Int, "light_paths", "Becomes light_paths."),
        becomes("initial_radius", ParamKind::Float, "radius", "Becomes radius."),
        of_the_work("granularity", ParamKind::Int), missing("max_passes", ParamKind::Int)};
    all.back().harmless = "-1";
    return all;
}

IntegratorParamList photon_mapper_params() {
    IntegratorParamList all = {
        becomes("global_photons", ParamKind::Int, "light_paths",
                "Becomes light_paths, each of which makes several photons."),
        becomes("lookup_size", ParamKind::Int, "nearest", "Becomes nearest, at most 512."),
        becomes("global_lookup_radius", ParamKind::Float, "radius",
                "Becomes radius, in scene units: a fraction of the radius of the scene's bounds."),
        of_the_work("granularity", ParamKind::Int)};
    all[1].most = 512;
    all[2].is_relative = true;
    return all +
           all_missing(ParamKind::Int,
                       {"direct_samples", "glossy_samples", "caustic_photons", "volume_photons"}) +
           all_missing(ParamKind::Float, {"caustic_lookup_radius"});
}

IntegratorParamList metropolis_params() {
    return all_missing(ParamKind::Int, {"direct_samples", "luminance_samples"}) +
           IntegratorParamList{fixed("two_stage", false)};
}

/// Mutations of paths: all but the last one are always used.
IntegratorParamList mutation_params() {
    return {fixed("bidirectional_mutation", true), fixed("lens_perturbation", true),
            fixed("caustic_perturbation", true),   fixed("multi_chain_perturbation", true),
            fixed("manifold_perturbation", false), missing("lambda", ParamKind::Float)};
}

/// Parameters of Mitsuba 3's integrators that compute derivatives.
IntegratorParamList derivative_params() {
    IntegratorParamList all;
    for (const auto& [name, kind] : {std::pair("reparam_max_depth", ParamKind::Int),
                                     {"sppc", ParamKind::Int},
                                     {"sppp", ParamKind::Int},
                                     {"sppi", ParamKind::Int},
                                     {"guiding", ParamKind::String},
                                     {"guiding_proj", ParamKind::Bool},
                                     {"guiding_rounds", ParamKind::Int},
                                     {"antithetic_sampling", ParamKind::Bool},
                                     {"emitter_samples", ParamKind::Int}})
        all.push_back({{name, kind, "", "Accepted; derivatives are not computed."}, Use::NoEffect});
    return all;
}

}  // namespace

const std::vector<MitsubaIntegratorParam>& shared_integrator_params() {
    static const IntegratorParamList all = {
        {{"hide_emitters", ParamKind::Bool, "false", "Always false; a warning says so otherwise."},
         Use::Missing,
         "",
         false,
         0,
         "false"},
        {{"strict_normals", ParamKind::Bool, "false",
          "Whether nothing scatters where the geometric and the shading normal see a direction on "
          "different sides."},
         Use::OfTheScene},
        of_the_work("samples_per_pass", ParamKind::Int),
        of_the_work("block_size", ParamKind::Int),
        missing("timeout", ParamKind::Float)};
    return all;
}

const std::vector<IntegratorAlias>& integrator_aliases() {
    static const std::vector<IntegratorAlias> entries = [] {
        const ParamInfo max_depth = {"max_depth", ParamKind::Int, "-1",
                                     "Number of edges of the longest paths; -1: no limit."};
        const auto rr_depth = [](const char* fallback) {
            return ParamInfo{"rr_depth", ParamKind::Int, fallback,
                             "Index of the first vertex of a sub-path at which Russian roulette is "
                             "applied."};
        };
        std::vector<IntegratorAlias> all;
        // `own`: parameters that Mitsuba's integrator shares with the one used.
        const auto add = [&](std::initializer_list<const char*> names, const char* doc,
                             const char* integrator, const std::vector<ParamInfo>& own,
                             const IntegratorParamList& params = {}, bool is_substitute = false) {
            for (const char* name : names) {
                IntegratorAlias alias{{"integrator", name, doc, own},
                                      integrator,
                                      is_substitute,
                                      params + shared_integrator_params()};
                for (const MitsubaIntegratorParam& p : alias.params)
                    alias.info.params.push_back(p.info);
                all.push_back(std::move(alias));
            }
        };
        const std::vector<ParamInfo> of_paths = {max_depth, rr_depth("5")},
                                     of_sub_paths = {max_depth, rr_depth("2")};
        add({"path", "volpath", "volpath_simple"}, "Path tracing.", "path", of_paths);
        add({"volpathmis"}, "Path tracing.", "path", of_paths,
            {{{"use_spectral_mis", ParamKind::Bool, "",
               "Accepted; there are no spectral media for it."},
              Use::NoEffect}});
        add({"prb", "prb_basic", "prbvolpath", "prb_projective"},
            "Path tracing; derivatives are not computed.", "path", of_paths, derivative_params());
        const size_t direct = all.size();
        add({"direct"}, "Path tracing of at most two edges.", "path", {},
            all_missing(ParamKind::Int, {"shading_samples", "emitter_samples", "bsdf_samples"}));
        add({"direct_projective"},
            "Path tracing of at most two edges; derivatives are not computed.", "path", {},
            derivative_params());
        for (size_t i = direct; i < all.size(); ++i) all[i].max_depth = 2;
        add({"ptracer"}, "Light tracing.", "light", of_paths,
            {of_the_work("granularity", ParamKind::Int), fixed("brute_force", false)});
        add({"bdpt"}, "Bidirectional path tracing.", "bdpt", of_sub_paths,
            {fixed("light_image", true), fixed("sample_direct", true)});
        add({"photonmapper"}, "Photon mapping.", "pm", of_sub_paths, photon_mapper_params());
        const ParamInfo alpha = {"alpha", ParamKind::Float, "0.75",
                                 "Controls how fast the radius shrinks."};
        const std::vector<ParamInfo> progressive = {max_depth, rr_depth("2"), alpha};
        add({"ppm"}, "Progressive photon mapping.", "ppm", progressive, progressive_params());
        add({"sppm"}, "Stochastic progressive photon mapping.", "sppm", progressive,
            progressive_params());
        add({"pssmlt"}, "Metropolis light transport in primary sample space.", "pssmlt",
            {max_depth,
             rr_depth("2"),
             {"p_large", ParamKind::Float, "0.1", "Probability of a large step."}},
            metropolis_params() + IntegratorParamList{fixed("bidirectional", true)});
        add({"mlt"}, "Metropolis light transport.", "mlt", {max_depth},
            metropolis_params() + mutation_params() +
                IntegratorParamList{missing("rr_depth", ParamKind::Int)});
        // What computes something else says so; its parameters need no warnings of their own.
        const auto no_effect = [](ParamKind kind, std::initializer_list<const char*> names) {
            IntegratorParamList params;
            for (const char* name : names)
                params.push_back(
                    {{name, kind, "", "Accepted; path is rendered instead."}, Use::NoEffect});
            return params;
        };
        add({"erpt"}, "Not supported.", "path", of_paths,
            no_effect(ParamKind::Float,
                      {"num_chains", "max_chains", "chain_length", "direct_samples", "lambda"}) +
                no_effect(ParamKind::Bool,
                          {"bidirectional_mutation", "lens_perturbation", "caustic_perturbation",
                           "multi_chain_perturbation", "manifold_perturbation"}),
            true);
        add({"vpl"}, "Not supported.", "path", of_paths,
            no_effect(ParamKind::Float, {"clamping", "shadow_map_resolution"}), true);
        add({"ao"}, "Not supported.", "path", of_paths,
            no_effect(ParamKind::Float, {"shading_samples", "ray_length"}), true);
        add({"field"}, "Not supported; see --aov.", "path", of_paths,
            {{{"field", ParamKind::String, "", "Accepted; path is rendered instead."},
              Use::NoEffect},
             {{"undefined", ParamKind::Rgb, "", "Accepted; path is rendered instead."},
              Use::NoEffect}},
            true);
        add({"depth"}, "Not supported; see --aov.", "path", of_paths, {}, true);
        add({"adaptive", "irrcache", "multichannel", "aov", "moment", "stokes"},
            "A wrapper around other integrators.", "", {});
        return all;
    }();
    return entries;
}

const IntegratorAlias* find_integrator_alias(std::string_view name) {
    for (const IntegratorAlias& alias : integrator_aliases())
        if (name == alias.info.name) return &alias;
    return nullptr;
}

const PluginInfo& medium_info() {
    static const PluginInfo info = {
        "medium",
        "homogeneous",
        "Absorbing medium, which attenuates light along segments. Its albedo must be 0.",
        {{"sigma_t", ParamKind::Rgb, "1", "Extinction coefficient in 1/length."},
         {"sigma_a", ParamKind::Rgb, "", "Absorption coefficient in 1/length, instead of sigma_t."},
         {"sigma_s", ParamKind::Rgb, "0", "Scattering coefficient; must be 0."},
         {"albedo", ParamKind::Rgb, "0.75", "Single-scattering albedo; must be set to 0."},
         {"scale", ParamKind::Float, "1", "Factor on sigma_t."},
         {"sample_emitters", ParamKind::Bool, "", "Accepted; without effect."}}};
    return info;
}

Rgb read_absorption(const Params& p) {
    const float scale = p.number("scale", 1, 0);
    const bool by_absorption = p.has("sigma_a");
    if (by_absorption && p.has("sigma_t"))
        p.fail("sigma_t", "give either \"sigma_a\" and \"sigma_s\", or \"sigma_t\" and \"albedo\"");
    const Rgb scattering = by_absorption ? p.rgb("sigma_s", Rgb(0)) : p.rgb("albedo", Rgb(0.75f));
    if (!scattering.is_zero())
        p.fail(by_absorption ? "sigma_s" : "albedo",
               fmt::format("scattering media are not supported: a homogeneous medium must have "
                           "albedo 0, that is absorption only, but its {} is ({}, {}, {})",
                           by_absorption ? "sigma_s" : "albedo", scattering.r, scattering.g,
                           scattering.b));
    return (by_absorption ? p.rgb("sigma_a", Rgb(0)) : p.rgb("sigma_t", Rgb(1))) * scale;
}

}  // namespace etendue
