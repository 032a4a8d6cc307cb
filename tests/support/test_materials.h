#pragma once
// Materials from a description written in the test, constructed through the registry.

#include <functional>
#include <list>
#include <stdexcept>

#include "bsdf/material.h"

namespace etendue::testing {

/// A texture from functions of (u, v).
struct FunctionTexture final : Texture {
    std::function<Rgb(Vec2)> color;
    std::function<Vec2(Vec2)> slope = [](Vec2) { return Vec2{}; };

    Rgb eval(const TexturePoint& at) const override { return color(at.uv); }
    Vec2 gradient(const TexturePoint& at) const override { return slope(at.uv); }
    Rgb mean() const override { return color({0.5f, 0.5f}); }
};

/// Owns the materials of one test; the numbers that name objects are indices into the description.
class TestMaterials final : public MaterialContext {
public:
    struct Value {
        const char* name;
        ParamValue value;
    };
    struct Child {
        const char* name;
        int object;
    };

    int texture(FunctionTexture t) {
        textures_.push_back(std::move(t));
        const int index = add("texture", "function", {}, {});
        made_textures_.push_back({index, &textures_.back()});
        return index;
    }
    int bsdf(const char* type, const std::vector<Value>& values = {},
             const std::vector<Child>& children = {}) {
        return add("bsdf", type, values, children);
    }
    /// The material of an object added by bsdf(), after the check that the scene builder makes of
    /// its parameters.
    const Material& make(int index) {
        for (const MaterialEntry& entry : material_registry())
            if (scene_.objects[index].type == entry.info.name) {
                check_params(scene_, index, entry.info,
                             [](const SourceLocation& where, const std::string& m) {
                                 throw SceneError(where, m);
                             });
                materials_.push_back(entry.make(Params(scene_, index), *this));
                return *materials_.back();
            }
        throw std::logic_error("no material " + scene_.objects[index].type);
    }
    const Material& make(const char* type, const std::vector<Value>& values = {},
                         const std::vector<Child>& children = {}) {
        return make(bsdf(type, values, children));
    }

    TextureRef texture(const Params& params, std::string_view name, Rgb fallback,
                       float hi) override {
        for (const auto& child : params.children("texture"))
            for (const auto& [index, texture] : made_textures_)
                if (child.name == name && child.object == index) return TextureRef(texture, hi);
        const Rgb c = params.rgb(name, fallback);
        if (c.max() > hi) params.fail(name, "parameter is too large");
        return c;
    }
    std::vector<const Material*> nested(const Params& params) override {
        std::vector<const Material*> found;
        for (const auto& child : params.children("bsdf")) found.push_back(&make(child.object));
        return found;
    }

private:
    int add(const char* category, const char* type, const std::vector<Value>& values,
            const std::vector<Child>& children) {
        SceneObject object{.category = category,
                           .type = type,
                           .id = {},
                           .where = {},
                           .params = {},
                           .children = {}};
        for (const Value& v : values) object.params.push_back({v.name, v.value, {}});
        for (const Child& c : children) object.children.push_back({c.name, c.object, {}});
        scene_.objects.push_back(std::move(object));
        return int(scene_.objects.size()) - 1;
    }

    SceneDescription scene_;
    std::list<FunctionTexture> textures_;
    std::vector<std::pair<int, const Texture*>> made_textures_;
    std::vector<std::unique_ptr<Material>> materials_;
};

/// A point of the plane z = 0 with u along x and v along y, seen from `wo`.
inline SurfacePoint plane_point(Vec3 wo, Vec2 uv = {0.5f, 0.5f}) {
    return {.p = {},
            .ng = {0, 0, 1},
            .ns = {0, 0, 1},
            .dpdu = {1, 0, 0},
            .dpdv = {0, 1, 0},
            .uv = uv,
            .wo = wo};
}

}  // namespace etendue::testing
