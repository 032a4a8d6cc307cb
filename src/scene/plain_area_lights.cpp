#include "scene/plain_area_lights.h"

#include <algorithm>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "scene/model_builder.h"
#include "scene/plain_scene.h"
#include "scene/shape_registry.h"

namespace etendue {
namespace {

/// Far more than the rounding of a ray's intersection, but invisible.
constexpr float kRelativeDistance = 1e-4f;
constexpr float kMostOfSize = 0.05f, kMostOfRadius = 0.5f;

/// Of a sphere or a cylinder.
std::optional<float> radius_of(const Shape& shape) {
    if (!dynamic_cast<const Sphere*>(&shape) && !dynamic_cast<const Cylinder*>(&shape)) return {};
    // These points are opposite.
    return length(shape.surface(0, 0.5f, 0.5f, false).p - shape.surface(0, 0, 0.5f, false).p) / 2;
}

float distance_of_back(const Shape& front) {
    const Bounds3 b = front.bounds();
    const float largest = std::max(largest_coordinate(b.lo), largest_coordinate(b.hi));
    // Small shapes far from the origin are turned inside out by more than this.
    const float distance = std::min(kRelativeDistance * largest, kMostOfSize * length(b.hi - b.lo));
    const std::optional<float> radius = radius_of(front);
    return radius ? std::min(distance, kMostOfRadius * *radius) : distance;
}

MeshData back_of(const TriangleMesh& front, float distance) {
    TriangleMesh::Arrays arrays = front.arrays();
    MeshData back;
    std::vector<Vec3> normals(arrays.positions.size());
    for (uint32_t i = 0; i < arrays.triangles.size(); ++i) {
        const Vec3 ng = front.surface(i, 1.0f / 3, 1.0f / 3, false).ng;
        const auto& [a, b, c] = arrays.triangles[i];
        for (const uint32_t vertex : {a, b, c})
            normals[vertex] = normals[vertex] + ng * float(front.primitive_area(i));
        // The winding of a front that is mirrored or flipped may be against its normals. That of its back is not.
        const bool agrees = dot(front.faces()[i].ng, ng) > 0;
        back.triangles.push_back(agrees ? MeshData::Triangle{a, c, b}
                                        : MeshData::Triangle{a, b, c});
    }
    back.positions = std::move(arrays.positions);
    for (size_t i = 0; i < normals.size(); ++i)
        if (length2(normals[i]) > 0)
            back.positions[i] = back.positions[i] - normalize(normals[i]) * distance;
    for (const Vec3 n : arrays.normals) back.normals.push_back(-n);
    back.face_normals = arrays.normals.empty();
    back.uvs = std::move(arrays.uvs);
    back.second_uvs = std::move(arrays.second_uvs);
    back.colors = std::move(arrays.colors);
    back.alphas = std::move(arrays.alphas);
    return back;
}

/// A material that reflects nothing.
SceneObject black(const SourceLocation& where) {
    return {"bsdf", "diffuse", "", where, {{"reflectance", Rgb(0), where}}, {}};
}

class AreaLights {
public:
    explicit AreaLights(SceneDescription& scene)
        : scene_(scene), original_(scene), unscaled_(without_power(scene)),
          plugins_(unscaled_, true), models_(plugins_) {}

    std::vector<std::string> run() {
        const int count = int(scene_.objects.size());
        for (int i = 0; i < count; ++i)
            if (const int emitter = emitter_of(i); emitter >= 0) replace(i, emitter);
        return std::move(warnings_);
    }

private:
    static SceneDescription without_power(SceneDescription scene) {
        for (SceneObject& o : scene.objects)
            if (o.category == "emitter" && o.type == "area") remove(o, "power");
        return scene;
    }

