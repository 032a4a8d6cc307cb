#include "scene/plain_mitsuba.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <set>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "bsdf/coat.h"
#include "bsdf/ior.h"
#include "color/metals.h"
#include "emitter/environment.h"
#include "emitter/point.h"
#include "emitter/sky_model.h"
#include "scene/builder.h"
#include "scene/mitsuba_manual.h"
#include "scene/model_builder.h"

namespace etendue {
namespace {

/// Whether one of Mitsuba 3's documented parameters has this name.
bool documents(const ManualEntry& entry, const std::string& param) {
    const std::string all = fmt::format(" {} {} ", entry.params, entry.params_3);
    return all.find(" " + param + " ") != all.npos;
}

const ManualEntry* entry_of_mitsuba_3(const SceneObject& o) {
    const ManualEntry* entry = find_manual_entry(o.category, o.type);
    return entry && (entry->manuals & kMitsuba3) ? entry : nullptr;
}

/// The bytes of an image file with these pixels, from the top row to the bottom one.
std::string pfm(int width, int height, const std::vector<Rgb>& pixels) {
    std::string out = fmt::format("PF\n{} {}\n-1\n", width, height);
    for (int y = height; y-- > 0;)
        for (int x = 0; x < width; ++x) {
            const Rgb& c = pixels[size_t(y) * size_t(width) + size_t(x)];
            const float channels[] = {c.r, c.g, c.b};
            out.append(reinterpret_cast<const char*>(channels), sizeof channels);
        }
    return out;
}

/// Whether Mitsuba 3 reads image files of this kind.
bool reads_image(const std::string& file) {
    static const std::set<std::string> known = {".exr", ".hdr",  ".rgbe", ".pfm", ".png",
                                                ".jpg", ".jpeg", ".bmp",  ".tga"};
    return known.count(image_extension(file)) > 0;
}

class Plainer {
public:
    explicit Plainer(SceneDescription& scene)
        : scene_(scene), original_(without_meshes(scene)), lookup_(original_, true),
          models_(lookup_) {}

    std::vector<std::string> run() {
        for (const SceneObject& o : original_.objects) has_media_ |= o.category == "medium";
        // Objects that are added on the way are plain.
        const size_t count = scene_.objects.size();
        for (size_t i = 0; i < count; ++i) replace_textures(int(i));
        for (size_t i = 0; i < count; ++i) unwrap_relief(int(i));
        for (size_t i = 0; i < count; ++i) report_masked_emission(int(i));
        for (size_t i = 0; i < count; ++i) replace(int(i));
        for (size_t i = 0; i < scene_.objects.size(); ++i) hoist_masks(int(i));
        for (size_t i = 0; i < count; ++i) strip(int(i));
        keep_one_environment();
        return warnings_;
    }

private:
    static SceneDescription without_meshes(const SceneDescription& scene) {
        SceneDescription out;
        out.objects = scene.objects;
        out.roots = scene.roots;
        out.images = scene.images;
        out.file = scene.file;
        out.search_paths = scene.search_paths;
        return out;
    }

    SceneObject& object(int index) { return scene_.objects[size_t(index)]; }

    void warn(const SceneObject& o, const std::string& message) {
        const std::string line = SceneError(o.where, message).what();
        if (std::find(warnings_.begin(), warnings_.end(), line) == warnings_.end())
            warnings_.push_back(line);
    }
    /// `o` becomes `type`, which is not the same.
    void stand_in(SceneObject& o, const std::string& type) {
        warn(o, fmt::format("Mitsuba 3 has no {0} \"{1}\": {0} \"{2}\" stands in for it",
                            o.category, o.type, type));
        o.type = type;
        stand_ins_.insert(&o - scene_.objects.data());
    }

    // ---- Parameters

