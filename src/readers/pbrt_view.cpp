// pbrt's cameras, films, filters, samplers and integrators: what is seen and how it is rendered.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "readers/pbrt_scene.h"

namespace etendue {
namespace {

// ---- Cameras

/// Edges of the view on pbrt's screen: x to the right, y up.
struct ScreenWindow {
    double x0, x1, y0, y1;
    bool is_given;

    double aspect() const { return (x1 - x0) / (y1 - y0); }
};

ScreenWindow screen_window(const PbrtScene& scene, const PbrtArguments& args) {
    const bool has_frame = args.has("frameaspectratio");
    const double frame = has_frame ? double(args.number("frameaspectratio", 1, 1e-6f))
                                   : double(scene.film_width) / scene.film_height;
    if (const auto& w = args.numbers("screenwindow", 4); !w.empty()) {
        if (w.size() != 4 || !(w[0] < w[1] && w[2] < w[3]))
            args.fail("screenwindow",
                      fmt::format("expected four numbers: left < right, bottom < top, found {}",
                                  fmt::join(w, " ")));
        return {w[0], w[1], w[2], w[3], true};
    }
    // The shorter side of the image spans [-1, 1].
    const double x = std::max(frame, 1.0), y = x / frame;
    return {-x, x, -y, y, has_frame};
}

/// The shutter's time is the exposure, as nothing moves; in pbrt-v3 it is without effect.
void read_shutter(PbrtScene& scene, const PbrtArguments& args) {
    const float time = args.number("shutterclose", 1) - args.number("shutteropen", 0);
    if (scene.is_v3()) return;
    if (!(time > 0))
        args.fail("shutterclose",
                  fmt::format("the shutter must close after it opens, not {} earlier", -time));
    scene.exposure *= time;
}

/// pbrt's camera looks along +z with x to the right, etendue's with x to the left.
Transform to_world(const PbrtScene& scene) {
    return scene.camera_to_world * Transform::scale({-1, 1, 1});
}

double degrees(double radians) {
    return radians * 180 / std::numbers::pi;
}

int make_perspective(PbrtScene& scene, const PbrtArguments& args) {
    read_shutter(scene, args);
    const float lens = args.number("lensradius", 0, 0);
    const int sensor = scene.add("sensor", lens > 0 ? "thinlens" : "perspective", args.where());
    scene.set(sensor, "to_world", to_world(scene));
    const double fov = args.has("halffov") ? 2 * double(args.number("halffov", 45, 1e-3f, 89.9f))
                                           : double(args.number("fov", 90, 1e-3f, 179.8f));
    const ScreenWindow w = screen_window(scene, args);
    if (!w.is_given) {
        scene.set(sensor, "fov", fov);
        scene.set(sensor, "fov_axis", std::string("smaller"));
    } else {
        const double half = std::tan(fov * std::numbers::pi / 360) * (w.x1 - w.x0) / 2;
        scene.set(sensor, "fov", degrees(2 * std::atan(half)));
        scene.set(sensor, "aspect", w.aspect());
        scene.set(sensor, "principal_point_offset_x", (w.x0 + w.x1) / (2 * (w.x1 - w.x0)));
        scene.set(sensor, "principal_point_offset_y", -(w.y0 + w.y1) / (2 * (w.y1 - w.y0)));
    }
    if (lens > 0) {
        // Lengths are those of camera space.
        const double unit = double(length(scene.camera_to_world.vector({0, 0, 1})));
        scene.set(sensor, "aperture_radius", lens * unit);
        scene.set(sensor, "focus_distance",
                  double(args.number("focaldistance", 1e6f, 1e-6f)) * unit);
    }
    return sensor;
}

int make_orthographic(PbrtScene& scene, const PbrtArguments& args) {
    read_shutter(scene, args);
    if (args.number("lensradius", 0, 0) > 0)
        scene.reject(args.find("lensradius")->where,
                     "an orthographic camera with a lens is not supported");
    const int sensor = scene.add("sensor", "orthographic", args.where());
    const ScreenWindow w = screen_window(scene, args);
    const double film = double(scene.film_width) / scene.film_height;
    scene.set(
        sensor, "to_world",
        scene.camera_to_world *
            Transform::translate({float((w.x0 + w.x1) / 2), float((w.y0 + w.y1) / 2), 0}) *
            Transform::scale({float(-(w.x1 - w.x0) / 2), float(film * (w.y1 - w.y0) / 2), 1}));
    return sensor;
}

// ---- Films

/// Half-open ranges of pixels that a film renders.
void read_crop(const PbrtArguments& args, int width, int height, int (&crop)[4]) {
    crop[0] = 0, crop[1] = width, crop[2] = 0, crop[3] = height;
    if (const auto& b = args.integers("pixelbounds"); !b.empty()) {
        if (b.size() != 4)
            args.fail("pixelbounds",
                      fmt::format("expected four integers: x0, x1, y0, y1, found {}", b.size()));
        for (int i = 0; i < 4; ++i) crop[i] = std::clamp(b[size_t(i)], 0, i < 2 ? width : height);
    }
    if (const auto& w = args.numbers("cropwindow", 4); !w.empty()) {
        if (w.size() != 4)
            args.fail("cropwindow",
                      fmt::format("expected four numbers: x0, x1, y0, y1, found {}", w.size()));
        for (int i = 0; i < 4; ++i) {
            const int size = i < 2 ? width : height;
            crop[i] = int(std::ceil(float(size) * clamp(w[size_t(i)], 0, 1)));
        }
    }
    if (crop[0] >= crop[1] || crop[2] >= crop[3])
        args.fail(fmt::format("the film's crop has no pixels: x from {} to {}, y from {} to {}",
                              crop[0], crop[1], crop[2], crop[3]));
}

int make_film(PbrtScene& scene, const PbrtArguments& args) {
    constexpr int kMost = 1 << 16;
    scene.film_width = args.integer("xresolution", scene.is_v3() ? 640 : 1280, 1, kMost);
    scene.film_height = args.integer("yresolution", scene.is_v3() ? 480 : 720, 1, kMost);
    int crop[4];
    read_crop(args, scene.film_width, scene.film_height, crop);
    if (scene.is_v3()) {
        scene.exposure *= args.number("scale", 1, 0);
    } else {
        scene.exposure *= args.number("iso", 100, 0) / 100;
        if (const std::string sensor = args.text("sensor", "cie1931"); sensor != "cie1931")
            scene.refuse(args.find("sensor")->where,
                         fmt::format("the measured sensor \"{}\" is not supported", sensor),
                         "\"cie1931\"");
        if (args.number("whitebalance", 0, 0) != 0)
            scene.reject(args.find("whitebalance")->where, "white balance is not supported");
    }
    const int film = scene.add("film", "hdrfilm", args.where());
    scene.set(film, "width", int64_t(scene.film_width));
    scene.set(film, "height", int64_t(scene.film_height));
    // As far as the filter reaches, like every film of pbrt.
    scene.set(film, "sample_border", true);
    if (crop[1] - crop[0] < scene.film_width || crop[3] - crop[2] < scene.film_height) {
        scene.set(film, "crop_offset_x", int64_t(crop[0]));
        scene.set(film, "crop_offset_y", int64_t(crop[2]));
        scene.set(film, "crop_width", int64_t(crop[1] - crop[0]));
        scene.set(film, "crop_height", int64_t(crop[3] - crop[2]));
    }
    return film;
}

// ---- Filters

/// The filter's radius, which must be the same in x and y.
float radius(const PbrtScene& scene, const PbrtArguments& args, float v3, float v4) {
    const char* names[2] = {scene.is_v3() ? "xwidth" : "xradius",
                            scene.is_v3() ? "ywidth" : "yradius"};
    const float fallback = scene.is_v3() ? v3 : v4;
    const float x = args.number(names[0], fallback, 0.01f, 16),
                y = args.number(names[1], fallback, 0.01f, 16);
    if (x != y)
        args.fail(names[0],
                  fmt::format("a filter must be as wide as it is high, not {} by {}", x, y));
    return x;
}

int make_box(PbrtScene& scene, const PbrtArguments& args) {
    if (const float r = radius(scene, args, 0.5f, 0.5f); r != 0.5f)
        scene.refuse(args.where(), fmt::format("a box filter must have the radius 0.5, not {}", r),
                     "a box of one pixel");
    return scene.add("rfilter", "box", args.where());
}

int make_triangle(PbrtScene& scene, const PbrtArguments& args) {
    const int filter = scene.add("rfilter", "tent", args.where());
    scene.set(filter, "radius", double(radius(scene, args, 2, 2)));
    return filter;
}

int make_gaussian(PbrtScene& scene, const PbrtArguments& args) {
    radius(scene, args, 2, 1.5f);
    const float sigma = scene.is_v3() ? std::sqrt(0.5f / args.number("alpha", 2, 0.04f))
                                      : args.number("sigma", 0.5f, 0.01f, 4);
    const int filter = scene.add("rfilter", "gaussian", args.where());
    scene.set(filter, "stddev", double(sigma));
    return filter;
}

int make_mitchell(PbrtScene& scene, const PbrtArguments& args) {
    if (const float r = radius(scene, args, 2, 2); r != 2)
        scene.refuse(args.where(),
                     fmt::format("a Mitchell filter must have the radius 2, not {}", r),
                     "one of radius 2");
    const int filter = scene.add("rfilter", "mitchell", args.where());
    scene.set(filter, "b", double(args.number("B", 1 / 3.0f)));
    scene.set(filter, "c", double(args.number("C", 1 / 3.0f)));
    return filter;
}

int make_sinc(PbrtScene& scene, const PbrtArguments& args) {
    radius(scene, args, 4, 4);
    const int filter = scene.add("rfilter", "lanczos", args.where());
    scene.set(filter, "lobes", int64_t(std::lround(args.number("tau", 3, 1, 8))));
    return filter;
}

// ---- Samplers and integrators

int make_sampler(PbrtScene& scene, const PbrtArguments& args) {
    const int sampler = scene.add("sampler", "sobol", args.where());
    constexpr int kMost = 1 << 30, kMostOnASide = 1 << 14;
    int count = args.integer("pixelsamples", 16, 1, kMost);
    if (args.name() == "stratified")
        count = args.integer("xsamples", 4, 1, kMostOnASide) *
                args.integer("ysamples", 4, 1, kMostOnASide);
    scene.set(sampler, "sample_count", int64_t(count));
    return sampler;
}

constexpr std::string_view kSampleCount = "sample_count";

/// What becomes of a parameter of pbrt's integrators.
struct IntegratorParam {
    PbrtParamInfo info;
    /// Parameter of the integrator used, or the sample count; nullptr: none.
    const char* counterpart = nullptr;
    bool has_effect =
        true;  ///< Whether it concerns the image or its noise, so that a warning is due.
};

IntegratorParam counterpart(const char* name, ParamKind kind, const char* of_etendue,
                            const char* doc, int versions = kV3And4) {
    return {{name, kind, "", doc, versions}, of_etendue};
}
std::vector<IntegratorParam> missing(ParamKind kind, std::initializer_list<const char*> names) {
    std::vector<IntegratorParam> all;
    for (const char* name : names) all.push_back({{name, kind, "", "Ignored, with a warning."}});
    return all;
}
std::vector<IntegratorParam> without_effect(ParamKind kind,
                                            std::initializer_list<const char*> names) {
    std::vector<IntegratorParam> all;
    for (const char* name : names)
        all.push_back({{name, kind, "", "Accepted; it changes no image."}, nullptr, false});
    return all;
}
std::vector<IntegratorParam> operator+(std::vector<IntegratorParam> a,
                                       const std::vector<IntegratorParam>& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

/// An integrator of pbrt, and the one of etendue that renders it.
struct IntegratorUse {
    const char* name;
    int versions;
    const char* integrator;
    std::vector<IntegratorParam> params;
    bool is_substitute = false;
};

const std::vector<IntegratorUse>& integrator_uses() {
    static const std::vector<IntegratorUse> uses = [] {
        const std::vector<IntegratorParam> paths =
            missing(ParamKind::Float, {"rrthreshold"}) +
            missing(ParamKind::String, {"lightsampler", "lightsamplestrategy"}) +
            missing(ParamKind::Bool, {"regularize"}) +
            without_effect(ParamKind::Int, {"pixelbounds"});
        const std::vector<IntegratorParam> samples =
            missing(ParamKind::Bool, {"samplebsdf", "samplelights"});
        const std::vector<IntegratorParam> progressive =
            std::vector<IntegratorParam>{
                counterpart("radius", ParamKind::Float, "radius", "Becomes radius."),
                counterpart("photonsperiteration", ParamKind::Int, "light_paths",
                            "Becomes light_paths."),
                counterpart("numiterations", ParamKind::Int, "sample_count", "Samples per pixel.",
                            kV3),
                counterpart("iterations", ParamKind::Int, "sample_count", "The same.", kV3)} +
            missing(ParamKind::Bool, {"regularize"}) +
            without_effect(ParamKind::Int, {"imagewritefrequency", "pixelbounds"});
        const std::vector<IntegratorParam> metropolis =
            std::vector<IntegratorParam>{
                counterpart("largestepprobability", ParamKind::Float, "p_large",
                            "Becomes p_large."),
                counterpart("mutationsperpixel", ParamKind::Int, "sample_count",
                            "Samples per pixel."),
                counterpart("chains", ParamKind::Int, "chains", "Becomes chains, of each group.")} +
            missing(ParamKind::Int, {"bootstrapsamples"}) + missing(ParamKind::Float, {"sigma"}) +
            missing(ParamKind::Bool, {"regularize"}) +
            without_effect(ParamKind::Int, {"pixelbounds"});
        const std::vector<IntegratorParam> bidirectional =
            missing(ParamKind::String, {"lightsampler", "lightsamplestrategy"}) +
            missing(ParamKind::Bool, {"regularize"}) +
            without_effect(ParamKind::Bool, {"visualizestrategies", "visualizeweights"}) +
            without_effect(ParamKind::Int, {"pixelbounds"});
        const std::vector<IntegratorParam> substituted =
            without_effect(ParamKind::Int, {"nsamples", "pixelbounds"}) +
            without_effect(ParamKind::Float, {"maxdistance"}) +
            without_effect(ParamKind::Bool, {"cossample"});
        return std::vector<IntegratorUse>{
            {"path", kV3And4, "path", paths},
            {"volpath", kV3And4, "path", paths},
            {"simplepath", kV4, "path", samples},
            {"simplevolpath", kV4, "path", {}},
            {"randomwalk", kV4, "path", {}},
            {"directlighting", kV3, "path",
             missing(ParamKind::String, {"strategy"}) +
                 without_effect(ParamKind::Int, {"pixelbounds"})},
            {"whitted", kV3, "path", without_effect(ParamKind::Int, {"pixelbounds"})},
            {"bdpt", kV3And4, "bdpt", bidirectional},
            {"lightpath", kV4, "ptracer", {}},
            {"sppm", kV3And4, "sppm", progressive},
            {"mlt", kV3And4, "mmlt", metropolis},
            {"ambientocclusion", kV3And4, "path", substituted, true},
            {"function", kV4, "path",
             without_effect(ParamKind::String, {"function", "filename"}) +
                 without_effect(ParamKind::Bool, {"skipbad"}) +
                 without_effect(ParamKind::Int, {"imagewritefrequency"}),
             true}};
    }();
    return uses;
}

/// What these integrators of pbrt count themselves takes the place of the sampler's count.
void set_sample_count(PbrtScene& scene, int count) {
    if (scene.sampler < 0 || count < 1) return;
    for (Param& p : scene.description.objects[size_t(scene.sampler)].params)
        if (p.name == kSampleCount) p.value = int64_t(count);
}

/// pbrt counts scatterings, etendue edges: one more.
int make_integrator(PbrtScene& scene, const PbrtArguments& args) {
    const auto use = std::ranges::find_if(
        integrator_uses(), [&](const IntegratorUse& u) { return u.name == args.name(); });
    if (use->is_substitute)
        scene.warn(args.where(),
                   fmt::format("the integrator \"{}\" is not one of etendue's; \"path\" instead",
                               args.name()));
    const int integrator = scene.add("integrator", use->integrator, args.where());
    constexpr int kMost = 1 << 19;
    scene.set(integrator, "max_depth", int64_t(args.integer("maxdepth", 5, 0, kMost)) + 1);
    std::vector<std::string> ignored;
    for (const IntegratorParam& p : use->params) {
        const std::string name(p.info.name);
        if (!args.has(name)) continue;
        if (!p.counterpart) {
            if (p.has_effect && !use->is_substitute) ignored.push_back(name);
        } else if (p.info.kind == ParamKind::Int) {
            // pbrt's -1 is the default: as many photons as pixels.
            const int value = args.integer(name, -1, -1, 1 << 30);
            if (value < 0) continue;
            if (p.counterpart == kSampleCount)
                set_sample_count(scene, value);
            else
                scene.set(integrator, p.counterpart, int64_t(value));
        } else {
            scene.set(integrator, p.counterpart, double(args.number(name, 0, 0)));
        }
    }
    if (!ignored.empty())
        scene.warn(args.where(),
                   fmt::format("integrator \"{}\": without counterpart here, and ignored: {}",
                               args.name(), fmt::join(ignored, ", ")));
    return integrator;
}

// ---- Tables

std::vector<PbrtParamInfo> operator+(std::vector<PbrtParamInfo> a,
                                     const std::vector<PbrtParamInfo>& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

std::vector<PbrtParamInfo> camera_params() {
    return {{"frameaspectratio", ParamKind::Float, "that of the film",
             "Width over height of the view."},
            {"screenwindow", ParamKind::Vector, "shorter side [-1, 1]",
             "Left, right, bottom, top of the view."},
            {"lensradius", ParamKind::Float, "0", "Radius of the lens; 0: pinhole."},
            {"focaldistance", ParamKind::Float, "1e6", "Distance of the plane in focus."},
            {"shutteropen", ParamKind::Float, "0",
             "Nothing moves; v4: shutterclose - shutteropen multiplies the image."},
            {"shutterclose", ParamKind::Float, "1",
             "End of the exposure, which begins at shutteropen."}};
}

std::vector<PbrtParamInfo> film_params() {
    return {
        {"xresolution", ParamKind::Int, "1280 (v3: 640)", "Width in pixels."},
        {"yresolution", ParamKind::Int, "720 (v3: 480)", "Height in pixels."},
        {"cropwindow", ParamKind::Vector, "0 1 0 1", "Part that is rendered: x0, x1, y0, y1."},
        {"pixelbounds", ParamKind::Int, "", "Part that is rendered, in pixels: x0, x1, y0, y1.",
         kV4},
        {"filename", ParamKind::String, "", "Accepted; the command line names the output."},
        {"diagonal", ParamKind::Float, "", "Accepted; only realistic cameras need it."},
        {"scale", ParamKind::Float, "1", "Factor of the image, by which every light is multiplied.",
         kV3},
        {"maxsampleluminance", ParamKind::Float, "", "Accepted; samples are never clamped.", kV3},
        {"iso", ParamKind::Float, "100",
         "Sensitivity: the image is multiplied by iso/100; here every light.", kV4},
        {"sensor", ParamKind::String, "cie1931", "Others than cie1931 are rejected.", kV4},
        {"whitebalance", ParamKind::Float, "0", "Rejected unless 0.", kV4},
        {"maxcomponentvalue", ParamKind::Float, "", "Accepted; samples are never clamped.", kV4},
        {"savefp16", ParamKind::Bool, "", "Accepted; without effect.", kV4}};
}

std::vector<PbrtParamInfo> filter_params(const char* v3, const char* v4) {
    return {{"xwidth", ParamKind::Float, v3, "Radius in pixels.", kV3},
            {"ywidth", ParamKind::Float, v3, "The same.", kV3},
            {"xradius", ParamKind::Float, v4, "Radius in pixels.", kV4},
            {"yradius", ParamKind::Float, v4, "The same.", kV4}};
}

}  // namespace

const std::vector<PbrtEntry>& pbrt_cameras() {
    static const std::vector<PbrtEntry> entries = {
        {"perspective", kV3And4, "Becomes perspective, or thinlens where it has a lens.",
         std::vector<PbrtParamInfo>{
             {"fov", ParamKind::Float, "90", "Field of view in degrees of the shorter side."},
             {"halffov", ParamKind::Float, "", "Half of it, instead.", kV3}} +
             camera_params(),
         make_perspective},
        {"orthographic", kV3And4, "Becomes orthographic.", camera_params(), make_orthographic},
        {"realistic",
         kV3And4,
         "Rejected: cameras with systems of lenses are not supported.",
         {},
         nullptr},
        {"spherical", kV4, "Rejected: there is no such sensor.", {}, nullptr},
        {"environment", kV3, "Rejected: there is no such sensor.", {}, nullptr},
    };
    return entries;
}

const std::vector<PbrtEntry>& pbrt_films() {
    static const std::vector<PbrtEntry> entries = {
        {"image", kV3, "Becomes hdrfilm.", film_params(), make_film},
        {"rgb", kV4, "Becomes hdrfilm.", film_params(), make_film},
        {"gbuffer", kV4, "Becomes hdrfilm; see --aov for what else it shows.",
         film_params() + std::vector<PbrtParamInfo>{{"coordinatesystem", ParamKind::String, "",
                                                     "Accepted; without effect."}},
         make_film},
        {"spectral", kV4, "Becomes hdrfilm, in RGB.",
         film_params() +
             std::vector<PbrtParamInfo>{
                 {"nbuckets", ParamKind::Int, "", "Accepted; without effect."},
                 {"lambdamin", ParamKind::Float, "", "Accepted; without effect."},
                 {"lambdamax", ParamKind::Float, "", "Accepted; without effect."}},
         make_film},
    };
    return entries;
}

const std::vector<PbrtEntry>& pbrt_filters() {
    static const std::vector<PbrtEntry> entries = {
        {"box", kV3And4, "Becomes box, of one pixel.", filter_params("0.5", "0.5"), make_box},
        {"triangle", kV3And4, "Becomes tent.", filter_params("2", "2"), make_triangle},
        {"gaussian", kV3And4,
         "Becomes gaussian, cut off at four standard deviations whatever the radius.",
         filter_params("2", "1.5") +
             std::vector<PbrtParamInfo>{
                 {"alpha", ParamKind::Float, "2", "Of exp(-alpha x²).", kV3},
                 {"sigma", ParamKind::Float, "0.5", "Standard deviation in pixels.", kV4}},
         make_gaussian},
        {"mitchell", kV3And4, "Becomes mitchell, of radius 2.",
         filter_params("2", "2") +
             std::vector<PbrtParamInfo>{{"B", ParamKind::Float, "1/3", "Blur."},
                                        {"C", ParamKind::Float, "1/3", "Ringing."}},
         make_mitchell},
        {"sinc", kV3And4, "Becomes lanczos with tau lobes, whatever the radius.",
         filter_params("4", "4") +
             std::vector<PbrtParamInfo>{{"tau", ParamKind::Float, "3", "Width of the window."}},
         make_sinc},
    };
    return entries;
}

const std::vector<PbrtEntry>& pbrt_samplers() {
    static const std::vector<PbrtEntry> entries = [] {
        std::vector<PbrtEntry> all;
        const std::vector<PbrtParamInfo> shared = {
            {"pixelsamples", ParamKind::Int, "16",
             "Samples per pixel, unless the command line says."},
            {"seed", ParamKind::Int, "", "Accepted; the command line's seed counts."},
            {"dimensions", ParamKind::Int, "", "Accepted; without effect."},
            {"jitter", ParamKind::Bool, "", "Accepted; without effect."},
            {"samplepixelcenter", ParamKind::Bool, "", "Accepted; without effect."},
            {"randomization", ParamKind::String, "", "Accepted; without effect."},
            {"xsamples", ParamKind::Int, "4",
             "Of stratified: samples of a pixel are xsamples·ysamples."},
            {"ysamples", ParamKind::Int, "4", "Of stratified: see xsamples."}};
        for (const auto& [name, versions] : {std::pair("halton", kV3And4),
                                             {"sobol", kV3And4},
                                             {"stratified", kV3And4},
                                             {"independent", kV4},
                                             {"paddedsobol", kV4},
                                             {"zsobol", kV4},
                                             {"pmj02bn", kV4},
                                             {"random", kV3},
                                             {"02sequence", kV3},
                                             {"lowdiscrepancy", kV3},
                                             {"maxmindist", kV3}})
            all.push_back({name, versions, "Taken for its sample count; see --sampler.", shared,
                           make_sampler});
        return all;
    }();
    return entries;
}

const std::vector<PbrtEntry>& pbrt_integrators() {
    static const std::vector<PbrtEntry> entries = [] {
        std::vector<PbrtEntry> all;
        for (const IntegratorUse& use : integrator_uses()) {
            std::vector<PbrtParamInfo> params = {
                {"maxdepth", ParamKind::Int, "5",
                 "Scatterings of the longest path; etendue's max_depth is one more."}};
            for (const IntegratorParam& p : use.params) params.push_back(p.info);
            const std::string_view by = use.integrator;
            all.push_back({use.name, use.versions,
                           use.is_substitute ? "Replaced by path, with a warning."
                           : by == "bdpt"    ? "Rendered by bdpt."
                           : by == "ptracer" ? "Rendered by light."
                           : by == "sppm"    ? "Rendered by sppm."
                           : by == "mmlt"    ? "Rendered by mmlt."
                                             : "Rendered by path.",
                           params, make_integrator});
        }
        return all;
    }();
    return entries;
}

}  // namespace etendue
