// pbrt's textures. Their (u, v) = (0, 0) is the lower left corner of an image, etendue's the upper left one.

#include <cmath>

#include <fmt/format.h>

#include "readers/mitsuba_values.h"
#include "readers/pbrt_scene.h"

namespace etendue {
namespace {

bool is_float(const PbrtArguments& args) {
    return args.kind() == "float Texture";
}

/// The texture's own map of (u, v).
Transform mapping(PbrtScene& scene, const PbrtArguments& args) {
    if (const std::string m = args.text("mapping", "uv"); m != "uv")
        scene.refuse(
            args.find("mapping")->where,
            fmt::format("the mapping {} is not supported: textures are functions of (u, v)",
                        quote(m)),
            "\"uv\"");
    return Transform::translate({args.number("udelta", 0), args.number("vdelta", 0), 0}) *
           Transform::scale({args.number("uscale", 1), args.number("vscale", 1), 1});
}

void set_to_uv(PbrtScene& scene, int texture, const Transform& to_uv) {
    if (!to_uv.is_identity()) scene.set(texture, "to_uv", to_uv);
}

void bind(PbrtScene& scene, int texture, const char* to, const PbrtArguments& args,
          const char* name, float fallback) {
    if (is_float(args))
        scene.bind_float(texture, to, args, name, fallback);
    else
        scene.bind(texture, to, args, name, Rgb(fallback), PbrtSpectrum::Unbounded);
}

int make_constant(PbrtScene& scene, const PbrtArguments& args) {
    // The name of a texture stands for it, so that "constant" objects have a number or a colour.
    if (const int t = scene.texture(args, "value", is_float(args)); t >= 0) return t;
    const int texture = scene.add("texture", "constant", args.where());
    bind(scene, texture, "value", args, "value", 1);
    return texture;
}

/// Whether an image's codes are linear, not sRGB.
bool is_raw(PbrtScene& scene, const PbrtArguments& args) {
    if (scene.is_v3()) {
        const bool srgb = args.flag("gamma", true);
        return !srgb;
    }
    const std::string encoding = args.text("encoding", "sRGB");
    if (encoding == "linear") return true;
    if (encoding != "sRGB" && encoding != "gamma 2.2")
        scene.refuse(
            args.find("encoding")->where,
            fmt::format("the encoding {} is not supported (known: sRGB, linear)", quote(encoding)),
            "\"sRGB\"");
    return false;
}

int make_imagemap(PbrtScene& scene, const PbrtArguments& args) {
    const int image = scene.add("texture", "bitmap", args.where());
    scene.set(image, "filename", args.text("filename", ""));
    const Transform flip = Transform::translate({0, 1, 0}) * Transform::scale({1, -1, 1});
    set_to_uv(scene, image, flip * mapping(scene, args));
    const std::string wrap = args.text("wrap", "repeat");
    if (wrap != "repeat" && wrap != "clamp" && wrap != "black")
        args.fail("wrap",
                  fmt::format("unknown wrap mode {} (known: repeat, clamp, black)", quote(wrap)));
    if (wrap != "repeat")
        scene.set(image, "wrap_mode", std::string(wrap == "black" ? "zero" : "clamp"));
    if (args.text("filter", "bilinear") == "point")
        scene.set(image, "filter_type", std::string("nearest"));
    if (is_raw(scene, args)) scene.set(image, "raw", true);
    const float scale = args.number("scale", 1);
    int texture = image;
    if (scale != 1) {
        texture = scene.add("texture", "scale", args.where());
        scene.add_child(texture, "value", image);
        scene.set(texture, "scale", Rgb(scale));
    }
    if (!args.flag("invert", false)) return texture;
    if (!is_float(args)) {
        scene.reject(args.find("invert")->where, "inverted images of colours are not supported");
        return texture;
    }
    const int inverted = scene.add("texture", "mix", args.where());
    scene.set(inverted, "value0", Rgb(1));
    scene.set(inverted, "value1", Rgb(0));
    scene.add_child(inverted, "weight", texture);
    return inverted;
}

/// A texture times a number that varies: a mixture with black, of which the weight is the value of a float texture.
int scale_by_float_texture(PbrtScene& scene, const PbrtArguments& args, const char* value,
                           const char* factor) {
    const int texture = scene.add("texture", "mix", args.where());
    scene.set(texture, "value0", Rgb(0));
    bind(scene, texture, "value1", args, value, 1);
    scene.bind_float(texture, "weight", args, factor, 1);
    return texture;
}

int make_scale(PbrtScene& scene, const PbrtArguments& args) {
    const bool floats = is_float(args);
    const char* names[2] = {scene.is_v3() || args.has("tex1") ? "tex1" : "tex",
                            scene.is_v3() || args.has("tex2") ? "tex2" : "scale"};
    // The factor of pbrt-v4 is a float, also of spectra. A spectrum is taken as well where there is no such float.
    const bool is_factor_float = floats || (!scene.is_v3() && scene.is_float(args, names[1]));
    const auto constant = [&](const char* name, bool is_float) -> std::optional<Rgb> {
        if (!is_float) return scene.constant(args, name, Rgb(1), PbrtSpectrum::Unbounded);
        if (const auto x = scene.constant(args, name, 1.0f)) return Rgb(*x);
        return {};
    };
    const std::optional<Rgb> a = constant(names[0], floats),
                             b = constant(names[1], is_factor_float);
    if (a && b) {
        const int product = scene.add("texture", "constant", args.where());
        scene.set(product, "value", *a * *b);
        return product;
    }
    if (is_factor_float && !floats && !b)
        return scale_by_float_texture(scene, args, names[0], names[1]);
    const int texture = scene.add("texture", "scale", args.where());
    // The value of a product is the texture of the two.
    bind(scene, texture, "value", args, names[a ? 1 : 0], 1);
    if (const auto factor = a ? a : b)
        scene.set(texture, "scale", *factor);
    else
        bind(scene, texture, "scale", args, names[1], 1);
    return texture;
}

int make_mixed_texture(PbrtScene& scene, const PbrtArguments& args) {
    const int texture = scene.add("texture", "mix", args.where());
    bind(scene, texture, "value0", args, "tex1", 0);
    bind(scene, texture, "value1", args, "tex2", 1);
    scene.bind_float(texture, "weight", args, "amount", 0.5f);
    return texture;
}

/// A texture of space. Its space is that of the current transform; pbrt-v3 takes that transform for its inverse.
int add_solid(PbrtScene& scene, const PbrtArguments& args, const char* type) {
    const int texture = scene.add("texture", type, args.where());
    const Transform& ctm = scene.state.ctm;
    if (!ctm.is_identity()) scene.set(texture, "to_texture", scene.is_v3() ? ctm : ctm.inverse());
    return texture;
}

void set_number(PbrtScene& scene, int texture, const PbrtArguments& args, const char* name) {
    if (args.has(name)) scene.set(texture, name, double(args.number(name, 0)));
}

/// fbm, wrinkled, windy or marble, which have the same names here.
int make_noise(PbrtScene& scene, const PbrtArguments& args) {
    const int texture = add_solid(scene, args, args.name().c_str());
    for (const char* name : {"roughness", "scale", "variation"})
        set_number(scene, texture, args, name);
    if (args.has("octaves")) scene.set(texture, "octaves", args.integer("octaves", 8, 1, 64));
    return texture;
}

int make_dots(PbrtScene& scene, const PbrtArguments& args) {
    const int texture = scene.add("texture", "dots", args.where());
    bind(scene, texture, "inside", args, "inside", 1);
    bind(scene, texture, "outside", args, "outside", 0);
    set_to_uv(scene, texture, mapping(scene, args));
    return texture;
}

int make_checkerboard(PbrtScene& scene, const PbrtArguments& args) {
    const bool is_solid = args.integer("dimension", 2, 2, 3) == 3;
    const int texture = is_solid ? add_solid(scene, args, "checkerboard3d")
                                 : scene.add("texture", "checkerboard", args.where());
    bind(scene, texture, "color0", args, "tex1", 1);
    bind(scene, texture, "color1", args, "tex2", 0);
    if (is_solid) return texture;
    // One square to the unit of (u, v), not two.
    set_to_uv(scene, texture, Transform::scale({0.5f, 0.5f, 1}) * mapping(scene, args));
    return texture;
}

int make_bilerp(PbrtScene& scene, const PbrtArguments& args) {
    const int texture = scene.add("texture", "bilerp", args.where());
    for (const auto& [name, fallback] :
         {std::pair("v00", 0.0f), {"v01", 1.0f}, {"v10", 0.0f}, {"v11", 1.0f}})
        bind(scene, texture, name, args, name, fallback);
    set_to_uv(scene, texture, mapping(scene, args));
    return texture;
}

std::vector<PbrtParamInfo> with_mapping(std::vector<PbrtParamInfo> params) {
    const std::vector<PbrtParamInfo> more = {
        {"mapping", ParamKind::String, "uv", "Others than uv are rejected."},
        {"uscale", ParamKind::Float, "1", "Factor by which u is multiplied."},
        {"vscale", ParamKind::Float, "1", "Factor by which v is multiplied."},
        {"udelta", ParamKind::Float, "0", "Number that is added to u."},
        {"vdelta", ParamKind::Float, "0", "Number that is added to v."},
        {"v1", ParamKind::Vector, "", "Only for mappings that are rejected."},
        {"v2", ParamKind::Vector, "", "Only for mappings that are rejected."}};
    params.insert(params.end(), more.begin(), more.end());
    return params;
}

std::vector<PbrtParamInfo> octaves() {
    return {
        {"octaves", ParamKind::Int, "8", "Number of octaves."},
        {"roughness", ParamKind::Float, "0.5", "Ratio of the amplitudes of successive octaves."}};
}

}  // namespace

const std::vector<PbrtEntry>& pbrt_textures() {
    static const std::vector<PbrtEntry> entries = {
        {"imagemap", kV3And4, "Becomes bitmap, turned upside down.",
         with_mapping(
             {{"filename", ParamKind::String, "", "Image."},
              {"wrap", ParamKind::String, "repeat", "repeat, clamp or black."},
              {"scale", ParamKind::Float, "1",
               "Factor by which the values of the image are multiplied."},
              {"gamma", ParamKind::Bool, "true", "Whether 8-bit codes are sRGB.", kV3},
              {"trilinear", ParamKind::Bool, "", "Accepted; images are filtered bilinearly.", kV3},
              {"encoding", ParamKind::String, "sRGB", "sRGB or linear.", kV4},
              {"filter", ParamKind::String, "bilinear",
               "point is nearest; all others are bilinear.", kV4},
              {"maxanisotropy", ParamKind::Float, "", "Accepted; without effect."},
              {"invert", ParamKind::Bool, "false", "1 minus the value; of colours it is rejected.",
               kV4}}),
         make_imagemap},
        {"constant",
         kV3And4,
         "Becomes the value.",
         {{"value", ParamKind::Texture, "1", "The value."}},
         make_constant},
        {"scale",
         kV3And4,
         "Becomes scale; in v4, of a spectrum and a float texture, mix.",
         {{"tex", ParamKind::Texture, "1", "First factor.", kV4},
          {"scale", ParamKind::Texture, "1", "Second factor; a float.", kV4},
          {"tex1", ParamKind::Texture, "1", "First factor."},
          {"tex2", ParamKind::Texture, "1", "Second factor."}},
         make_scale},
        {"mix",
         kV3And4,
         "Becomes mix.",
         {{"tex1", ParamKind::Texture, "0", "Value where amount is 0."},
          {"tex2", ParamKind::Texture, "1", "Value where amount is 1."},
          {"amount", ParamKind::Texture, "0.5", "Weight of tex2."}},
         make_mixed_texture},
        {"checkerboard", kV3And4, "Becomes checkerboard, or checkerboard3d.",
         with_mapping({{"tex1", ParamKind::Texture, "1", "Value of the squares on the diagonal."},
                       {"tex2", ParamKind::Texture, "0", "Value of the other squares."},
                       {"dimension", ParamKind::Int, "2", "3 becomes checkerboard3d."},
                       {"aamode", ParamKind::String, "", "Accepted; without effect.", kV3}}),
         make_checkerboard},
        {"bilerp", kV3And4, "Becomes bilerp.",
         with_mapping({{"v00", ParamKind::Rgb, "0", "Value at (0, 0)."},
                       {"v01", ParamKind::Rgb, "1", "Value at (0, 1)."},
                       {"v10", ParamKind::Rgb, "0", "Value at (1, 0)."},
                       {"v11", ParamKind::Rgb, "1", "Value at (1, 1)."}}),
         make_bilerp},
        {"dots", kV3And4, "Becomes dots, in places of etendue's own.",
         with_mapping({{"inside", ParamKind::Texture, "1", "Value of the dots."},
                       {"outside", ParamKind::Texture, "0", "Value around the dots."}}),
         make_dots},
        {"uv", kV3, "Rejected: there is no such texture.", {}, nullptr},
        {"directionmix",
         kV4,
         "Rejected: textures are functions of (u, v), this one is of the normal.",
         {},
         nullptr},
        {"fbm", kV3And4, "Becomes fbm; the noise is etendue's own.", octaves(), make_noise},
        {"wrinkled", kV3And4, "Becomes wrinkled; the noise is etendue's own.", octaves(),
         make_noise},
        {"windy", kV3And4, "Becomes windy; the noise is etendue's own.", {}, make_noise},
        {"marble",
         kV3And4,
         "Becomes marble, with pbrt-v4's spline; the noise is etendue's own.",
         {{"octaves", ParamKind::Int, "8", "Number of octaves."},
          {"roughness", ParamKind::Float, "0.5", "Ratio of the amplitudes of successive octaves."},
          {"scale", ParamKind::Float, "1", "Factor by which the coordinates are multiplied."},
          {"variation", ParamKind::Float, "0.2", "Factor by which the noise is multiplied."}},
         make_noise},
        {"ptex", kV3And4, "Rejected: Ptex files are not supported.", {}, nullptr},
    };
    return entries;
}

}  // namespace etendue