    static bool has(const SceneObject& o, std::string_view name) {
        return o.find(name) ||
               std::any_of(o.children.begin(), o.children.end(),
                           [&](const SceneObject::Child& c) { return c.name == name; });
    }
    static void remove(SceneObject& o, std::string_view name) {
        std::erase_if(o.params, [&](const Param& p) { return p.name == name; });
        std::erase_if(o.children, [&](const SceneObject::Child& c) { return c.name == name; });
    }
    static void set(SceneObject& o, const std::string& name, ParamValue value) {
        remove(o, name);
        o.params.push_back({name, std::move(value), o.where});
    }
    static void rename(SceneObject& o, std::string_view from, const std::string& to) {
        for (Param& p : o.params)
            if (p.name == from) p.name = to;
        for (SceneObject::Child& c : o.children)
            if (c.name == from) c.name = to;
    }
    static double number(const SceneObject& o, std::string_view name, double fallback) {
        const Param* p = o.find(name);
        if (!p) return fallback;
        if (const auto* i = p->as<int64_t>()) return double(*i);
        if (const auto* d = p->as<double>()) return *d;
        if (const auto* c = p->as<Rgb>()) return double(luminance(*c));
        return fallback;
    }
    static std::string text(const SceneObject& o, std::string_view name,
                            std::string_view fallback) {
        const Param* p = o.find(name);
        const auto* s = p ? p->as<std::string>() : nullptr;
        return s ? *s : std::string(fallback);
    }
    static Rgb rgb(const SceneObject& o, std::string_view name, Rgb fallback) {
        const Param* p = o.find(name);
        if (!p) return fallback;
        if (const auto* c = p->as<Rgb>()) return *c;
        return Rgb(float(number(o, name, 0)));
    }

    // ---- Textures

    /// Whether Mitsuba 3 has the texture and all that it is made of.
    bool is_plain_texture(int index) const {
        const SceneObject& o = original_.objects[size_t(index)];
        if (!entry_of_mitsuba_3(o)) return false;
        const Param* file = o.find("filename");
        const std::string* name = file ? file->as<std::string>() : nullptr;
        if (o.type == "bitmap" && (o.find("channel") || (name && !reads_image(*name))))
            return false;
        if (o.type == "mesh_attribute" && text(o, "name", "vertex_color") != "vertex_color")
            return false;
        return std::all_of(o.children.begin(), o.children.end(),
                           [&](const auto& c) { return is_plain_texture(c.object); });
    }
    bool depends_on(int index, const std::function<bool(const SceneObject&)>& what) const {
        const SceneObject& o = original_.objects[size_t(index)];
        return what(o) || std::any_of(o.children.begin(), o.children.end(),
                                      [&](const auto& c) { return depends_on(c.object, what); });
    }

    static bool is_relief(const SceneObject& o) {
        return o.category == "bsdf" && (o.type == "bumpmap" || o.type == "normalmap");
    }

    /// Mitsuba 3 wraps in the same way along u and v, and its images have no end.
    void replace_wrapping(SceneObject& o) {
        const std::string u = text(o, "wrap_mode", "repeat"), v = text(o, "wrap_mode_v", u);
        const auto known = [](const std::string& mode) {
            return mode == "zero" || mode == "one" ? "clamp" : mode;
        };
        if (v != u)
            warn(o, fmt::format("Mitsuba 3 wraps images in the same way along u and v: \"{}\" "
                                "stands in for \"{}\" along v",
                                known(u), v));
        if (known(u) != u)
            warn(o,
                 fmt::format("Mitsuba 3 has no wrap mode \"{}\": \"clamp\" stands in for it", u));
        remove(o, "wrap_mode_v");
        if (o.find("wrap_mode")) set(o, "wrap_mode", known(u));
    }

