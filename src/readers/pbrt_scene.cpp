#include "readers/pbrt_scene.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "description/resolve_file.h"
#include "readers/file_bytes.h"
#include "readers/mitsuba_values.h"
#include "readers/pbrt_spectrum.h"

namespace etendue {
namespace {

std::vector<std::string> names_of(const std::map<std::string, int>& map) {
    std::vector<std::string> names;
    for (const auto& [name, object] : map) names.push_back(name);
    return names;
}

Rgb clamp_albedo(Rgb c) {
    return {clamp(c.r, 0, 1), clamp(c.g, 0, 1), clamp(c.b, 0, 1)};
}

}  // namespace

PbrtScene::PbrtScene(const std::string& file, const ReadOptions& options) : options(options) {
    description.file = file;
    description.search_paths.push_back(directory_of(file));
}

int PbrtScene::add(const char* category, const char* type, SourceLocation where) {
    description.objects.push_back({.category = category,
                                   .type = type,
                                   .id = {},
                                   .where = std::move(where),
                                   .params = {},
                                   .children = {}});
    return int(description.objects.size()) - 1;
}

void PbrtScene::set(int object, const char* name, ParamValue value) {
    SceneObject& o = description.objects[size_t(object)];
    o.params.push_back({name, std::move(value), o.where});
}

void PbrtScene::add_child(int parent, const char* name, int object) {
    SceneObject& o = description.objects[size_t(parent)];
    o.children.push_back({name, object, o.where});
}

Rgb PbrtScene::colour(const PbrtArguments& args, std::string_view name, Rgb fallback,
                      PbrtSpectrum kind) const {
    const PbrtValue* v = args.find(name);
    if (!v) return fallback;
    if (v->type == PbrtType::Float) return Rgb(args.number(name, 0));
    return pbrt_colour(*v, kind, *this);
}

int PbrtScene::texture(const PbrtArguments& args, std::string_view name, bool is_float) const {
    const PbrtValue* v = args.find(name);
    if (!v || v->type != PbrtType::Texture) return -1;
    const auto& textures = is_float ? float_textures : spectrum_textures;
    const std::string id = args.text(name, "");
    if (const auto it = textures.find(id); it != textures.end()) return it->second;
    const auto& others = is_float ? spectrum_textures : float_textures;
    throw SceneError(
        v->where,
        fmt::format("there is no {} texture {}{}", is_float ? "float" : "spectrum", quote(id),
                    others.contains(id)
                        ? fmt::format(", only one of the type {}", is_float ? "spectrum" : "float")
                        : hint(id, names_of(textures))));
}

bool PbrtScene::is_float(const PbrtArguments& args, std::string_view name) const {
    const PbrtValue* v = args.find(name);
    if (!v || v->type != PbrtType::Texture) return v && v->type == PbrtType::Float;
    const std::string id = args.text(name, "");
    return float_textures.contains(id) || !spectrum_textures.contains(id);
}

std::optional<Rgb> PbrtScene::constant(const PbrtArguments& args, std::string_view name,
                                       Rgb fallback, PbrtSpectrum kind) const {
    if (const int t = texture(args, name, false); t >= 0) {
        if (object(t).type != "constant") return {};
        return std::get<Rgb>(object(t).find("value")->value);
    }
    return colour(args, name, fallback, kind);
}

std::optional<float> PbrtScene::constant(const PbrtArguments& args, std::string_view name,
                                         float fallback) const {
    if (const int t = texture(args, name, true); t >= 0) {
        if (object(t).type != "constant") return {};
        return std::get<Rgb>(object(t).find("value")->value).r;
    }
    return args.number(name, fallback);
}

void PbrtScene::bind(int object, const char* to, const PbrtArguments& args, const char* name,
                     Rgb fallback, PbrtSpectrum kind) {
    if (const auto c = constant(args, name, fallback, kind))
        set(object, to, kind == PbrtSpectrum::Albedo ? clamp_albedo(*c) : *c);
    else
        add_child(object, to, texture(args, name, false));
}

void PbrtScene::bind_float(int object, const char* to, const PbrtArguments& args, const char* name,
                           float fallback) {
    if (const auto x = constant(args, name, fallback))
        set(object, to, Rgb(*x));
    else
        add_child(object, to, texture(args, name, true));
}

std::string PbrtScene::load(const std::string& name, const SourceLocation& where,
                            std::string& path) const {
    const std::string& folder = description.search_paths[0];
    for (const std::string& spelling : spellings(name)) {
        path = folder == "." || std::filesystem::path(spelling).is_absolute()
                   ? spelling
                   : (std::filesystem::path(folder) / spelling).string();
        if (auto contents = read_named_file(options, path, where)) return *std::move(contents);
    }
    throw SceneError(where, fmt::format("cannot read the file {}{}", quote(path),
                                        options.is_disk ? near_file_hint(name, {folder}) : ""));
}

void PbrtScene::reject(const SourceLocation& where, const std::string& what,
                       const std::string& more) {
    if (!options.lenient) throw SceneError(where, what + more);
    ++description.left_out;
    warn(where, what + "; dropped");
}

void PbrtScene::refuse(const SourceLocation& where, const std::string& what,
                       const std::string& stand_in) {
    if (!options.lenient) throw SceneError(where, what);
    ++description.left_out;
    warn(where, what + "; " + stand_in + " instead");
}

void PbrtScene::warn(const SourceLocation& where, const std::string& message) {
    description.warnings.push_back(SceneError(where, message).what());
}

int PbrtScene::named_material(const std::string& name, const SourceLocation& where) const {
    const auto it = named_materials.find(name);
    if (it == named_materials.end())
        throw SceneError(where, fmt::format("there is no named material {}{}", quote(name),
                                            hint(name, names_of(named_materials))));
    return it->second;
}

int PbrtScene::current_material() {
    if (!state.named_material.empty())
        return named_material(state.named_material.str(), state.material_where);
    if (state.material >= 0) return state.material;
    if (default_material_ < 0) {
        const int diffuse = add("bsdf", "diffuse", {});
        set(diffuse, "reflectance", Rgb(0.5f));
        default_material_ = add("bsdf", "twosided", {});
        add_child(default_material_, "", diffuse);
    }
    return default_material_;
}

void PbrtScene::place_shape(int shape, const PbrtArguments& args) {
    int material = current_material();
    const bool is_interface = object(material).type == "null";
    const int alpha = texture(args, "alpha", true);
    const std::optional<float> constant_alpha = constant(args, "alpha", 1.0f);
    if (args.has("shadowalpha") && (texture(args, "shadowalpha", true) != alpha ||
                                    constant(args, "shadowalpha", 1.0f) != constant_alpha))
        warn(args.find("shadowalpha")->where,
             "parameter \"shadowalpha\" has no effect: shadows are those of \"alpha\"");
    // In pbrt a light with the constant alpha 0 shines, though no ray meets it.
    const bool is_invisible_light = state.area_light && constant_alpha && *constant_alpha == 0;
    if (is_invisible_light)
        refuse(args.find("alpha")->where,
               "an area light that no ray meets (alpha 0) is not supported", "a visible one");
    if (!is_interface && !is_invisible_light && (!constant_alpha || *constant_alpha < 1)) {
        // Shapes with the same material and alpha share their mask.
        int& masked = masked_.try_emplace({material, alpha}, -1).first->second;
        if (masked < 0 || alpha < 0) {
            masked = add("bsdf", "mask", args.where());
            bind_float(masked, "opacity", args, "alpha", 1);
            add_child(masked, "", material);
        }
        material = masked;
    }
    add_child(shape, "", material);

    if (state.area_light && is_interface)
        warn(args.where(), "a shape without a material (\"interface\") does not shine, as in pbrt");
    else if (state.area_light && group >= 0)
        warn(args.where(), "a shape of an object does not shine, as in pbrt");
    else if (state.area_light) {
        const std::vector<PbrtEntry>& entries = pbrt_area_lights();
        add_child(shape, "", entries[0].make(*this, *state.area_light));
    }
    if (state.inside.str() != state.outside.str())
        for (const auto& [name, medium] : {std::pair("interior", state.inside.str()),
                                           std::pair("exterior", state.outside.str())}) {
            if (medium.empty()) continue;
            const auto it = media.find(medium);
            if (it == media.end())
                throw SceneError(args.where(), fmt::format("there is no medium {}{}", quote(medium),
                                                           hint(medium, names_of(media))));
            if (it->second >= 0) add_child(shape, name, it->second);
        }
    if (group >= 0)
        add_child(group, "", shape);
    else
        description.roots.push_back(shape);
}

}  // namespace etendue
