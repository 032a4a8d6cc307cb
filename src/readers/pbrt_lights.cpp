// pbrt's lights. In pbrt-v4 a light's spectrum has the luminance 1 before `scale`, and `power` or `illuminance`, in
// photometric units, stand for the scale that gives them.

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "math/frame.h"
#include "readers/mitsuba_values.h"
#include "readers/pbrt_scene.h"

namespace etendue {
namespace {

/// Colour of a light with its scale, not yet with what `power` asks for.
Rgb light_colour(const PbrtScene& scene, const PbrtArguments& args, const char* name) {
    const Rgb scale = scene.is_v3() ? scene.colour(args, "scale", Rgb(1), PbrtSpectrum::Unbounded)
                                    : Rgb(args.number("scale", 1, 0));
    return scene.colour(args, name, Rgb(1), PbrtSpectrum::Illuminant) * scale * scene.exposure;
}

/// Factor that gives a light with the flux `unit` (lm, without colour) the flux that `name` asks for.
float photometric_factor(const PbrtArguments& args, const char* name, double unit) {
    const float wanted = args.number(name, -1);
    return wanted > 0 ? float(wanted / unit) : 1.0f;
}

[[noreturn]] void fail_aim(const PbrtArguments& args, Vec3 from) {
    args.fail("to", fmt::format("a light's from and to must differ, but both are {} {} {}", from.x,
                                from.y, from.z));
}

/// Where a light stands, and where +z of its space points.
Transform aimed(const PbrtScene& scene, const PbrtArguments& args, Vec3 default_to) {
    const Vec3 from = args.vector("from", {0, 0, 0}), to = args.vector("to", default_to);
    const Vec3 d = to - from;
    if (!(length2(d) > 0)) fail_aim(args, from);
    const Frame f = Frame::from_normal(normalize(d));
    const Transform local(Transform::Matrix{{{f.s.x, f.t.x, f.n.x, from.x},
                                             {f.s.y, f.t.y, f.n.y, from.y},
                                             {f.s.z, f.t.z, f.n.z, from.z},
                                             {0, 0, 0, 1}}});
    return scene.state.ctm * local;
}

int finish(PbrtScene& scene, int emitter) {
    scene.description.roots.push_back(emitter);
    return emitter;
}

int make_point(PbrtScene& scene, const PbrtArguments& args) {
    const int emitter = scene.add("emitter", "point", args.where());
    const Transform& ctm = scene.state.ctm;
    const Vec3 from = args.vector("from", {0, 0, 0});
    // In pbrt-v3 `from` is in world space, an offset from where the current transform puts the origin.
    scene.set(emitter, "position", scene.is_v3() ? ctm.point({0, 0, 0}) + from : ctm.point(from));
    scene.set(emitter, "intensity",
              light_colour(scene, args, "I") *
                  photometric_factor(args, "power", 4 * std::numbers::pi));
    return finish(scene, emitter);
}

int make_spot(PbrtScene& scene, const PbrtArguments& args) {
    const int emitter = scene.add("emitter", "spot", args.where());
    const float cone = args.number("coneangle", 30, 0.01f, 179.9f);
    const float delta = args.number("conedeltaangle", 5, 0, cone);
    const double radians = std::numbers::pi / 180, end = std::cos(cone * radians),
                 start = std::cos((cone - delta) * radians);
    scene.set(emitter, "to_world", aimed(scene, args, {0, 0, 1}));
    scene.set(emitter, "cutoff_angle", double(cone));
    scene.set(emitter, "beam_width", double(cone - delta));
    scene.set(emitter, "falloff", std::string(scene.is_v3() ? "quartic" : "smooth"));
    scene.set(emitter, "intensity",
              light_colour(scene, args, "I") *
                  photometric_factor(args, "power",
                                     2 * std::numbers::pi * (1 - start + (start - end) / 2)));
    return finish(scene, emitter);
}

int make_distant(PbrtScene& scene, const PbrtArguments& args) {
    const int emitter = scene.add("emitter", "directional", args.where());
    const Vec3 from = args.vector("from", {0, 0, 0});
    const Vec3 d = scene.state.ctm.vector(args.vector("to", {0, 0, 1}) - from);
    if (!(length2(d) > 0)) fail_aim(args, from);
    scene.set(emitter, "direction", d);
    scene.set(emitter, "irradiance",
              light_colour(scene, args, "L") * photometric_factor(args, "illuminance", 1));
    return finish(scene, emitter);
}

/// pbrt-v3's latitude-longitude images have +z up and azimuth from x to y; those of `envmap` y up and azimuth from -z
/// to x.
Transform from_z_up() {
    return Transform(Transform::Matrix{{{0, 0, -1, 0}, {1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 0, 1}}});
}

int make_infinite(PbrtScene& scene, const PbrtArguments& args) {
    const char* file = scene.is_v3() ? "mapname" : "filename";
    if (args.has("portal"))
        scene.warn(args.find("portal")->where, "the portal is ignored: the light stays the same");
    if (!args.has(file)) {
        const int emitter = scene.add("emitter", "constant", args.where());
        scene.set(emitter, "radiance",
                  light_colour(scene, args, "L") *
                      photometric_factor(args, "illuminance", std::numbers::pi));
        return finish(scene, emitter);
    }
    const int emitter = scene.add("emitter", "envmap", args.where());
    scene.set(emitter, "filename", args.text(file, ""));
    if (scene.is_v3()) {
        scene.set(emitter, "to_world", scene.state.ctm * from_z_up());
        scene.set(emitter, "tint", light_colour(scene, args, "L"));
    } else {
        if (args.has("L")) args.fail("L", "give either L or filename, not both");
        scene.set(emitter, "to_world", scene.state.ctm);
        scene.set(emitter, "projection", std::string("equalarea"));
        scene.set(emitter, "tint", light_colour(scene, args, "L"));
        if (args.number("illuminance", -1) > 0)
            scene.refuse(args.find("illuminance")->where,
                         "the illuminance of an image is not supported: give its scale",
                         "the image as it is");
    }
    return finish(scene, emitter);
}

/// What goniometric and projection lights share: a point with an image of its intensity.
int add_image_light(PbrtScene& scene, const PbrtArguments& args, const char* type) {
    const int emitter = scene.add("emitter", type, args.where());
    scene.set(emitter, "filename", args.text(scene.is_v3() ? "mapname" : "filename", ""));
    const Rgb I = light_colour(scene, args, "I");
    scene.set(emitter, "intensity", I);
    // The luminance of the colour, without its scale, is 1.
    if (const float power = args.number("power", -1); power > 0)
        scene.set(emitter, "power", double(power * luminance(I)));
    return emitter;
}

int make_goniometric(PbrtScene& scene, const PbrtArguments& args) {
    const int emitter = add_image_light(scene, args, "goniometric");
    // pbrt exchanges y and z: the zenith of its images is +y.
    Transform from_image(
        Transform::Matrix{{{1, 0, 0, 0}, {0, 0, 1, 0}, {0, 1, 0, 0}, {0, 0, 0, 1}}});
    if (scene.is_v3())
        from_image = from_image * from_z_up();
    else
        scene.set(emitter, "projection", std::string("equalarea"));
    scene.set(emitter, "to_world", scene.state.ctm * from_image);
    return finish(scene, emitter);
}

int make_projection(PbrtScene& scene, const PbrtArguments& args) {
    const int emitter = add_image_light(scene, args, "projection");
    scene.set(emitter, "fov", double(args.number("fov", scene.is_v3() ? 45 : 90, 0.01f, 179)));
    // In pbrt-v3 the upper edge of the image is that of -y.
    scene.set(emitter, "to_world",
              scene.is_v3() ? scene.state.ctm * Transform::scale({1, -1, 1}) : scene.state.ctm);
    return finish(scene, emitter);
}

int make_area(PbrtScene& scene, const PbrtArguments& args) {
    const int emitter = scene.add("emitter", "area", args.where());
    scene.set(emitter, "two_sided", args.flag("twosided", false));
    const Rgb L = light_colour(scene, args, "L");
    if (const float power = args.number("power", -1); power > 0)
        scene.set(emitter, "power", double(power * luminance(L)));
    if (args.has("filename")) {
        if (args.has("L")) args.fail("L", "give either L or filename, not both");
        // Lights take their images as they stand, textures upside down.
        const int image = scene.add("texture", "bitmap", args.where());
        scene.set(image, "filename", args.text("filename", ""));
        scene.set(image, "to_uv", Transform::translate({0, 1, 0}) * Transform::scale({1, -1, 1}));
        const int scaled = scene.add("texture", "scale", args.where());
        scene.add_child(scaled, "value", image);
        scene.set(scaled, "scale", L);
        scene.add_child(emitter, "radiance", scaled);
    } else {
        scene.set(emitter, "radiance", L);
    }
    return emitter;
}

std::vector<PbrtParamInfo> with_shared(std::vector<PbrtParamInfo> params, const char* colour,
                                       const char* colour_doc, int colour_versions = kV3And4) {
    params.push_back({colour, ParamKind::Rgb, "1", colour_doc, colour_versions});
    params.push_back(
        {"scale", ParamKind::Float, "1", "Factor by which the light is multiplied.", kV4});
    params.push_back(
        {"scale", ParamKind::Rgb, "1", "Colour by which the light is multiplied.", kV3});
    params.push_back({"nsamples", ParamKind::Int, "", "Accepted; without effect.", kV3});
    params.push_back({"samples", ParamKind::Int, "", "Accepted; without effect.", kV3});
    return params;
}

constexpr PbrtParamInfo kFrom = {"from", ParamKind::Vector, "0 0 0", "Position."};
constexpr PbrtParamInfo kTo = {"to", ParamKind::Vector, "0 0 1", "Point that it shines at."};
constexpr PbrtParamInfo kPower = {"power", ParamKind::Float, "",
                                  "Luminous flux in lm, instead of what the colour says.", kV4};
constexpr PbrtParamInfo kIlluminance = {"illuminance", ParamKind::Float, "",
                                        "Illuminance in lx, instead of what the colour says.", kV4};

}  // namespace

const std::vector<PbrtEntry>& pbrt_area_lights() {
    static const std::vector<PbrtEntry> entries = [] {
        const std::vector<PbrtParamInfo> params =
            with_shared({{"twosided", ParamKind::Bool, "false", "Whether the back shines, too."},
                         {"filename", ParamKind::String, "",
                          "Image of the radiance over (u, v), instead of L.", kV4},
                         kPower},
                        "L", "Radiance.");
        return std::vector<PbrtEntry>{{"diffuse", kV3And4,
                                       "Becomes the emitter area of the shapes that follow.",
                                       params, make_area},
                                      {"area", kV3, "Another name of diffuse.", params, make_area}};
    }();
    return entries;
}

const std::vector<PbrtEntry>& pbrt_lights() {
    static const std::vector<PbrtEntry> entries = {
        {"infinite", kV3And4, "Becomes constant, or envmap where there is an image.",
         with_shared({{"mapname", ParamKind::String, "", "Latitude-longitude image, +z up.", kV3},
                      {"filename", ParamKind::String, "",
                       "Square image in equal-area octahedral projection.", kV4},
                      kIlluminance,
                      {"portal", ParamKind::Vector, "", "Ignored, with a warning.", kV4}},
                     "L", "Radiance; v3: also a colour by which the image is multiplied."),
         make_infinite},
        {"distant", kV3And4, "Becomes directional.",
         with_shared({kFrom, kTo, kIlluminance}, "L", "Irradiance."), make_distant},
        {"point", kV3And4, "Becomes point.", with_shared({kFrom, kPower}, "I", "Intensity."),
         make_point},
        {"spot", kV3And4, "Becomes spot.",
         with_shared(
             {kFrom,
              kTo,
              kPower,
              {"coneangle", ParamKind::Float, "30", "Half-angle of the cone in degrees."},
              {"conedeltaangle", ParamKind::Float, "5", "Width of the fall-off inside it."}},
             "I", "Intensity in the beam."),
         make_spot},
        {"goniometric", kV3And4,
         "Becomes goniometric; colours of the image are kept, which pbrt-v4 averages.",
         with_shared({{"mapname", ParamKind::String, "", "Latitude-longitude image, +y up.", kV3},
                      {"filename", ParamKind::String, "",
                       "Square image in equal-area octahedral projection.", kV4},
                      kPower},
                     "I", "Colour by which the image is multiplied."),
         make_goniometric},
        {"projection", kV3And4, "Becomes projection; its pixels are not interpolated.",
         with_shared({{"mapname", ParamKind::String, "", "Image.", kV3},
                      {"filename", ParamKind::String, "", "Image.", kV4},
                      {"fov", ParamKind::Float, "90, v3: 45",
                       "Full angle in degrees over the shorter side."},
                      kPower},
                     "I", "Colour by which the image is multiplied.", kV3),
         make_projection},
    };
    return entries;
}

}  // namespace etendue