    void replace_textures(int index) {
        if (object(index).category == "texture") {
            if (object(index).type == "bitmap") replace_wrapping(object(index));
            return;
        }
        const SceneObject parent = object(index);
        for (const SceneObject::Child& c : parent.children) {
            if (scene_.objects[size_t(c.object)].category != "texture") continue;
            const bool needs_number = c.name.starts_with("alpha") && parent.type == "roughplastic";
            // Mitsuba 3 knows the gradient of images alone.
            const bool needs_image =
                parent.type == "bumpmap" && original_.objects[size_t(c.object)].type != "bitmap";
            if (is_plain_texture(c.object) && !needs_number && !needs_image) continue;
            const Texture* texture = models_.make_texture(c.object);
            const bool is_uniform = !depends_on(c.object, [](const SceneObject& o) {
                return o.type != "constant" && o.type != "scale" && o.type != "mix" &&
                       o.type != "roughness_to_alpha";
            });
            const bool is_baked =
                texture && !is_uniform && !needs_number && !depends_on(c.object, is_of_space);
            if (is_baked) {
                const auto child = std::find_if(
                    object(index).children.begin(), object(index).children.end(),
                    [&](const auto& k) { return k.object == c.object && k.name == c.name; });
                child->object = baked(c.object, *texture);
                continue;
            }
            if (is_relief(parent)) {  // unwrap_relief() leaves it out
                if (!is_uniform)
                    warn(original_.objects[size_t(c.object)],
                         fmt::format("Mitsuba 3 has no such texture for bsdf \"{}\": the relief "
                                     "is left out",
                                     parent.type));
                remove_child(index, c.object);
                continue;
            }
            if (!is_uniform)
                warn(original_.objects[size_t(c.object)],
                     fmt::format("Mitsuba 3 has no such texture for \"{}\" of {} \"{}\": its mean "
                                 "stands in for it",
                                 c.name, parent.category, parent.type));
            const Rgb mean = texture ? texture->mean() : Rgb(0.5f);
            if (c.name.empty())
                remove_child(index, c.object);
            else if (needs_number)
                set(object(index), c.name, double(luminance(mean)));
            else
                set(object(index), c.name, mean);
        }
    }
    /// A relief without texture, which Mitsuba 3 refuses, is the material that it wraps.
    void unwrap_relief(int index) {
        const SceneObject& o = object(index);
        if (!is_relief(o)) return;
        int inner = -1;
        for (const auto& c : o.children) {
            if (object(c.object).category == "texture") return;
            if (object(c.object).category == "bsdf") inner = c.object;
        }
        if (inner < 0) return;
        for (SceneObject& parent : scene_.objects)
            for (auto& c : parent.children)
                if (c.object == index) c.object = inner;
        const bool is_root =
            std::find(scene_.roots.begin(), scene_.roots.end(), inner) != scene_.roots.end();
        if (is_root)
            std::erase(scene_.roots, index);
        else
            std::replace(scene_.roots.begin(), scene_.roots.end(), index, inner);
    }
    void remove_child(int index, int child) {
        std::erase_if(object(index).children, [&](const auto& k) { return k.object == child; });
    }

    /// Whether a texture is a function of more than (u, v).
    static bool is_of_space(const SceneObject& o) {
        if (o.type == "mesh_attribute") return true;
        const auto& all = texture_registry();
        return std::any_of(all.begin(), all.end(), [&](const TextureEntry& e) {
            return o.type == e.info.name && e.is_solid;
        });
    }

    /// An image of the texture over the unit square.
    int baked(int index, const Texture& texture) {
        if (const auto it = baked_.find(index); it != baked_.end()) return it->second;
        const SceneObject& original = original_.objects[size_t(index)];
        int width, height;
        texture.resolution(width, height);
        // Edges between the cells of the grid stay sharp only in an image that is much finer.
        if (original.type != "bitmap")
            width *= 1 + kBakedSize / width, height *= 1 + kBakedSize / height;
        if (std::max(width, height) > kLargestBaked)
            warn(original, fmt::format("the image of {}×{} pixels is reduced", width, height));
        width = std::min(width, kLargestBaked), height = std::min(height, kLargestBaked);
        std::vector<Rgb> pixels;
        pixels.reserve(size_t(width) * size_t(height));
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                pixels.push_back(texture.eval(TexturePoint((float(x) + 0.5f) / float(width),
                                                           (float(y) + 0.5f) / float(height))));
        if (original.type != "bitmap" || original.find("to_uv"))
            warn(original, fmt::format("texture \"{}\" becomes an image of {}×{} pixels over the "
                                       "unit square",
                                       original.type, width, height));
        SceneObject bitmap{"texture", "bitmap", "", original.where, {}, {}};
        set(bitmap, "raw", true);
        for (const char* name : {"filter_type", "wrap_mode", "wrap_mode_v"})
            if (const Param* p = original.find(name)) bitmap.params.push_back(*p);
        replace_wrapping(bitmap);
        set_image(bitmap, pfm(width, height, pixels));
        return baked_[index] = add(std::move(bitmap));
    }
    void set_image(SceneObject& o, std::string bytes) {
        set(o, "image", int64_t(scene_.images.size()));
        scene_.images.push_back(EncodedImage{"texture", std::move(bytes)});
    }
    int add(SceneObject&& o) {
        scene_.objects.push_back(std::move(o));
        return int(scene_.objects.size()) - 1;
    }

