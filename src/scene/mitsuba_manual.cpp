#include "scene/mitsuba_manual.h"

#include <algorithm>
#include <cctype>
#include <optional>

#include <fmt/format.h>

#include "scene/settings.h"

namespace etendue {
namespace {

constexpr bool kAccepted = true, kRefused = false;

constexpr const char* kSpectral = "polarised or spectral light is not simulated";
constexpr const char* kInside = "scattering below the surface is not supported";
constexpr const char* kClip = "all distances are rendered";

const ManualNote kSamplingWeight = {"sampling_weight", kAccepted,
                                    "emitters are chosen by their power"};
const ManualNote kSmoothAngle = {"max_smooth_angle", kAccepted,
                                 "normals are those of the file, or smooth everywhere"};
const ManualNote kSpectralResponse = {"srf", kRefused, kSpectral};

constexpr const char* kPlacement = "to_world flip_normals";
constexpr const char* kMeshFile = "filename face_normals flip_normals to_world";
constexpr const char* kDaylight = "turbidity albedo year month day hour minute second latitude "
                                  "longitude timezone sun_direction";
constexpr const char* kCrop = "width height crop_offset_x crop_offset_y crop_width crop_height "
                              "file_format pixel_format rfilter";
constexpr const char* kPathDepths = "max_depth rr_depth";

std::vector<std::string> words(std::string_view list) {
    std::vector<std::string> found;
    for (size_t begin = 0; begin < list.size();) {
        const size_t end = std::min(list.find(' ', begin), list.size());
        if (end > begin) found.emplace_back(list.substr(begin, end - begin));
        begin = end + 1;
    }
    return found;
}

std::vector<ManualEntry> shapes() {
    constexpr const char* kCurve = "curves are not supported";
    return {
        {"shape", "cube", kBothManuals, kPlacement},
        {"shape", "sphere", kBothManuals, "center radius to_world flip_normals"},
        {"shape", "cylinder", kBothManuals, "p0 p1 radius to_world flip_normals"},
        {"shape", "rectangle", kBothManuals, kPlacement},
        {"shape", "disk", kBothManuals, kPlacement},
        {"shape",
         "obj",
         kBothManuals,
         kMeshFile,
         "max_smooth_angle flip_tex_coords collapse",
         "flip_tex_coords",
         {kSmoothAngle}},
        {"shape",
         "ply",
         kBothManuals,
         kMeshFile,
         "max_smooth_angle srgb",
         "flip_tex_coords",
         {kSmoothAngle}},
        {"shape",
         "serialized",
         kBothManuals,
         "filename face_normals flip_normals to_world shape_index",
         "max_smooth_angle",
         "",
         {kSmoothAngle}},
        {"shape", "shapegroup", kBothManuals, ""},
        {"shape", "instance", kBothManuals, "to_world"},
        {"shape", "merge", kMitsuba3, ""},
        {"shape", "hair", kMitsuba06, "", "", "", {}, kCurve},
        {"shape",
         "heightfield",
         kMitsuba06,
         "",
         "",
         "",
         {},
         "height fields are not supported: use a mesh"},
        {"shape", "bsplinecurve", kMitsuba3, "", "", "", {}, kCurve},
        {"shape", "linearcurve", kMitsuba3, "", "", "", {}, kCurve},
        {"shape", "sdfgrid", kMitsuba3, "", "", "", {}, "signed distance fields are not supported"},
        {"shape", "ellipsoids", kMitsuba3, "", "", "", {}, "radiance fields are not supported"},
        {"shape", "ellipsoidsmesh", kMitsuba3, "", "", "", {}, "radiance fields are not supported"},
    };
}

std::vector<ManualEntry> bsdfs() {
    constexpr const char* kIors = "int_ior ext_ior specular_reflectance specular_transmittance";
    constexpr const char* kMetal = "material eta k specular_reflectance";
    constexpr const char* kCoat =
        "int_ior ext_ior specular_reflectance diffuse_reflectance nonlinear";
    const ManualNote kViewDependent = {
        "flip_invalid_normals use_shadowing_function", kAccepted,
        "must be false where given: they depend on which direction is that of the view"};
    constexpr const char* kLayer =
        "a layer over another material has no closed form; with --lenient, the nested material is "
        "used";
    return {
        {"bsdf", "diffuse", kBothManuals, "reflectance", "diffuse_reflectance"},
        {"bsdf",
         "roughdiffuse",
         kMitsuba06,
         "reflectance alpha use_fast_approx",
         "diffuse_reflectance",
         "",
         {{"use_fast_approx", kAccepted, "the fast approximation is always used"}},
         nullptr,
         "orennayar"},
        {"bsdf", "dielectric", kBothManuals, kIors},
        {"bsdf", "thindielectric", kBothManuals, kIors},
        {"bsdf", "roughdielectric", kBothManuals,
         "int_ior ext_ior specular_reflectance specular_transmittance distribution alpha alpha_u "
         "alpha_v sample_visible"},
        {"bsdf", "conductor", kBothManuals, kMetal, "ext_eta"},
        {"bsdf", "roughconductor", kBothManuals,
         "material eta k specular_reflectance distribution alpha alpha_u alpha_v sample_visible",
         "ext_eta"},
        {"bsdf", "plastic", kBothManuals, kCoat},
        {"bsdf", "roughplastic", kBothManuals,
         "int_ior ext_ior specular_reflectance diffuse_reflectance nonlinear distribution alpha "
         "sample_visible"},
        {"bsdf", "phong", kMitsuba06, "exponent specular_reflectance diffuse_reflectance"},
        {"bsdf",
         "principled",
         kMitsuba3,
         "base_color roughness anisotropic metallic spec_trans eta specular spec_tint sheen "
         "sheen_tint flatness clearcoat clearcoat_gloss diffuse_reflectance_sampling_rate "
         "main_specular_sampling_rate clearcoat_sampling_rate",
         "",
         "",
         {{"diffuse_reflectance_sampling_rate main_specular_sampling_rate clearcoat_sampling_rate "
           "diffuse_sampling main_specular_sampling clearcoat_sampling",
           kAccepted, "lobes are sampled in proportion to their strengths"}}},
        {"bsdf", "twosided", kBothManuals, ""},
        {"bsdf", "mask", kBothManuals, "opacity"},
        {"bsdf", "blendbsdf", kBothManuals, "weight"},
        {"bsdf", "mixturebsdf", kMitsuba06, "weights", "ensure_energy_conservation"},
        {"bsdf", "bump", kMitsuba06, "", "", "", {}, nullptr, "bumpmap"},
        {"bsdf",
         "bumpmap",
         kMitsuba3,
         "scale flip_invalid_normals use_shadowing_function",
         "",
         "",
         {kViewDependent}},
        {"bsdf",
         "normalmap",
         kMitsuba3,
         "normalmap flip_invalid_normals use_shadowing_function",
         "",
         "",
         {kViewDependent}},
        {"bsdf",
         "difftrans",
         kMitsuba06,
         "transmittance",
         "",
         "",
         {},
         nullptr,
         "diffusetransmission"},
        {"bsdf", "null", kBothManuals, ""},
        {"bsdf", "coating", kMitsuba06, "", "", "", {}, kLayer},
        {"bsdf", "roughcoating", kMitsuba06, "", "", "", {}, kLayer},
        {"bsdf", "ward", kMitsuba06, "", "", "", {}, "use roughconductor or roughplastic"},
        {"bsdf", "hk", kMitsuba06, "", "", "", {}, kInside},
        {"bsdf", "irawan", kMitsuba06, "", "", "", {}, "woven cloth is not supported"},
        {"bsdf",
         "principledthin",
         kMitsuba3,
         "",
         "",
         "",
         {},
         "thin principled surfaces are not supported"},
        {"bsdf", "hair", kMitsuba3, "", "", "", {}, "hair is not supported"},
        {"bsdf", "measured", kMitsuba3, "", "", "", {}, "measured materials are not supported"},
        {"bsdf", "measured_polarized", kMitsuba3, "", "", "", {}, kSpectral},
        {"bsdf", "pplastic", kMitsuba3, "", "", "", {}, kSpectral},
        {"bsdf", "polarizer", kMitsuba3, "", "", "", {}, kSpectral},
        {"bsdf", "retarder", kMitsuba3, "", "", "", {}, kSpectral},
        {"bsdf", "circular", kMitsuba3, "", "", "", {}, kSpectral},
        {"subsurface", "dipole", kMitsuba06, "", "", "", {}, kInside},
    };
}

std::vector<ManualEntry> textures() {
    return {
        {"texture",
         "bitmap",
         kBothManuals,
         "filename filter_type wrap_mode to_uv",
         "wrap_mode_u wrap_mode_v gamma channel cache max_anisotropy",
         "raw bitmap data format",
         {{"wrap_mode_u", kAccepted, "becomes wrap_mode"},
          {"gamma", kRefused, "must be 1 (linear) or -1 (sRGB)"},
          {"cache max_anisotropy", kAccepted, "images are kept in memory and not filtered"},
          {"format", kAccepted, "images are stored as they are in the file"},
          {"bitmap data", kRefused, "images must be files"}}},
        {"texture", "checkerboard", kBothManuals, "color0 color1 to_uv"},
        {"texture", "gridtexture", kMitsuba06, "color0 color1 line_width to_uv"},
        {"texture", "scale", kMitsuba06, "scale"},
        {"texture", "vertexcolors", kMitsuba06, "", "", "", {}, nullptr, "mesh_attribute"},
        {"texture", "mesh_attribute", kMitsuba3, "name scale"},
        {"texture", "wireframe", kMitsuba06, "", "", "", {}, "wire frames are not supported"},
        {"texture", "curvature", kMitsuba06, "", "", "", {}, "curvature is not computed"},
        {"texture", "volume", kMitsuba3, "", "", "", {}, "volume data are not supported"},
    };
}

std::vector<ManualEntry> emitters() {
    constexpr const char* kWeight = "sampling_weight";
    return {
        {"emitter", "area", kBothManuals, "radiance", kWeight, "", {kSamplingWeight}},
        {"emitter",
         "point",
         kBothManuals,
         "intensity position to_world",
         kWeight,
         "",
         {kSamplingWeight}},
        {"emitter",
         "spot",
         kBothManuals,
         "intensity cutoff_angle beam_width to_world texture",
         kWeight,
         "",
         {kSamplingWeight}},
        {"emitter",
         "directional",
         kBothManuals,
         "irradiance direction to_world",
         kWeight,
         "",
         {kSamplingWeight}},
        {"emitter", "constant", kBothManuals, "radiance", kWeight, "", {kSamplingWeight}},
        {"emitter",
         "envmap",
         kBothManuals,
         "filename scale to_world",
         "gamma cache sampling_weight",
         "bitmap mis_compensation",
         {kSamplingWeight,
          {"gamma", kRefused, "the image must have linear colours"},
          {"cache", kAccepted, "the image is kept in memory"},
          {"bitmap", kRefused, "images must be files"}}},
        {"emitter",
         "sky",
         kMitsuba06,
         kDaylight,
         "stretch resolution scale sampling_weight to_world",
         "",
         {kSamplingWeight, {"stretch", kRefused, "the sky is always a hemisphere"}}},
        {"emitter",
         "sun",
         kMitsuba06,
         "turbidity year month day hour minute second latitude longitude timezone sun_direction "
         "resolution scale sun_radius_scale",
         kWeight,
         "",
         {kSamplingWeight}},
        {"emitter",
         "sunsky",
         kBothManuals,
         kDaylight,
         "stretch resolution sky_scale sun_scale sun_radius_scale sampling_weight",
         "sky_scale sun_scale sun_aperture complex_sun to_world",
         {kSamplingWeight, {"stretch", kRefused, "the sky is always a hemisphere"}}},
        {"emitter",
         "collimated",
         kMitsuba06,
         "",
         "",
         "",
         {},
         "no path can hit a beam of zero width"},
        {"emitter", "projector", kMitsuba3, "irradiance scale to_world fov fov_axis focal_length"},
        {"emitter",
         "directionalarea",
         kMitsuba3,
         "",
         "",
         "",
         {},
         "surfaces that emit in one direction are not supported"},
        {"emitter",
         "timed_sunsky",
         kMitsuba3,
         "",
         "",
         "",
         {},
         "daylight averaged over time is not supported"},
    };
}

std::vector<ManualEntry> sensors() {
    constexpr const char* kMeter = "only cameras are supported";
    constexpr const char* kShutter = "shutter_open shutter_close";
    const ManualNote kNoLens = {"focus_distance", kAccepted,
                                "without a lens everything is in focus"};
    const ManualNote kNoClip = {"near_clip far_clip", kAccepted, kClip};
    const ManualNote kNoShutter = {kShutter, kAccepted, "nothing moves"};
    return {
        {"sensor",
         "perspective",
         kBothManuals,
         "to_world fov fov_axis focal_length near_clip far_clip focus_distance",
         kShutter,
         "principal_point_offset_x principal_point_offset_y srf",
         {kSpectralResponse, kNoLens}},
        {"sensor",
         "thinlens",
         kBothManuals,
         "to_world fov fov_axis focal_length near_clip far_clip aperture_radius focus_distance",
         kShutter,
         "srf",
         {kSpectralResponse}},
        {"sensor",
         "orthographic",
         kBothManuals,
         "to_world near_clip far_clip focus_distance",
         kShutter,
         "srf",
         {kSpectralResponse, kNoShutter, kNoClip, kNoLens}},
        {"sensor", "batch", kMitsuba3, "srf", "", "", {kSpectralResponse}},
        {"sensor",
         "telecentric",
         kMitsuba06,
         "",
         "",
         "",
         {},
         "telecentric lenses are not supported"},
        {"sensor", "spherical", kMitsuba06, "", "", "", {}, "spherical cameras are not supported"},
        {"sensor",
         "perspective_rdist",
         kMitsuba06,
         "",
         "",
         "",
         {},
         "lens distortion is not supported"},
        {"sensor", "irradiancemeter", kBothManuals, "", "", "", {}, kMeter},
        {"sensor", "radiancemeter", kBothManuals, "", "", "", {}, kMeter},
        {"sensor", "fluencemeter", kMitsuba06, "", "", "", {}, kMeter},
        {"sensor", "distant", kMitsuba3, "", "", "", {}, kMeter},
    };
}

std::vector<ManualEntry> films_and_samplers() {
    std::vector<ManualEntry> all = {
        {"film", "hdrfilm", kBothManuals, kCrop,
         "component_format attach_log banner high_quality_edges",
         "component_format sample_border compensate"},
        {"film", "tiledhdrfilm", kMitsuba06, kCrop, "component_format banner high_quality_edges"},
        {"film",
         "ldrfilm",
         kMitsuba06,
         kCrop,
         "tonemap_method gamma exposure key burn banner high_quality_edges",
         "",
         {{"key burn", kAccepted, "the output is linear"}}},
        {"film",
         "mfilm",
         kMitsuba06,
         kCrop,
         "digits variable high_quality_edges",
         "",
         {{"digits variable", kAccepted, "the name of the output selects the format"}}},
        {"film", "specfilm", kMitsuba3, "", "", "", {}, kSpectral},
        {"rfilter", "box", kBothManuals, ""},
        {"rfilter", "tent", kBothManuals, "radius"},
        {"rfilter", "gaussian", kBothManuals, "stddev"},
        {"rfilter", "mitchell", kBothManuals, "B C"},
        {"rfilter", "catmullrom", kBothManuals, ""},
        {"rfilter", "lanczos", kBothManuals, "lobes"},
        {"sampler", "independent", kBothManuals, "sample_count", "", "seed"},
        {"sampler", "stratified", kBothManuals, "sample_count", "dimension", "seed jitter"},
        {"sampler", "ldsampler", kBothManuals, "sample_count", "dimension", "seed"},
        {"sampler", "multijitter", kMitsuba3, "sample_count seed jitter"},
        {"sampler",
         "orthogonal",
         kMitsuba3,
         "sample_count strength seed jitter",
         "",
         "",
         {{"strength", kAccepted, "the points are those of --sampler"}}},
        {"sampler", "halton", kMitsuba06, "sample_count scramble"},
        {"sampler", "hammersley", kMitsuba06, "sample_count scramble"},
        {"sampler", "sobol", kMitsuba06, "sample_count scramble"},
    };
    return all;
}

std::vector<ManualEntry> media() {
    constexpr const char* kScatters = "scattering media are not supported; with --lenient, vacuum "
                                      "is used";
    return {
        {"medium",
         "homogeneous",
         kBothManuals,
         "sigma_t albedo scale",
         "material sigma_a sigma_s phase",
         "sample_emitters phase",
         {{"material", kRefused, kScatters}, {"phase", kAccepted, "media do not scatter"}}},
        {"medium", "heterogeneous", kBothManuals, "", "", "", {}, kScatters},
    };
}

/// What becomes of their parameters is in integrator_aliases(), except where they are not rendered themselves.
std::vector<ManualEntry> integrators() {
    constexpr const char* kShared = "max_depth rr_depth hide_emitters";
    constexpr const char* kGradients = "reparam_max_depth sppc sppp sppi guiding guiding_proj "
                                       "guiding_rounds antithetic_sampling emitter_samples";
    constexpr const char* kProgressive =
        "max_depth rr_depth photon_count initial_radius alpha granularity max_passes";
    constexpr const char* kMutations = "bidirectional_mutation lens_perturbation "
                                       "caustic_perturbation multi_chain_perturbation "
                                       "manifold_perturbation lambda";
    static const std::string gradients_of_paths = std::string(kPathDepths) + " " + kGradients,
                             mlt = std::string("max_depth direct_samples luminance_samples "
                                               "two_stage ") +
                                   kMutations,
                             erpt = std::string("max_depth rr_depth num_chains max_chains "
                                                "chain_length direct_samples ") +
                                    kMutations;
    const auto of_wrapper = [](const char* names) {
        return ManualNote{names, kAccepted, "the integrator in it is rendered"};
    };
    constexpr const char* kCache = "resolution quality gradients clamp_neighbor clamp_screen "
                                   "overture quality_adjustment indirect_only debug";
    return {
        {"integrator", "path", kBothManuals, kShared, "strict_normals"},
        {"integrator", "volpath", kBothManuals, kShared, "strict_normals"},
        {"integrator", "volpathmis", kMitsuba3,
         "max_depth rr_depth hide_emitters use_spectral_mis"},
        {"integrator", "volpath_simple", kMitsuba06,
         "max_depth rr_depth hide_emitters strict_normals"},
        {"integrator", "direct", kBothManuals,
         "shading_samples emitter_samples bsdf_samples hide_emitters", "strict_normals"},
        {"integrator", "bdpt", kMitsuba06, "max_depth rr_depth light_image sample_direct"},
        {"integrator", "ptracer", kBothManuals, kPathDepths, "granularity brute_force",
         "hide_emitters samples_per_pass"},
        {"integrator", "photonmapper", kMitsuba06,
         "max_depth rr_depth hide_emitters direct_samples glossy_samples global_photons "
         "caustic_photons volume_photons global_lookup_radius caustic_lookup_radius lookup_size "
         "granularity"},
        {"integrator", "ppm", kMitsuba06, kProgressive},
        {"integrator", "sppm", kMitsuba06, kProgressive},
        {"integrator", "pssmlt", kMitsuba06,
         "max_depth rr_depth bidirectional direct_samples luminance_samples two_stage p_large"},
        {"integrator", "mlt", kMitsuba06, mlt.c_str()},
        {"integrator", "erpt", kMitsuba06, erpt.c_str()},
        {"integrator", "vpl", kMitsuba06, "max_depth clamping shadow_map_resolution"},
        {"integrator", "prb", kMitsuba3, kPathDepths},
        {"integrator", "prb_basic", kMitsuba3, kPathDepths},
        {"integrator", "prbvolpath", kMitsuba3, "max_depth rr_depth hide_emitters"},
        {"integrator", "direct_projective", kMitsuba3, kGradients},
        {"integrator", "prb_projective", kMitsuba3, gradients_of_paths.c_str()},
        {"integrator",
         "adaptive",
         kMitsuba06,
         "max_error p_value max_sample_factor",
         "",
         "",
         {of_wrapper("max_error p_value max_sample_factor")}},
        {"integrator", "irrcache", kMitsuba06, kCache, "", "", {of_wrapper(kCache)}},
        {"integrator", "multichannel", kMitsuba06, ""},
        {"integrator", "aov", kMitsuba3, "aovs", "", "", {{"aovs", kAccepted, "use --aov"}}},
        {"integrator", "moment", kMitsuba3, ""},
        {"integrator", "stokes", kMitsuba3, ""},
        {"integrator", "ao", kMitsuba06, "shading_samples ray_length"},
        {"integrator", "field", kMitsuba06, "field undefined"},
        {"integrator", "depth", kMitsuba3, ""},
    };
}

/// "to_world" → "toWorld", as the manual of Mitsuba 0.6 spells it.
std::string camel_case(std::string_view snake) {
    if (snake == "int_ior") return "intIOR";
    if (snake == "ext_ior") return "extIOR";
    if (snake == "to_uv") return "uscale, vscale, uoffset, voffset";
    std::string camel;
    for (size_t i = 0; i < snake.size(); ++i) {
        if (snake[i] == '_' && i + 1 < snake.size() &&
            std::isalpha(static_cast<unsigned char>(snake[i + 1])))
            camel += char(std::toupper(static_cast<unsigned char>(snake[++i])));
        else
            camel += snake[i];
    }
    return camel;
}

std::string code(const std::string& text) {
    return "`" + text + "`";
}

const PluginInfo* find_plugin(const std::vector<PluginInfo>& plugins, std::string_view category,
                              std::string_view name) {
    const auto it = std::find_if(plugins.begin(), plugins.end(), [&](const PluginInfo& p) {
        return p.category == category && p.name == name;
    });
    return it == plugins.end() ? nullptr : &*it;
}

/// What the documentation of a parameter says of its support.
std::string status_of_doc(std::string_view doc) {
    const auto after = [&](std::string_view words) -> std::optional<std::string> {
        if (!doc.starts_with(words)) return {};
        return std::string(doc.substr(words.size(), doc.size() - words.size() - 1));
    };
    if (const auto why = after("Accepted; ")) return "accepted: " + *why;
    if (const auto why = after("Refused if true: ")) return "refused if true: " + *why;
    if (doc == "Ignored, with a warning.") return "ignored, with a warning";
    if (const auto what = after("Becomes ")) return "becomes " + *what;
    if (const auto what = after("Always ")) return "always " + *what;
    return "supported";
}

/// What etendue does with a parameter.
std::string param_status(const ManualEntry& entry, const PluginInfo* plugin,
                         const std::string& param) {
    if (plugin)
        for (const ParamInfo& p : plugin->params)
            if (p.name == param) return status_of_doc(p.doc);
    const ManualNote* note = find_manual_note(entry.category, entry.name, param);
    if (!note) return "supported";
    return fmt::format("{}: {}", note->is_accepted ? "accepted" : "refused", note->text);
}

/// What etendue does with a plug-in.
std::string plugin_status(const ManualEntry& e) {
    if (e.refused) return fmt::format("refused: {}", e.refused);
    if (e.replacement) return fmt::format("becomes `{}`", e.replacement);
    const IntegratorAlias* alias =
        std::string_view(e.category) == "integrator" ? find_integrator_alias(e.name) : nullptr;
    if (!alias) return "supported";
    if (!*alias->integrator) return "replaced by the integrator in it, with a warning";
    if (alias->is_substitute)
        return fmt::format("replaced by `{}`, with a warning", alias->integrator);
    const std::string_view doc = alias->info.doc;
    if (doc.find("derivatives are not computed") != doc.npos)
        return fmt::format("rendered by `{}`: derivatives are not computed", alias->integrator);
    return std::string_view(alias->integrator) == e.name
               ? "supported"
               : fmt::format("rendered by `{}`", alias->integrator);
}

}  // namespace

const std::vector<ManualEntry>& mitsuba_manual() {
    static const std::vector<ManualEntry> entries = [] {
        std::vector<ManualEntry> all;
        for (const auto& part : {shapes(), bsdfs(), textures(), emitters(), media(), sensors(),
                                 films_and_samplers(), integrators()})
            all.insert(all.end(), part.begin(), part.end());
        return all;
    }();
    return entries;
}

const ManualEntry* find_manual_entry(std::string_view category, std::string_view name) {
    const auto& all = mitsuba_manual();
    const auto it = std::find_if(all.begin(), all.end(), [&](const ManualEntry& e) {
        return e.category == category && e.name == name;
    });
    return it == all.end() ? nullptr : &*it;
}

const ManualNote* find_manual_note(std::string_view category, std::string_view plugin,
                                   std::string_view param) {
    const ManualEntry* entry = find_manual_entry(category, plugin);
    if (!entry) return nullptr;
    for (const ManualNote& note : entry->notes)
        for (const std::string& name : words(note.names))
            if (name == param) return &note;
    return nullptr;
}

std::string mitsuba_manual_table(const std::vector<PluginInfo>& plugins) {
    std::string out;
    std::string_view category;
    for (const ManualEntry& e : mitsuba_manual()) {
        if (e.category != category) {
            category = e.category;
            out += fmt::format("{}## {}\n\n| 0.6 | 3 | etendue |\n| --- | --- | --- |\n",
                               out.empty() ? "" : "\n", category);
        }
        const bool in_06 = e.manuals & kMitsuba06, in_3 = e.manuals & kMitsuba3;
        const std::string name = fmt::format("**`{}`**", e.name);
        out += fmt::format("| {} | {} | {} |\n", in_06 ? name : "", in_3 ? name : "",
                           plugin_status(e));
        if (e.refused) continue;
        const PluginInfo* plugin =
            find_plugin(plugins, e.category, e.replacement ? e.replacement : e.name);
        std::vector<std::string> params;
        std::vector<int> manuals;
        const auto add = [&](const char* names, int in) {
            for (const std::string& p : words(names)) {
                const auto known = std::find(params.begin(), params.end(), p);
                if (known != params.end()) {
                    manuals[size_t(known - params.begin())] |= in;
                } else {
                    params.push_back(p);
                    manuals.push_back(in);
                }
            }
        };
        add(e.params, e.manuals);
        add(e.params_06, kMitsuba06);
        add(e.params_3, kMitsuba3);
        for (size_t i = 0; i < params.size(); ++i)
            out += fmt::format(
                "| {} | {} | {} |\n", manuals[i] & kMitsuba06 ? code(camel_case(params[i])) : "",
                manuals[i] & kMitsuba3 ? code(params[i]) : "", param_status(e, plugin, params[i]));
    }
    return out;
}

}  // namespace etendue
