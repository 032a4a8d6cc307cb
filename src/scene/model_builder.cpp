#include "scene/model_builder.h"

#include <algorithm>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "scene/settings.h"

namespace etendue {

TextureRef ModelBuilder::texture(const Params& p, std::string_view name, Rgb fallback, float hi) {
    for (const auto& c : p.object().children)
        if (c.name == name && plugins_.object(c.object).category == "texture") {
            const Texture* texture = make_texture(c.object);
            return texture ? TextureRef(texture, hi) : TextureRef(fallback);
        }
    if (name.empty()) return TextureRef(fallback);
    const Rgb c = p.rgb(name, fallback);
    if (c.max() > hi)
        p.fail(name, fmt::format(
                         "parameter \"{}\" is ({}, {}, {}), but its components must be at most {}",
                         name, c.r, c.g, c.b, hi));
    return TextureRef(c);
}

std::function<float(const TexturePoint&)> ModelBuilder::opacity() const {
    if (!emitting_material_ || emitting_material_->is_opaque()) return {};
    return
        [material = emitting_material_](const TexturePoint& at) { return material->opacity(at); };
}

std::vector<const Material*> ModelBuilder::nested(const Params& p) {
    std::vector<const Material*> found;
    for (const auto& c : p.children("bsdf")) found.push_back(make_material(c.object));
    return found;
}

const Texture* ModelBuilder::make_texture(int index) {
    if (const auto it = textures_.find(index); it != textures_.end()) return it->second;
    const TextureEntry* entry = plugins_.find(index, texture_registry());
    if (!entry) return textures_[index] = nullptr;
    auto made = plugins_.attempt(index, [&] { return entry->make(plugins_.params(index), *this); });
    if (!made) return textures_[index] = nullptr;
    models_.textures.push_back(std::move(made));
    return textures_[index] = models_.textures.back().get();
}

const Material* ModelBuilder::make_material(int index) {
    if (const auto it = materials_.find(index); it != materials_.end()) return it->second;
    const MaterialEntry* entry = plugins_.find(index, material_registry());
    if (!entry) return materials_[index] = stand_in(index);
    auto made = plugins_.attempt(index, [&] { return entry->make(plugins_.params(index), *this); });
    if (!made) return materials_[index] = stand_in(index);
    models_.materials.push_back(std::move(made));
    return materials_[index] = models_.materials.back().get();
}

std::span<const BitmapTexture* const> ModelBuilder::images_of(int index) {
    const auto [entry, is_new] = models_.images_of_materials.try_emplace(index);
    std::vector<const BitmapTexture*>& images = entry->second;
    if (!is_new) return images;
    std::vector<int> objects{index};
    std::set<int> known{index};
    while (!objects.empty()) {
        const int object = objects.back();
        objects.pop_back();
        if (const auto it = textures_.find(object); it != textures_.end())
            if (const auto* image = dynamic_cast<const BitmapTexture*>(it->second))
                images.push_back(image);
        for (const SceneObject::Child& c : plugins_.params(object).object().children)
            if (known.insert(c.object).second) objects.push_back(c.object);
    }
    return images;
}

const Material* ModelBuilder::stand_in(int index) {
    const std::vector<const Material*> inner = nested(plugins_.params(index));
    return inner.empty() ? default_material(Rgb(0.5f)) : inner.front();
}

const Material* ModelBuilder::default_material(Rgb reflectance) {
    const Material*& m = reflectance.is_zero() ? black_ : grey_;
    if (!m) {
        SceneDescription diffuse;
        diffuse.objects = {{"bsdf", "diffuse", "", {}, {{"reflectance", reflectance, {}}}, {}}};
        const auto& registry = material_registry();
        const auto entry =
            std::find_if(registry.begin(), registry.end(), [](const MaterialEntry& e) {
                return std::string_view(e.info.name) == "diffuse";
            });
        models_.materials.push_back(entry->make({diffuse, 0}, *this));
        m = models_.materials.back().get();
    }
    return m;
}

MediumId ModelBuilder::make_medium(int index) {
    if (const auto it = media_.find(index); it != media_.end()) return it->second;
    const SceneObject& object = plugins_.object(index);
    const auto vacuum = [&](const SourceLocation& where, const std::string& message) {
        plugins_.problem(where, message, "vacuum instead");
        return media_[index] = kVacuum;
    };
    if (object.type != "homogeneous")
        return vacuum(object.where,
                      fmt::format("medium \"{}\" is not supported (supported: \"homogeneous\" "
                                  "with albedo 0, that is absorption only)",
                                  object.type));
    plugins_.check(index, medium_info());
    Rgb absorption;
    try {
        absorption = read_absorption(plugins_.params(index));
    } catch (const SceneError& e) {
        return vacuum(e.where(), e.message());
    }
    constexpr size_t kMostMedia = std::numeric_limits<MediumId>::max();
    if (models_.media.size() >= kMostMedia)
        throw SceneError(object.where,
                         fmt::format("a scene can have at most {} media", kMostMedia));
    models_.media.push_back(absorption);
    return media_[index] = MediumId(models_.media.size() - 1);
}

const Emitter* ModelBuilder::make_emitters(int index, const Shape* on_shape,
                                           const Material* material) {
    const EmitterEntry* entry = plugins_.find(index, emitter_registry());
    if (!entry) return nullptr;
    if (on_shape && std::string_view(entry->info.name) != "area") {
        plugins_.problem(plugins_.object(index).where,
                         fmt::format("emitter \"{}\" cannot stand in a shape (only \"area\" can)",
                                     entry->info.name));
        return nullptr;
    }
    emitting_shape_ = on_shape, emitting_material_ = material;
    auto made = plugins_.attempt(index, [&] { return entry->make(plugins_.params(index), *this); });
    emitting_shape_ = nullptr, emitting_material_ = nullptr;
    const Emitter* first = made.empty() ? nullptr : made.front().get();
    for (auto& e : made) models_.emitters.push_back(std::move(e));
    return first;
}

}  // namespace etendue