    // ---- Plug-ins

    /// Emission of a shape is hidden by its mask here, but not in Mitsuba 3.
    void report_masked_emission(int index) {
        const SceneObject& o = original_.objects[size_t(index)];
        if (o.category != "shape") return;
        const bool emits = std::any_of(o.children.begin(), o.children.end(), [&](const auto& c) {
            return original_.objects[size_t(c.object)].category == "emitter";
        });
        const bool is_masked = depends_on(index, [](const SceneObject& part) {
            return part.category == "bsdf" && part.type == "mask";
        });
        if (emits && is_masked)
            warn(o, "Mitsuba 3 lets the emission of a shape through its mask: it emits everywhere");
    }

    void replace(int index) {
        SceneObject& o = object(index);
        if (o.category == "integrator") replace_integrator(o);
        if (o.category == "film") replace_film(o);
        // Meshes are the same with and without them.
        if (o.category == "shape") remove(o, "collapse"), remove(o, "max_smooth_angle");
        if (o.category == "sampler") o.type = "independent";
        if (o.category == "rfilter" && o.type == "mitchell")
            rename(o, "b", "B"), rename(o, "c", "C");
        if (o.category == "sensor") replace_sensor(o);
        if (o.category == "medium") replace_medium(o);
        if (o.type == "mesh_attribute" && !o.find("name"))
            set(o, "name", std::string("vertex_color"));
        // These may add objects, which moves `o`.
        if (o.category == "emitter")
            replace_emitter(index);
        else if (o.category == "bsdf")
            replace_bsdf(index);
    }

    void replace_integrator(SceneObject& o) {
        // Wrappers and integrators without an image become their inner one, or path.
        SceneObject inner = o;
        for (const SceneObject* at = &o; at;) {
            inner = *at;
            at = nullptr;
            for (const auto& c : inner.children)
                if (object(c.object).category == "integrator") at = &object(c.object);
        }
        o.params = inner.params;
        o.children.clear();
        const bool is_direct = inner.type == "direct";
        o.type = is_direct ? "direct" : has_media_ ? "volpath" : "path";
        std::erase_if(o.params, [&](const Param& p) {
            return p.name != "hide_emitters" &&
                   (is_direct || (p.name != "max_depth" && p.name != "rr_depth"));
        });
    }

    static void replace_film(SceneObject& o) {
        o.type = "hdrfilm";
        rename(o, "high_quality_edges", "sample_border");
        // How the image is stored is not part of the scene, and Mitsuba 3 knows fewer formats.
        for (const char* name :
             {"file_format", "pixel_format", "component_format", "banner", "attach_log",
              "tonemap_method", "gamma", "exposure", "key", "burn", "digits", "variable"})
            remove(o, name);
    }

    void replace_sensor(SceneObject& o) {
        double width = 768, height = 576;
        for (const auto& c : o.children)
            if (object(c.object).category == "film") {
                width = number(object(c.object), "width", width);
                height = number(object(c.object), "height", height);
            }
        if (std::fabs(number(o, "aspect", width / height) * height / width - 1) < 1e-3)
            remove(o, "aspect");
        for (const char* name : {"principal_point_offset_x", "principal_point_offset_y"})
            if (number(o, name, 0) == 0) remove(o, name);
    }

