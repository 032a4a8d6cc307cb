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

const std::vector<IntegratorAlias>& integrator_aliases() {
    static const std::vector<IntegratorAlias> entries = [] {
        const std::vector<ParamInfo> params = {
            {"max_depth", ParamKind::Int, "-1",
             "Number of edges of the longest paths; -1: no limit."},
            {"rr_depth", ParamKind::Int, "5",
             "Index of the first vertex of a sub-path at which Russian roulette is applied."},
            {"hide_emitters", ParamKind::Bool, "", "Accepted; emitters are never hidden."},
            {"strict_normals", ParamKind::Bool, "false",
             "Whether nothing scatters where the geometric and the shading normal see a direction "
             "on "
             "different sides."},
            {"light_image", ParamKind::Bool, "", "Accepted; splats are always made."},
            {"sample_direct", ParamKind::Bool, "", "Accepted; direct light is always sampled."}};
        std::vector<IntegratorAlias> all;
        const auto add = [&](std::initializer_list<const char*> names, const char* doc,
                             const char* integrator, bool is_substitute = false) {
            for (const char* name : names)
                all.push_back({{"integrator", name, doc, params}, integrator, is_substitute});
        };
        add({"path", "volpath", "volpathmis", "volpath_simple", "prb", "prb_basic", "prbvolpath",
             "prb_projective"},
            "Path tracing.", "path");
        const size_t direct = all.size();
        add({"direct", "direct_projective"}, "Path tracing of at most two edges.", "path");
        for (size_t i = direct; i < all.size(); ++i) {
            all[i].max_depth = 2;
            std::erase_if(all[i].info.params, [](const ParamInfo& p) {
                return p.name == std::string("max_depth") || p.name == std::string("rr_depth");
            });
        }
        add({"ptracer", "light"}, "Light tracing.", "light");
        add({"bdpt"}, "Bidirectional path tracing.", "bdpt");
        add({"photonmapper"}, "Photon mapping.", "pm");
        add({"ppm"}, "Progressive photon mapping.", "ppm");
        add({"sppm"}, "Stochastic progressive photon mapping.", "sppm");
        add({"pssmlt"}, "Metropolis light transport in primary sample space.", "pssmlt");
        add({"mlt"}, "Metropolis light transport.", "mlt");
        all.back().info.params.push_back({"user_paths", ParamKind::String, "",
                                          "JSON file of important light sub-paths; see the "
                                          "integrator mlt."});
        add({"erpt", "vpl", "ao", "field", "depth"}, "Not supported.", "path", true);
        add({"adaptive", "irrcache", "multichannel", "aov", "moment", "stokes"},
            "A wrapper around other integrators.", "");
        return all;
    }();
    return entries;
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
