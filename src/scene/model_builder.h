#pragma once
// Textures, materials, media and emitters of a description. Objects that are referred to several times are made once.

#include <map>
#include <memory>
#include <vector>

#include "bsdf/material.h"
#include "emitter/emitter.h"
#include "scene/plugin_lookup.h"
#include "scene/scene.h"
#include "texture/texture_cache.h"

namespace etendue {

/// What was made.
struct Models {
    std::unique_ptr<TextureCache> images = std::make_unique<TextureCache>();
    std::vector<std::unique_ptr<Texture>> textures;
    std::vector<std::unique_ptr<Material>> materials;
    std::vector<std::unique_ptr<Emitter>> emitters;
    std::vector<Rgb> media;  ///< Extinction, by MediumId.
};

class ModelBuilder final : private MaterialContext, private EmitterContext, private TextureContext {
public:
    explicit ModelBuilder(PluginLookup& plugins) : plugins_(plugins) {}

    /// By the object's index in the description.
    const Texture* make_texture(int index);
    const Material* make_material(int index);
    MediumId make_medium(int index);
    /// The first of the emitters that the object stands for. Those on a shape are area emitters.
    const Emitter* make_emitters(int index, const Shape* on_shape = nullptr);
    /// Of shapes that name none.
    const Material* default_material(Rgb reflectance);

    Models take() { return std::move(models_); }

private:
    TextureRef texture(const Params& p, std::string_view name, Rgb fallback, float hi) override;
    std::vector<const Material*> nested(const Params& p) override;
    const Shape* shape() const override { return emitting_shape_; }
    TextureCache& images() override { return *models_.images; }

    PluginLookup& plugins_;
    Models models_;
    std::map<int, const Texture*> textures_;
    std::map<int, const Material*> materials_;
    std::map<int, MediumId> media_;
    const Material *grey_ = nullptr, *black_ = nullptr;
    const Shape* emitting_shape_ = nullptr;
};

}  // namespace etendue