    void replace_medium(SceneObject& o) {
        if (has(o, "sigma_a") || has(o, "sigma_s")) {
            const Rgb a = rgb(o, "sigma_a", Rgb(0)), s = rgb(o, "sigma_s", Rgb(0)), t = a + s;
            const auto share = [](float x, float of) { return of > 0 ? x / of : 0; };
            remove(o, "sigma_a"), remove(o, "sigma_s");
            set(o, "sigma_t", t);
            set(o, "albedo", Rgb(share(s.r, t.r), share(s.g, t.g), share(s.b, t.b)));
        }
        // Mitsuba 3 takes colours of at most 1.
        if (const Rgb t = rgb(o, "sigma_t", Rgb(0)); t.max() > 1) {
            set(o, "sigma_t", t * (1 / t.max()));
            set(o, "scale", number(o, "scale", 1) * double(t.max()));
        }
        if (o.find("material") && !o.find("sigma_t"))
            warn(o, "Mitsuba 3 has no named media: the material is left out");
        remove(o, "material");
    }

    void replace_emitter(int index) {
        SceneObject& o = object(index);
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
        if (o.type == "envmap") replace_environment(index);
        if (o.type == "projection") replace_projection(index);
        if (o.type == "goniometric") {
            // The same intensity in all directions.
            Rgb mean(1);
            if (!o.find("power"))
                mean =
                    mean_of(read_emission_image({original_, index}, rgb(o, "intensity", Rgb(1))));
            const Param* to_world = o.find("to_world");
            const Vec3 at = to_world ? to_world->as<Transform>()->point({0, 0, 0}) : Vec3{0, 0, 0};
            stand_in(o, "point");
            o.params.clear();
            set(o, "position", at);
            set(o, "intensity", mean);
        }
    }
    static Rgb mean_of(const RgbImage& image) {
        double sum[3] = {};
        for (const Rgb& c : image.pixels)
            for (int i = 0; i < 3; ++i) sum[i] += double(c[i]);
        const double n = double(image.pixels.size());
        return {float(sum[0] / n), float(sum[1] / n), float(sum[2] / n)};
    }

    /// Mitsuba's projector has a factor 1 / cos³ θ that the projection lacks. It varies within pixels, so these are
    /// divided.
    void replace_projection(int index) {
        SceneObject& o = object(index);
        const ProjectionLight light = read_projection({original_, index});
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
        set_image(bitmap, pfm(width, height, pixels));
        const SourceLocation where = o.where;
        const int texture = add(std::move(bitmap));  // which moves all objects
        object(index).children.push_back({"irradiance", texture, where});
    }

