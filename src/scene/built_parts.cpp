#include "scene/built_parts.h"

#include <algorithm>

namespace etendue {
namespace {

/// The mesh or image of the description whose index a parameter has; nullptr for other parameters.
const void* embedded_by(const SceneDescription& scene, const Param& param) {
    const int64_t* const index = param.as<int64_t>();
    const auto find = [&](const auto& all) -> const void* {
        return *index >= 0 && size_t(*index) < all.size() ? &*all[size_t(*index)] : nullptr;
    };
    if (!index) return nullptr;
    if (param.name == "mesh") return find(scene.meshes);
    return param.name == "image" ? find(scene.images) : nullptr;
}

/// Whether both objects have the same plug-in, parameters, and children that make the geometry.
bool is_same(const SceneDescription& a, int i, const SceneDescription& b, int j) {
    const SceneObject &x = a.objects[size_t(i)], &y = b.objects[size_t(j)];
    const auto is_same_param = [&](const Param& p, const Param& q) {
        return p.name == q.name && p.value == q.value && embedded_by(a, p) == embedded_by(b, q);
    };
    if (x.category != y.category || x.type != y.type ||
        !std::ranges::equal(x.params, y.params, is_same_param))
        return false;
    const auto geometric = [](const SceneDescription& scene, const SceneObject& o) {
        std::vector<SceneObject::Child> children;
        for (const SceneObject::Child& c : o.children) {
            const std::string& category = scene.objects[size_t(c.object)].category;
            if (category != "bsdf" && category != "emitter" && category != "medium")
                children.push_back(c);
        }
        return children;
    };
    return std::ranges::equal(geometric(a, x), geometric(b, y), [&](const auto& c, const auto& d) {
        return c.name == d.name && is_same(a, c.object, b, d.object);
    });
}

}  // namespace

bool is_same_shape(const SceneDescription& a, const SceneDescription& b, int index) {
    return size_t(index) < std::min(a.objects.size(), b.objects.size()) &&
           is_same(a, index, b, index);
}

}  // namespace etendue
