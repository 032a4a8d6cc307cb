#include "scene/plain_emitters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "description/resolve_file.h"
#include "emitter/environment.h"
#include "emitter/point.h"
#include "emitter/sky_model.h"
#include "math/frame.h"
#include "scene/builder.h"

namespace etendue {
namespace {

/// Gives an emitter an image as its parameter `name`. Adds an object, which moves all others in memory.
void add_image(PlainScene& s, int emitter, const char* name, const char* filter, int width,
               int height, const std::vector<Rgb>& pixels) {
    const SourceLocation where = s.object(emitter).where;
    SceneObject bitmap{"texture", "bitmap", "", where, {}, {}};
    set(bitmap, "filter_type", std::string(filter));
    set(bitmap, "wrap_mode", std::string("clamp"));
    set(bitmap, "raw", true);
    s.set_image(bitmap, pfm(width, height, pixels));
    const int texture = s.add(std::move(bitmap));
    s.object(emitter).children.push_back({name, texture, where});
}

/// Factor from the intensity to the pixels of a projector, toward a point of its plane at the distance 1.
float projector_factor(double px, double py) {
    const double cos_theta = 1 / std::sqrt(1 + px * px + py * py);
    return float(cos_theta * cos_theta * cos_theta / std::numbers::pi);
}

void become_projector(SceneObject& o, const Transform& to_world, double fov) {
    o.type = "projector";
    o.params.clear();
    set(o, "to_world", to_world);
    set(o, "fov", fov);
    set(o, "fov_axis", std::string("smaller"));
}

/// The space whose axes are those of `f`, at a point.
Transform looking_along(const Frame& f, Vec3 at) {
    return Transform(Transform::Matrix{{{f.s.x, f.t.x, f.n.x, at.x},
                                        {f.s.y, f.t.y, f.n.y, at.y},
                                        {f.s.z, f.t.z, f.n.z, at.z},
                                        {0, 0, 0, 1}}});
}

/// Mitsuba's projector has a factor 1 / cos³ θ that the projection lacks. It varies within pixels, so these are
/// divided.
void replace_projection(PlainScene& s, int index) {
    SceneObject& o = s.object(index);
    const ProjectionLight light = read_projection({s.original(), index});
    const RgbImage& image = light.image;
    const int parts = (kBakedSize + std::min(image.width, image.height) - 1) /
                      std::min(image.width, image.height);
    const int width = parts * image.width, height = parts * image.height;
    std::vector<Rgb> pixels;
    pixels.reserve(size_t(width) * size_t(height));
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double px = light.half_width * ((2.0 * x + 1) / width - 1),
                         py = light.half_height * ((2.0 * y + 1) / height - 1);
            pixels.push_back(
                image.pixels[size_t(y / parts) * size_t(image.width) + size_t(x / parts)] *
                projector_factor(px, py));
        }
    const Param* to_world = o.find("to_world");
    // Cameras have +x on the left.
    const Transform mirrored =
        (to_world ? *to_world->as<Transform>() : Transform()) * Transform::scale({-1, 1, 1});
    become_projector(o, mirrored, double(light.fov));
    add_image(s, index, "irradiance", "nearest", width, height, pixels);
}

/// Projectors through the six faces of a cube.
void replace_goniometric(PlainScene& s, int index) {
    constexpr int kFace = kBakedSize / 2;
    const Params params(s.original(), index);
    const std::unique_ptr<Emitter> light = read_goniometric(params);
    const Vec3 at = params.transform("to_world").point({0, 0, 0});
    s.warn(s.object(index),
           fmt::format("Mitsuba 3 has no emitter \"goniometric\": six of \"projector\" "
                       "with images of {}×{} pixels stand in for it",
                       kFace, kFace));
    for (const Vec3 axis :
         {Vec3{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}) {
        const Frame f = Frame::from_normal(axis);
        std::vector<Rgb> pixels;
        for (int y = 0; y < kFace; ++y)
            for (int x = 0; x < kFace; ++x) {
                // Cameras have +x on the left.
                const double px = 1 - (2.0 * x + 1) / kFace, py = 1 - (2.0 * y + 1) / kFace;
                const Vec3 d = normalize(f.to_world({float(px), float(py), 1}));
                pixels.push_back(light->eval_emission({}, {}, 0, d).Le_cos *
                                 projector_factor(px, py));
            }
        // The first face takes the place of the light.
        int face = index;
        if (axis.x < 1) {
            face = s.add({"emitter", "projector", "", s.object(index).where, {}, {}});
            s.scene().roots.push_back(face);
        }
        become_projector(s.object(face), looking_along(f, at), 90);
        add_image(s, face, "irradiance", "bilinear", kFace, kFace, pixels);
    }
}

/// Mitsuba's spots fall off linearly in the angle. Another falloff becomes a texture of all that the cone holds.
void replace_falloff(PlainScene& s, int index) {
    SceneObject& o = s.object(index);
    if (text(o, "falloff", "angle") == "angle") {
        remove(o, "falloff");
        return;
    }
    // Wider cones have too few pixels in the middle.
    constexpr float kLeastCosine = 0.15f;
    const Params params(s.original(), index);
    const Beam beam = read_beam(params);
    if (has(o, "texture") || 1 - beam.versine_of_cutoff() < kLeastCosine) return;
    std::vector<Rgb> pixels;
    for (int y = 0; y < kBakedSize; ++y)
        for (int x = 0; x < kBakedSize; ++x) {
            const auto on_plane = [&](int i) {
                return beam.tan_cutoff() * (float(2 * i + 1) / kBakedSize - 1);
            };
            pixels.emplace_back(beam.share_on_plane(sqr(on_plane(x)) + sqr(on_plane(y))));
        }
    s.warn(o, fmt::format("Mitsuba 3 has no falloff \"{}\": it becomes an image of {}×{} pixels",
                          text(o, "falloff", ""), kBakedSize, kBakedSize));
    const Transform to_world = params.transform("to_world");
    // A light with an image has no distorted space; the image is the same all around the axis.
    set(o, "to_world",
        looking_along(Frame::from_normal(normalize(to_world.vector({0, 0, 1}))),
                      to_world.point({0, 0, 0})));
    set(o, "beam_width", double(params.number("cutoff_angle", 20)));
    remove(o, "falloff");
    add_image(s, index, "texture", "bilinear", kBakedSize, kBakedSize, pixels);
}

/// An image in the equal-area projection as one of latitudes and longitudes. Its pixels have one colour each here, and
/// their edges stay sharp only in an image that is much finer.
RgbImage latitudes_and_longitudes(const RgbImage& square) {
    RgbImage out;
    out.height = std::max(kBakedSize, square.height), out.width = 2 * out.height;
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            const float theta = kPi * (float(y) + 0.5f) / float(out.height),
                        phi = 2 * kPi * (float(x) + 0.5f) / float(out.width);
            const Vec3 d{std::sin(phi) * std::sin(theta), std::cos(theta),
                         -std::cos(phi) * std::sin(theta)};
            const Vec2 uv = equal_area_square(d);
            const auto texel = [](float u, int n) {
                return std::clamp(int(u * float(n)), 0, n - 1);
            };
            out.pixels.push_back(
                square.pixels[size_t(texel(uv.y, square.height)) * size_t(square.width) +
                              size_t(texel(uv.x, square.width))]);
        }
    return out;
}

void replace_environment(PlainScene& s, int index) {
    SceneObject& o = s.object(index);
    const Param* file = o.find("filename");
    const std::string* name = file ? file->as<std::string>() : nullptr;
    const Param* projection = o.find("projection");
    const bool is_equal_area =
        projection && *projection->as<std::string>() == std::string("equalarea");
    const Rgb tint = rgb(o, "tint", Rgb(1));
    remove(o, "projection"), remove(o, "tint");
    const bool is_embedded = embedded_image({s.original(), index}) != nullptr;
    if (!name && !is_embedded) return;
    if (!is_equal_area && tint == Rgb(1) && (is_embedded || reads_image(*name))) return;
    RgbImage image = read_emission_image({s.original(), index}, tint);
    if (is_equal_area) {
        image = latitudes_and_longitudes(image);
        s.warn(o, fmt::format("Mitsuba 3 has no equal-area projection: the image becomes one of "
                              "latitudes and longitudes, {}×{} pixels",
                              image.width, image.height));
    }
    remove(o, "filename");
    s.set_image(o, pfm(image.width, image.height, image.pixels));
}

}  // namespace