    void replace_environment(int index) {
        SceneObject& o = object(index);
        const Param* file = o.find("filename");
        const std::string* name = file ? file->as<std::string>() : nullptr;
        const Param* projection = o.find("projection");
        const bool is_equal_area =
            projection && *projection->as<std::string>() == std::string("equalarea");
        const Rgb tint = rgb(o, "tint", Rgb(1));
        remove(o, "projection"), remove(o, "tint");
        if (!name || (!is_equal_area && tint == Rgb(1) && reads_image(*name))) return;
        RgbImage image = read_emission_image({original_, index}, tint);
        if (is_equal_area) {
            image = latitudes_and_longitudes(image);
            warn(o, fmt::format("Mitsuba 3 has no equal-area projection: the image becomes one of "
                                "latitudes and longitudes, {}×{} pixels",
                                image.width, image.height));
        }
        remove(o, "filename");
        set_image(o, pfm(image.width, image.height, image.pixels));
    }
    /// An image in the equal-area projection as one of latitudes and longitudes. Its pixels have one colour each here, and
    /// their edges stay sharp only in an image that is much finer.
    static RgbImage latitudes_and_longitudes(const RgbImage& square) {
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

    void replace_bsdf(int index) {
        // Options of newer versions that depend on which direction is the view's, and are on by default.
        if (object(index).type == "bumpmap" || object(index).type == "normalmap")
            for (const char* name : {"flip_invalid_normals", "use_shadowing_function"})
                set(object(index), name, false);
        if (object(index).type == "mixturebsdf") return replace_mixture(index);
        SceneObject& o = object(index);
        if (o.type == "orennayar") {
            stand_in(o, "diffuse");
        } else if (o.type == "diffusetransmission") {
            const double r = number(o, "reflectance", 0.25), t = number(o, "transmittance", 0.25);
            const Rgb sum = rgb(o, "reflectance", Rgb(0.25f)) + rgb(o, "transmittance", Rgb(0.25f));
            stand_in(o, "principledthin");
            // Twice the share of what is transmitted.
            set(o, "diff_trans", r + t > 0 ? 2 * t / (r + t) : 1);
            set(o, "roughness", 1.0);
            set(o, "eta", 1.001);
            if (has_texture(o, "transmittance"))
                rename(o, "transmittance", "base_color");
            else
                set(o, "base_color", sum);
            remove(o, "reflectance"), remove(o, "transmittance");
        } else if (o.type == "phong") {
            const double n = number(o, "exponent", 30);
            stand_in(o, "roughplastic");
            remove(o, "exponent");
            set(o, "alpha", std::sqrt(2 / (n + 2)));
        } else if (o.type == "fresnelblend") {
            const double r = std::clamp(number(o, "specular_reflectance", 0.5), 0.0, 0.98);
            stand_in(o, "roughplastic");
            set_ior(o, (1 + std::sqrt(r)) / (1 - std::sqrt(r)));
            remove(o, "specular_reflectance");
        } else if (o.type == "lobesum") {
            const bool is_smooth =
                number(o, "glossy_reflectance", 0.25) == 0 && !has_texture(o, "glossy_reflectance");
            const double eta = number(o, "eta", 1.5);
            stand_in(o, is_smooth ? "plastic" : "roughplastic");
            if (!is_smooth) {
                remove(o, "specular_reflectance");
                rename(o, "glossy_reflectance", "specular_reflectance");
            }
            if (!has(o, "diffuse_reflectance")) set(o, "diffuse_reflectance", Rgb(0.25f));
            remove(o, "eta");
            set_ior(o, eta);
        } else if (o.type == "coatedconductor") {
            stand_in(o, "roughconductor");
            if (has(o, "reflectance")) {
                rename(o, "reflectance", "specular_reflectance");
                set(o, "material", std::string("none"));
            }
        }
        if (o.type == "principled") replace_own_reflectance(o);
        if (o.type == "plastic" || o.type == "roughplastic") replace_absorption(o);
        if (o.type == "roughplastic") {
            const bool is_anisotropic = number(o, "alpha_u", 0.1) != number(o, "alpha_v", 0.1) ||
                                        has_texture(o, "alpha_u") || has_texture(o, "alpha_v");
            if (is_anisotropic && !stand_ins_.count(index))
                warn(o, "Mitsuba 3 has no parameters \"alpha_u\" and \"alpha_v\" of bsdf "
                        "\"roughplastic\": their geometric mean stands in for them");
            if (o.find("alpha_u") || o.find("alpha_v"))
                set(o, "alpha", std::sqrt(number(o, "alpha_u", 0.1) * number(o, "alpha_v", 0.1)));
            remove(o, "alpha_u"), remove(o, "alpha_v");
        }
        if (o.type == "conductor" || o.type == "roughconductor") replace_metal(o);
    }
    bool has_texture(const SceneObject& o, std::string_view name) {
        return has(o, name) && !o.find(name);
    }
    /// What a coat absorbs on the mean becomes part of the reflectance ρ of its base: ρ' reflects as much without it,
    ///     ρ' / (1 − ρ' F) = A ρ / (1 − ρ F_τ),
    /// or, where the coat does not saturate colours, ρ' / (1 − F) = A ρ / (1 − F_τ).
    void replace_absorption(SceneObject& o) {
        const double tau = number(o, "thickness", 0);
        if (!(tau > 0) || has_texture(o, "diffuse_reflectance")) return;
        const Params params{scene_, int(&o - scene_.objects.data())};
        const float eta =
            read_ior(params, "int_ior", "polypropylene") / read_ior(params, "ext_ior", "air");
        if (!(eta > 1)) return;
        // Mean of 1 / cos below the coat for diffuse light from above, which passes twice.
        const double eta2 = double(eta) * double(eta);
        const double mean_path = 2 * eta2 * (1 - std::sqrt(1 - 1 / eta2));
        const double A = std::exp(-2 * tau * mean_path), F = double(reflectance_below_coat(eta, 0)),
                     F_tau = double(reflectance_below_coat(eta, float(tau)));
        const Param* flag = o.find("nonlinear");
        const bool saturates = flag && std::get<bool>(flag->value);
        Rgb base = rgb(o, "diffuse_reflectance", Rgb(0.5f));
        for (int c = 0; c < 3; ++c) {
            const double rho = double(base[c]);
            const double reflected = A * rho / (1 - (saturates ? rho : 1) * F_tau);
            base[c] = float(saturates ? reflected / (1 + reflected * F) : reflected * (1 - F));
        }
        warn(o, fmt::format("Mitsuba 3 has no parameter \"thickness\" of bsdf \"{}\": the mean "
                            "absorption of the coat becomes part of \"diffuse_reflectance\"",
                            o.type));
        remove(o, "thickness");
        set(o, "diffuse_reflectance", base);
    }
    /// The reflectance at normal incidence becomes an index of refraction.
    void replace_own_reflectance(SceneObject& o) {
        if (!has(o, "specular_weight") && !has(o, "specular_color")) return;
        const auto factor = [&](const char* name) {
            if (has_texture(o, name)) return 1.0;
            return double(luminance(rgb(o, name, Rgb(1))));
        };
        const double eta = number(o, "eta", 1.5), specular = number(o, "specular", 0.5);
        const double F0 = o.find("specular") ? 0.08 * specular : std::pow((eta - 1) / (eta + 1), 2);
        const double root = std::sqrt(
            std::clamp(F0 * factor("specular_weight") * factor("specular_color"), 0.0, 0.98));
        warn(o, "Mitsuba 3 has no parameters \"specular_weight\" and \"specular_color\" of bsdf "
                "\"principled\": an index of refraction with their mean reflectance at normal "
                "incidence stands in for them");
        for (const char* name : {"specular_weight", "specular_color", "specular"}) remove(o, name);
        set(o, "eta", std::max((1 + root) / (1 - root), 1.001));
    }
    static void set_ior(SceneObject& o, double ior) {
        constexpr double kLeast = 1.001;  // Mitsuba 3 refuses coats without an interface.
        set(o, "int_ior", std::max(ior, kLeast));
        set(o, "ext_ior", 1.0);
    }
    /// A metal in a medium is one with the indices divided by that of the medium.
    void replace_metal(SceneObject& o) {
        const Param* outside = o.find("ext_eta");
        if (!outside) return;
        const double n = read_ior({scene_, int(&o - scene_.objects.data())}, "ext_eta", "air");
        if (const Param* p = o.find("material"))
            if (const auto metal = named_metal(*p->as<std::string>())) {
                set(o, "eta", metal->eta), set(o, "k", metal->k);
                remove(o, "material");
            }
        for (const char* name : {"eta", "k"})
            if (o.find(name)) set(o, name, rgb(o, name, Rgb(0)) * float(1 / n));
        remove(o, "ext_eta");
    }

    /// A weighted sum is a chain of blends: each has its first material with the rest of the weight.
    void replace_mixture(int index) {
        const SceneObject mixture = object(index);
        std::string text =
            mixture.find("weights") ? *mixture.find("weights")->as<std::string>() : "";
        std::replace(text.begin(), text.end(), ',', ' ');
        std::istringstream in(text);
        std::vector<double> weights;
        for (double w; in >> w;) weights.push_back(w);
        std::vector<int> materials;
        for (const auto& c : mixture.children) materials.push_back(c.object);
        if (weights.size() != materials.size() || weights.empty()) return;
        double sum = 0;
        for (const double w : weights) sum += w;
        if (sum > 1) {
            const Param* p = mixture.find("ensure_energy_conservation");
            if (p && !std::get<bool>(p->value))
                warn(mixture, "Mitsuba 3 has no weights with a sum above one: they are divided by "
                              "their sum");
            for (double& w : weights) w /= sum;
        }
        if (sum < 1) {
            SceneObject black{"bsdf", "diffuse", "", mixture.where, {}, {}};
            set(black, "reflectance", Rgb(0));
            materials.push_back(add(std::move(black)));
            weights.push_back(1 - sum);
        }
        int rest = materials.back();
        double rest_weight = weights.back();
        for (size_t i = materials.size() - 1; i-- > 0;) {
            SceneObject blend{"bsdf", "blendbsdf", "", mixture.where, {}, {}};
            const double both = weights[i] + rest_weight;
            set(blend, "weight", both > 0 ? rest_weight / both : 0.5);
            blend.children = {{"", materials[i], mixture.where}, {"", rest, mixture.where}};
            rest_weight = both;
            rest = i == 0 ? index : add(SceneObject(blend));
            if (i == 0) {
                blend.id = mixture.id;
                object(index) = std::move(blend);
            }
        }
    }

    /// In Mitsuba 3 a material of both sides must not let light through: a mask or a blend stands outside of it.
    void hoist_masks(int index) {
        SceneObject& o = object(index);
        if (o.category != "bsdf" || o.type != "twosided" || o.children.size() != 1) return;
        const SceneObject inner = object(o.children[0].object);
        if (inner.type != "mask") return;
        SceneObject both = o;
        const std::string id = o.id;
        both.id.clear();
        SceneObject mask = inner;
        mask.id = id;
        const int added = add(SceneObject(both));
        for (SceneObject::Child& c : mask.children)
            if (object(c.object).category == "bsdf") {
                object(added).children = {c};
                c.object = added;
                c.name.clear();
            }
        object(index) = mask;
        hoist_masks(added);
    }

    void keep_one_environment() {
        bool has_one = false;
        std::erase_if(scene_.roots, [&](int root) {
            const SceneObject& o = object(root);
            if (o.category != "emitter" ||
                (o.type != "constant" && o.type != "envmap" && o.type != "sunsky"))
                return false;
            if (has_one)
                warn(o, fmt::format("Mitsuba 3 has one environment alone: emitter \"{}\" is left "
                                    "out",
                                    o.type));
            return std::exchange(has_one, true);
        });
    }

    // ---- What is left

    /// Removes what Mitsuba 3 still does not have.
    void strip(int index) {
        SceneObject& o = object(index);
        if (o.category == "shape" || o.category == "texture" || o.type == "principledthin") return;
        const ManualEntry* entry = entry_of_mitsuba_3(o);
        if (!entry) {
            if (o.category == "bsdf") {
                stand_in(o, "diffuse");
                o.params.clear(), o.children.clear();
            }
            return;
        }
        std::erase_if(o.params, [&](const Param& p) {
            if (p.name == "image" || documents(*entry, p.name)) return false;
            const ManualNote* note = find_manual_note(o.category, o.type, p.name);
            if ((!note || !note->is_accepted) && !stand_ins_.count(index))
                warn(o, fmt::format("Mitsuba 3 has no parameter \"{}\" of {} \"{}\": left out",
                                    p.name, o.category, o.type));
            return true;
        });
        std::erase_if(o.children, [&](const SceneObject::Child& c) {
            if (object(c.object).category != "texture" || c.name.empty() ||
                documents(*entry, c.name) || is_relief(o))
                return false;
            if (!stand_ins_.count(index))
                warn(o, fmt::format("Mitsuba 3 has no parameter \"{}\" of {} \"{}\": left out",
                                    c.name, o.category, o.type));
            return true;
        });
    }

    static constexpr int kBakedSize = 512, kLargestBaked = 4096;

    SceneDescription& scene_;
    const SceneDescription original_;
    PluginLookup lookup_;
    ModelBuilder models_;
    bool has_media_ = false;
    std::map<int, int> baked_;
    std::set<std::ptrdiff_t> stand_ins_;  ///< Objects whose replacement has been reported.
    std::vector<std::string> warnings_;
};

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

}  // namespace

std::vector<std::string> make_plain_mitsuba(SceneDescription& scene) {
    check_types(scene);
    return Plainer(scene).run();
}

}  // namespace etendue