    /// The area light of a shape which Mitsuba 3 has not in this form; otherwise -1.
    int emitter_of(int shape) const {
        const SceneObject& o = original_.objects[size_t(shape)];
        if (o.category != "shape") return -1;
        for (const auto& c : o.children) {
            const SceneObject& emitter = original_.objects[size_t(c.object)];
            if (emitter.category == "emitter" && emitter.type == "area" &&
                (emitter.find("power") || is_two_sided(emitter)))
                return c.object;
        }
        return -1;
    }
    static bool is_two_sided(const SceneObject& emitter) {
        const Param* p = emitter.find("two_sided");
        const bool* flag = p ? p->as<bool>() : nullptr;
        return flag && *flag;
    }

    int add(SceneObject&& o) {
        scene_.objects.push_back(std::move(o));
        return int(scene_.objects.size()) - 1;
    }
    /// Refers to other objects for some of those that a shape has.
    static void replace_child(SceneObject& parent, int from, int to) {
        for (auto& c : parent.children)
            if (c.object == from) c.object = to;
    }

    void replace(int shape, int emitter) {
        const ShapeEntry* entry = plugins_.find(shape, shape_registry());
        if (!entry) return;
        const std::unique_ptr<Shape> front =
            entry->make(plugins_.params(shape), [](const std::string&) {});
        const auto bsdfs = plugins_.params(shape).children("bsdf");
        const Material* material = bsdfs.empty() ? nullptr : models_.make_material(bsdfs[0].object);
        const double power = number(original_.objects[size_t(emitter)], "power", 0);
        double factor = 1;
        if (power > 0) {
            const Emitter* made = models_.make_emitters(emitter, front.get(), material);
            if (made && made->power() > 0) factor = power / made->power();
        }
        const bool has_back = is_two_sided(original_.objects[size_t(emitter)]) &&
                              !(material && material->is_transmissive());
        const int plain = scaled(emitter, factor, has_back);
        replace_child(scene_.objects[size_t(shape)], emitter, plain);
        if (has_back) add_back(shape, *front, material);
    }

    /// The light with `factor` times its radiance. Shapes may share a light, but not the factor.
    int scaled(int emitter, double factor, bool has_back) {
        SceneObject plain = unscaled_.objects[size_t(emitter)];
        if (has_back) remove(plain, "two_sided");
        if (!has_texture(plain, "radiance")) {
            set(plain, "radiance", rgb(plain, "radiance", Rgb(1)) * float(factor));
        } else if (factor != 1) {
            for (auto& c : plain.children) {
                if (c.name != "radiance") continue;
                SceneObject scale{"texture", "scale", "", plain.where, {}, {}};
                set(scale, "scale", Rgb(float(factor)));
                scale.children.push_back({"value", c.object, plain.where});
                c.object = add(std::move(scale));
            }
        }
        if (replaced_.insert(emitter).second) {
            scene_.objects[size_t(emitter)] = std::move(plain);
            return emitter;
        }
        plain.id.clear();
        return add(std::move(plain));
    }

    void add_back(int shape, const Shape& front, const Material* material) {
        SceneObject back = scene_.objects[size_t(shape)];
        back.id.clear();
        // Where the front lies on the boundary of a medium, light has passed it there.
        std::erase_if(back.children, [&](const auto& c) {
            return scene_.objects[size_t(c.object)].category == "medium";
        });
        const float distance = distance_of_back(front);
        if (const auto* mesh = dynamic_cast<const TriangleMesh*>(&front)) {
            back.type = "mesh";
            back.params.clear();
            set(back, "mesh", int64_t(scene_.meshes.size()));
            scene_.meshes.push_back(back_of(*mesh, distance));
        } else {
            move_back(back, front, distance);
        }
        for (auto& c : back.children)
            if (scene_.objects[size_t(c.object)].category == "bsdf")
                c.object = material && material->is_two_sided() ? from_behind(c.object)
                                                                : add(black(back.where));
        warnings_.push_back(
            SceneError(
                back.where,
                fmt::format("Mitsuba 3 has no emission from both sides: a second shape, {:.2g} "
                            "behind shape \"{}\", emits from the back",
                            distance, scene_.objects[size_t(shape)].type))
                .what());
        scene_.roots.push_back(add(std::move(back)));
    }