void replace_emitter(PlainScene& s, int index) {
    SceneObject& o = s.object(index);
    if (o.type == "sky" || o.type == "sun" || o.type == "sunsky") {
        const double scale = number(o, "scale", 1);
        const std::string type = o.type;
        if (type != "sunsky" || scale != 1) {
            set(o, "sky_scale", type == "sun" ? 0 : scale * number(o, "sky_scale", 1));
            set(o, "sun_scale", type == "sky" ? 0 : scale * number(o, "sun_scale", 1));
        }
        if (o.find("sun_radius_scale"))
            set(o, "sun_aperture", kSunAperture * number(o, "sun_radius_scale", 1));
        if (o.find("resolution"))
            s.warn(o, fmt::format("Mitsuba 3 has no parameter \"resolution\" of emitter \"{}\": "
                                  "left out",
                                  type));
        for (const char* name : {"scale", "sun_radius_scale", "resolution"}) remove(o, name);
        o.type = "sunsky";
    }
    if (o.type == "area") {
        const Param* p = o.find("two_sided");
        if (p && !std::get<bool>(p->value)) remove(o, "two_sided");
    }
    // Each of these may add objects, which moves `o`.
    if (o.type == "envmap")
        replace_environment(s, index);
    else if (o.type == "spot")
        replace_falloff(s, index);
    else if (o.type == "projection")
        replace_projection(s, index);
    else if (o.type == "goniometric")
        replace_goniometric(s, index);
}

void report_masked_emission(PlainScene& s, int index) {
    const SceneObject& o = s.original().objects[size_t(index)];
    if (o.category != "shape") return;
    const bool emits = std::any_of(o.children.begin(), o.children.end(), [&](const auto& c) {
        return s.original().objects[size_t(c.object)].category == "emitter";
    });
    const bool is_masked = s.depends_on(index, [](const SceneObject& part) {
        return part.category == "bsdf" && part.type == "mask";
    });
    if (emits && is_masked)
        s.warn(o, "Mitsuba 3 lets the emission of a shape through its mask: it emits everywhere");
}

void keep_one_environment(PlainScene& s) {
    bool has_one = false;
    std::erase_if(s.scene().roots, [&](int root) {
        const SceneObject& o = s.object(root);
        if (o.category != "emitter" ||
            (o.type != "constant" && o.type != "envmap" && o.type != "sunsky"))
            return false;
        if (has_one)
            s.warn(o, fmt::format("Mitsuba 3 has one environment alone: emitter \"{}\" is left "
                                  "out",
                                  o.type));
        return std::exchange(has_one, true);
    });
}

}  // namespace etendue
