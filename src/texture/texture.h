#pragma once
// Textures: functions of the surface's (u, v). A `TextureRef` is what materials hold: a constant, or a texture.

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"
#include "description/params.h"
#include "math/vec.h"

namespace etendue {

class Texture {
public:
    virtual ~Texture() = default;
    /// Colour at `uv`; finite and not negative.
    virtual Rgb eval(Vec2 uv) const = 0;
    /// The scalar that roughness, opacity or height maps use: the luminance of colour images, the value of grey ones.
    virtual float eval_scalar(Vec2 uv) const { return luminance(eval(uv)); }
    /// (∂/∂u, ∂/∂v) of eval_scalar, for bump mapping; by central differences unless a texture knows better.
    virtual Vec2 gradient(Vec2 uv) const;
    /// Average over the unit square, for emitter power and for albedo statistics.
    virtual Rgb mean() const = 0;
    /// Resolution that resolves the texture's detail, (1, 1) for a constant: the grid for importance sampling.
    virtual void resolution(int& width, int& height) const { width = height = 1; }
    virtual size_t memory_bytes() const { return 0; }
};

/// A constant colour or a texture that outlives it.
class TextureRef {
public:
    TextureRef() = default;
    TextureRef(Rgb constant) : constant_(constant) {}
    explicit TextureRef(const Texture* texture) : texture_(texture) {}

    Rgb eval(Vec2 uv) const { return texture_ ? texture_->eval(uv) : constant_; }
    float eval_scalar(Vec2 uv) const { return texture_ ? texture_->eval_scalar(uv) : constant_.g; }
    Vec2 gradient(Vec2 uv) const { return texture_ ? texture_->gradient(uv) : Vec2(); }
    Rgb mean() const { return texture_ ? texture_->mean() : constant_; }
    void resolution(int& width, int& height) const {
        width = height = 1;
        if (texture_) texture_->resolution(width, height);
    }
    bool is_constant() const { return !texture_; }
    const Texture* texture() const { return texture_; }

private:
    Rgb constant_;
    const Texture* texture_ = nullptr;
};

class TextureCache;

/// What a texture's maker may ask of the scene builder.
class TextureContext {
public:
    virtual ~TextureContext() = default;
    /// Colour or nested texture; checks that constants lie in [0, hi].
    virtual TextureRef texture(const Params& params, std::string_view name, Rgb fallback,
                               float hi = kInf) = 0;
    /// The scene's images; they outlive its textures.
    virtual TextureCache& images() = 0;
};

/// A texture plug-in: its table and its maker.
struct TextureEntry {
    PluginInfo info;
    std::unique_ptr<Texture> (*make)(const Params& params, TextureContext& context);
};
/// All texture plug-ins, in the order `list` prints them.
const std::vector<TextureEntry>& texture_registry();

}  // namespace etendue
