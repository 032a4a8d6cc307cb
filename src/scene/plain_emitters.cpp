#include "scene/plain_emitters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "emitter/environment.h"
#include "emitter/point.h"
#include "emitter/sky_model.h"
#include "scene/builder.h"

namespace etendue {
namespace {

Rgb mean_of(const RgbImage& image) {
    double sum[3] = {};
    for (const Rgb& c : image.pixels)
        for (int i = 0; i < 3; ++i) sum[i] += double(c[i]);
    const double n = double(image.pixels.size());
    return {float(sum[0] / n), float(sum[1] / n), float(sum[2] / n)};
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
                         py = light.half_height * ((2.0 * y + 1) / height - 1),
                         cos_theta = 1 / std::sqrt(1 + px * px + py * py);
            pixels.push_back(
                image.pixels[size_t(y / parts) * size_t(image.width) + size_t(x / parts)] *
                float(cos_theta * cos_theta * cos_theta / std::numbers::pi));
        }
    const Param* to_world = o.find("to_world");
    // Cameras have +x on the left.
    const Transform mirrored =
        (to_world ? *to_world->as<Transform>() : Transform()) * Transform::scale({-1, 1, 1});
    o.type = "projector";
    o.params.clear();
    set(o, "to_world", mirrored);
    set(o, "fov", double(light.fov));
    set(o, "fov_axis", std::string("smaller"));
    SceneObject bitmap{"texture", "bitmap", "", o.where, {}, {}};
    set(bitmap, "filter_type", std::string("nearest"));
    set(bitmap, "raw", true);
    s.set_image(bitmap, pfm(width, height, pixels));
    const SourceLocation where = o.where;
    const int texture = s.add(std::move(bitmap));  // which moves all objects
    s.object(index).children.push_back({"irradiance", texture, where});
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
    if (!name || (!is_equal_area && tint == Rgb(1) && reads_image(*name))) return;
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
        for (const char* name : {"scale", "sun_radius_scale", "resolution"}) remove(o, name);
        o.type = "sunsky";
    }
    if (o.type == "area" && !o.find("power")) {
        const Param* p = o.find("two_sided");
        if (p && !std::get<bool>(p->value)) remove(o, "two_sided");
    }
    if (o.type == "envmap") replace_environment(s, index);
    if (o.type == "projection") replace_projection(s, index);
    if (o.type == "goniometric") {
        // The same intensity in all directions.
        Rgb mean(1);
        if (!o.find("power"))
            mean = mean_of(read_emission_image({s.original(), index}, rgb(o, "intensity", Rgb(1))));
        const Param* to_world = o.find("to_world");
        const Vec3 at = to_world ? to_world->as<Transform>()->point({0, 0, 0}) : Vec3{0, 0, 0};
        s.stand_in(o, "point");
        o.params.clear();
        set(o, "position", at);
        set(o, "intensity", mean);
    }
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
