#include "scene/plain_mitsuba.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "scene/builder.h"
#include "scene/plain_area_lights.h"
#include "scene/plain_bsdfs.h"
#include "scene/plain_emitters.h"
#include "scene/plain_textures.h"

namespace etendue {
namespace {

/// What follows takes parameters by the types that the plug-ins' tables give.
void check_types(const SceneDescription& scene) {
    const std::vector<PluginInfo> plugins = scene_plugins();
    for (size_t i = 0; i < scene.objects.size(); ++i) {
        const SceneObject& o = scene.objects[i];
        const auto info = std::find_if(plugins.begin(), plugins.end(), [&](const PluginInfo& p) {
            return o.category == p.category && o.type == p.name;
        });
        if (info != plugins.end()) check_param_types(scene, int(i), *info);
    }
}

void replace_integrator(PlainScene& s, SceneObject& o) {
    // Mitsuba's path and direct ignore media, and count passing through a mask as a vertex.
    const bool needs_volpath = std::any_of(
        s.original().objects.begin(), s.original().objects.end(), [](const SceneObject& any) {
            return any.category == "medium" ||
                   (any.category == "bsdf" && (any.type == "mask" || any.type == "null"));
        });
    // Wrappers and integrators without an image become their inner one, or path.
    SceneObject inner = o;
    for (const SceneObject* at = &o; at;) {
        inner = *at;
        at = nullptr;
        for (const auto& c : inner.children)
            if (s.object(c.object).category == "integrator") at = &s.object(c.object);
    }
    o.params = inner.params;
    o.children.clear();
    const bool is_direct = inner.type == "direct";
    o.type = needs_volpath ? "volpath" : is_direct ? "direct" : "path";
    std::erase_if(o.params, [&](const Param& p) {
        return p.name != "hide_emitters" &&
               (is_direct || (p.name != "max_depth" && p.name != "rr_depth"));
    });
    if (is_direct && needs_volpath) set(o, "max_depth", int64_t{2});
}

void replace_film(SceneObject& o) {
    o.type = "hdrfilm";
    rename(o, "high_quality_edges", "sample_border");
    // How the image is stored is not part of the scene, and Mitsuba 3 knows fewer formats.
    for (const char* name :
         {"file_format", "pixel_format", "component_format", "banner", "attach_log",
          "tonemap_method", "gamma", "exposure", "key", "burn", "digits", "variable"})
        remove(o, name);
}

void replace_sensor(PlainScene& s, SceneObject& o) {
    double width = 768, height = 576;
    for (const auto& c : o.children)
        if (s.object(c.object).category == "film") {
            width = number(s.object(c.object), "width", width);
            height = number(s.object(c.object), "height", height);
        }
    if (std::fabs(number(o, "aspect", width / height) * height / width - 1) < 1e-3)
        remove(o, "aspect");
    for (const char* name : {"principal_point_offset_x", "principal_point_offset_y"})
        if (number(o, name, 0) == 0) remove(o, name);
}

void replace_medium(PlainScene& s, SceneObject& o) {
    if (has(o, "sigma_a") || has(o, "sigma_s")) {
        const Rgb a = rgb(o, "sigma_a", Rgb(0)), b = rgb(o, "sigma_s", Rgb(0)), t = a + b;
        const auto share = [](float x, float of) { return of > 0 ? x / of : 0; };
        remove(o, "sigma_a"), remove(o, "sigma_s");
        set(o, "sigma_t", t);
        set(o, "albedo", Rgb(share(b.r, t.r), share(b.g, t.g), share(b.b, t.b)));
    }
    // Mitsuba 3 takes colours of at most 1.
    if (const Rgb t = rgb(o, "sigma_t", Rgb(0)); t.max() > 1) {
        set(o, "sigma_t", t * (1 / t.max()));
        set(o, "scale", number(o, "scale", 1) * double(t.max()));
    }
    if (o.find("material") && !o.find("sigma_t"))
        s.warn(o, "Mitsuba 3 has no named media: the material is left out");
    remove(o, "material");
}

void replace(PlainScene& s, int index) {
    SceneObject& o = s.object(index);
    if (o.category == "integrator") replace_integrator(s, o);
    if (o.category == "film") replace_film(o);
    // Meshes are the same with and without them.
    if (o.category == "shape") remove(o, "collapse"), remove(o, "max_smooth_angle");
    if (o.category == "sampler") o.type = "independent";
    if (o.category == "rfilter" && o.type == "mitchell") rename(o, "b", "B"), rename(o, "c", "C");
    if (o.category == "sensor") replace_sensor(s, o);
    if (o.category == "medium") replace_medium(s, o);
    if (o.type == "mesh_attribute" && !o.find("name")) set(o, "name", std::string("vertex_color"));
    // These may add objects, which moves `o`.
    if (o.category == "emitter")
        replace_emitter(s, index);
    else if (o.category == "bsdf")
        replace_bsdf(s, index);
}

/// Whether one of Mitsuba 3's documented parameters has this name.
bool documents(const ManualEntry& entry, const std::string& param) {
    const std::string all = fmt::format(" {} {} ", entry.params, entry.params_3);
    return all.find(" " + param + " ") != all.npos;
}

/// Removes what Mitsuba 3 still does not have.
void strip(PlainScene& s, int index) {
    SceneObject& o = s.object(index);
    if (o.category == "shape" || o.category == "texture" || o.type == "principledthin") return;
    const ManualEntry* entry = entry_of_mitsuba_3(o);
    if (!entry) {
        if (o.category == "bsdf") {
            s.stand_in(o, "diffuse");
            o.params.clear(), o.children.clear();
        }
        return;
    }
    std::erase_if(o.params, [&](const Param& p) {
        if (p.name == "image" || documents(*entry, p.name)) return false;
        const ManualNote* note = find_manual_note(o.category, o.type, p.name);
        if ((!note || !note->is_accepted) && !s.is_stand_in(index))
            s.warn(o, fmt::format("Mitsuba 3 has no parameter \"{}\" of {} \"{}\": left out",
                                  p.name, o.category, o.type));
        return true;
    });
    std::erase_if(o.children, [&](const SceneObject::Child& c) {
        if (s.object(c.object).category != "texture" || c.name.empty() ||
            documents(*entry, c.name) || is_relief(o))
            return false;
        if (!s.is_stand_in(index))
            s.warn(o, fmt::format("Mitsuba 3 has no parameter \"{}\" of {} \"{}\": left out",
                                  c.name, o.category, o.type));
        return true;
    });
}

}  // namespace

std::vector<std::string> make_plain_mitsuba(SceneDescription& scene) {
    check_types(scene);
    std::vector<std::string> warnings = make_plain_area_lights(scene);
    PlainScene s(scene);
    PlainTextures textures(s);
    // Objects that are added on the way are plain.
    const int count = int(scene.objects.size());
    for (int i = 0; i < count; ++i) textures.replace(i);
    for (int i = 0; i < count; ++i) textures.unwrap_relief(i);
    for (int i = 0; i < count; ++i) report_masked_emission(s, i);
    for (int i = 0; i < count; ++i) replace(s, i);
    for (int i = 0; i < int(scene.objects.size()); ++i) hoist_masks(s, i);
    for (int i = 0; i < count; ++i) strip(s, i);
    keep_one_environment(s);
    for (std::string& w : s.take_warnings()) warnings.push_back(std::move(w));
    return warnings;
}

}  // namespace etendue