    /// Turns a quadric over, and moves it behind `front`.
    static void move_back(SceneObject& o, const Shape& front, float distance) {
        const Param* flip = o.find("flip_normals");
        const bool is_flipped = flip && *flip->as<bool>();
        if (o.type == "disk") {
            const Vec3 ng = front.surface(0, 0, 0.5f, false).ng;
            const Param* p = o.find("to_world");
            const Transform t = p ? *p->as<Transform>() : Transform();
            set(o, "to_world", Transform::translate(ng * -distance) * t);
        } else {
            const float share = distance / *radius_of(front);
            set(o, "radius", number(o, "radius", 1) * double(is_flipped ? 1 + share : 1 - share));
        }
        set(o, "flip_normals", !is_flipped);
    }

    /// A material of two sides that shows the one on the other.
    int from_behind(int bsdf) {
        SceneObject o = scene_.objects[size_t(bsdf)];
        std::vector<SceneObject::Child*> nested;
        for (auto& c : o.children)
            if (scene_.objects[size_t(c.object)].category == "bsdf") nested.push_back(&c);
        if (o.type != "twosided") {
            // Around what has two sides.
            bool is_other = false;
            for (SceneObject::Child* c : nested) {
                const int turned = from_behind(c->object);
                is_other |= turned != c->object;
                c->object = turned;
            }
            if (!is_other) return bsdf;
        } else {
            if (nested.size() != 2) return bsdf;
            std::swap(nested[0]->object, nested[1]->object);
        }
        o.id.clear();
        return add(std::move(o));
    }

    SceneDescription& scene_;
    const SceneDescription original_;
    const SceneDescription unscaled_;  ///< The same without the powers.
    PluginLookup plugins_;
    ModelBuilder models_;
    std::set<int> replaced_;  ///< Lights that are replaced in their place.
    std::vector<std::string> warnings_;
};

/// Leaves out the lights of shapes in shapegroups.
class LightsOfGroups {
public:
    explicit LightsOfGroups(SceneDescription& scene) : scene_(scene) {}

    std::vector<std::string> remove() {
        const size_t count = scene_.objects.size();
        for (size_t i = 0; i < count; ++i)
            if (scene_.objects[i].type == "shapegroup") remove_below(i);
        return std::move(warnings_);
    }

private:
    bool is(const SceneObject::Child& c, const char* category) const {
        return scene_.objects[size_t(c.object)].category == category;
    }

    void remove_below(size_t parent) {
        const std::vector<SceneObject::Child> children = scene_.objects[parent].children;
        for (const auto& c : children) {
            if (!is(c, "shape")) continue;
            const auto shape = size_t(c.object);
            if (scene_.objects[shape].type == "merge") remove_below(shape);
            remove_light(shape);
        }
    }

    void remove_light(size_t shape) {
        SceneObject o = scene_.objects[shape];
        if (std::erase_if(o.children, [&](const auto& c) { return is(c, "emitter"); }) == 0) return;
        // What emits is black unless it says otherwise.
        if (std::none_of(o.children.begin(), o.children.end(),
                         [&](const auto& c) { return is(c, "bsdf"); })) {
            o.children.push_back({"", int(scene_.objects.size()), o.where});
            scene_.objects.push_back(black(o.where));
        }
        warnings_.push_back(
            SceneError(o.where, "an emitter in a shapegroup is left out, since Mitsuba 3 has none")
                .what());
        scene_.objects[shape] = std::move(o);
    }

    SceneDescription& scene_;
    std::vector<std::string> warnings_;
};

}  // namespace

std::vector<std::string> make_plain_area_lights(SceneDescription& scene) {
    std::vector<std::string> warnings = LightsOfGroups(scene).remove();
    for (std::string& w : AreaLights(scene).run()) warnings.push_back(std::move(w));
    return warnings;
}

}  // namespace etendue
