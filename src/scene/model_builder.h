#pragma once
// Construction of the textures, materials, media and emitters of a description. An object with several references is
// constructed once.

#include <map>
#include <memory>
#include <vector>

#include "bsdf/material.h"
#include "emitter/emitter.h"
#include "scene/plugin_lookup.h"
#include "scene/scene.h"
#include "texture/bitmap.h"
#include "texture/texture_cache.h"

namespace etendue {

/// The constructed models.
struct Models {
    std::unique_ptr<TextureCache> images = std::make_unique<TextureCache>();
    std::vector<std::unique_ptr<Texture>> textures;
    std::vector<std::unique_ptr<Material>> materials;
    ImagesOfMaterials images_of_materials;
    std::vector<std::unique_ptr<Emitter>> emitters;
    std::vector<Rgb> media;  ///< Extinction, by MediumId.
};

class ModelBuilder final : private MaterialContext, private EmitterContext, private TextureContext {
public:
    explicit ModelBuilder(PluginLookup& plugins) : plugins_(plugins) {}

    /// `index` is that of the object in the description. Under `lenient` a texture that cannot be made is nullptr, such a
    /// material is replaced by the first one nested in it or by the default one, and such a medium is vacuum.
    const Texture* make_texture(int index);
    const Material* make_material(int index);
    MediumId make_medium(int index);
    /// The images among the textures that have been made for the material `index` and for what is nested in it.
    std::span<const BitmapTexture* const> images_of(int index);
    /// Constructs all emitters of the object and returns the first one. With `on_shape` it must be an area emitter;
    /// `material` is that of the shape.
    const Emitter* make_emitters(int index, const Shape* on_shape = nullptr,
                                 const Material* material = nullptr);
    TextureCache& images() override { return *models_.images; }
    /// The material of shapes without one: diffuse.
    const Material* default_material(Rgb reflectance);

    Models take(bool strict_normals) {
        for (auto& m : models_.materials) m->set_strict_normals(strict_normals);
        return std::move(models_);
    }

private:
    TextureRef texture(const Params& p, std::string_view name, Rgb fallback, float hi) override;
    std::vector<const Material*> nested(const Params& p) override;
    const Material* stand_in(int index);
    const Shape* shape() const override { return emitting_shape_; }
    std::function<float(const TexturePoint&)> opacity() const override;

    PluginLookup& plugins_;
    Models models_;
    std::map<int, const Texture*> textures_;
    std::map<int, const Material*> materials_;
    std::map<int, MediumId> media_;
    const Material *grey_ = nullptr, *black_ = nullptr;
    const Shape* emitting_shape_ = nullptr;
    const Material* emitting_material_ = nullptr;
};

}  // namespace etendue
