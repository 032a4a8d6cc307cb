#pragma once
// Textures: functions of the surface's (u, v), of its vertex colours, or of the position ("solid" textures). Materials
// and emitters store `TextureRef`s: a constant or a texture.

#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"
#include "description/params.h"
#include "math/dual.h"
#include "math/vec.h"
#include "texture/texture_jet.h"

namespace etendue {

/// What a texture knows of the point at which it is evaluated.
struct TexturePoint {
    TexturePoint(Vec2 uv_ = Vec2(), Vec3 color_ = Vec3{1, 1, 1}, Vec3 p_ = {}, Vec3 dpdu_ = {},
                 Vec3 dpdv_ = {}, float alpha_ = 1, Vec2 second_uv_ = Vec2())
        : uv(uv_), color(color_), p(p_), dpdu(dpdu_), dpdv(dpdv_), alpha(alpha_),
          second_uv(second_uv_) {}
    TexturePoint(float u, float v) : TexturePoint(Vec2{u, v}) {}

    /// The point at (u, v) + `d` on the tangent plane.
    TexturePoint moved(Vec2 d) const {
        return {{uv.x + d.x, uv.y + d.y},
                color,
                p + dpdu * d.x + dpdv * d.y,
                dpdu,
                dpdv,
                alpha,
                second_uv};
    }

    Vec2 uv;
    Vec3 color;       ///< Interpolated vertex colour; white where the shape has none.
    Vec3 p;           ///< Position in the world.
    Vec3 dpdu, dpdv;  ///< Its derivatives; needed for gradients only.
    float alpha;      ///< Of the vertex colour; one where the shape has none.
    Vec2 second_uv;   ///< Another set of texture coordinates.
};

class Texture {
public:
    virtual ~Texture() = default;
    /// Colour at `at`; finite and not negative.
    virtual Rgb eval(const TexturePoint& at) const = 0;
    /// Value of roughness, opacity and height maps: the luminance of colours, the value of grey; may be negative.
    virtual float eval_scalar(const TexturePoint& at) const { return luminance(eval(at)); }
    /// (∂/∂u, ∂/∂v) of eval_scalar(), for bump mapping; by central differences unless overridden.
    virtual Vec2 gradient(const TexturePoint& at) const;
    /// Whether the functions below are known: those above in double, with derivatives.
    virtual bool has_jet() const { return false; }
    virtual RgbDual eval_jet(const TextureJetPoint&) const { return {}; }
    virtual Dual scalar_jet(const TextureJetPoint& at) const { return luminance(eval_jet(at)); }
    virtual Vec2Dual gradient_jet(const TextureJetPoint& at) const;
    /// Average over the unit square, for the power of emitters and average albedos; may be approximate.
    virtual Rgb mean() const = 0;
    /// Size of a grid over the unit square that resolves the texture's detail, for importance sampling.
    virtual void resolution(int& width, int& height) const { width = height = 1; }
    virtual size_t memory_bytes() const { return 0; }
};

constexpr bool is_grey(Rgb c) {
    return c.r == c.g && c.g == c.b;
}

/// A constant colour, or a texture, which must outlive the reference. The values of a texture with an upper bound are clamped
/// to [0, hi]: a factor, an image of floating-point numbers or vertex colours may exceed it.
class TextureRef {
public:
    TextureRef() = default;
    TextureRef(Rgb constant)
        : constant_(constant), scalar_(is_grey(constant) ? constant.g : luminance(constant)) {}
    explicit TextureRef(const Texture* texture, float hi = kInf) : texture_(texture), hi_(hi) {}

    Rgb eval(const TexturePoint& at) const {
        return texture_ ? bounded(texture_->eval(at)) : constant_;
    }
    float eval_scalar(const TexturePoint& at) const {
        return texture_ ? bounded(texture_->eval_scalar(at)) : scalar_;
    }
    Vec2 gradient(const TexturePoint& at) const {
        return texture_ ? texture_->gradient(at) : Vec2();
    }
    bool has_jet() const { return !texture_ || texture_->has_jet(); }
    RgbDual eval_jet(const TextureJetPoint& at) const {
        return texture_ ? bounded(texture_->eval_jet(at)) : RgbDual(constant_);
    }
    Dual scalar_jet(const TextureJetPoint& at) const {
        return texture_ ? bounded(texture_->scalar_jet(at)) : Dual(double(scalar_));
    }
    Vec2Dual gradient_jet(const TextureJetPoint& at) const {
        return texture_ ? texture_->gradient_jet(at) : Vec2Dual();
    }
    /// eval() at a surface point, whose texture_point() is made only where there is a texture.
    template <class Point>
    requires requires(const Point& at) { TexturePoint(at.texture_point()); }
    Rgb eval(const Point& at) const { return texture_ ? eval(at.texture_point()) : constant_; }
    Rgb mean() const { return texture_ ? bounded(texture_->mean()) : constant_; }
    void resolution(int& width, int& height) const {
        width = height = 1;
        if (texture_) texture_->resolution(width, height);
    }
    bool is_constant() const { return !texture_; }
    const Texture* texture() const { return texture_; }

private:
    float bounded(float v) const { return hi_ < kInf ? clamp(v, 0, hi_) : v; }
    Dual bounded(Dual v) const { return hi_ < kInf ? clamp(v, 0, double(hi_)) : v; }
    template <class Color>
    Color bounded(Color c) const {
        return {bounded(c.r), bounded(c.g), bounded(c.b)};
    }

    Rgb constant_;
    float scalar_ = 0;  ///< eval_scalar() of the constant.
    const Texture* texture_ = nullptr;
    float hi_ = kInf;
};

/// Enlarges a grid so that it resolves all of these textures.
void refine(int& width, int& height, std::initializer_list<const TextureRef*> textures);

class TextureCache;

/// Services of the scene builder for the construction of textures.
class TextureContext {
public:
    virtual ~TextureContext() = default;
    /// A constant or nested texture; throws SceneError where a constant lies outside [0, hi], to which textures are clamped.
    virtual TextureRef texture(const Params& params, std::string_view name, Rgb fallback,
                               float hi = kInf) = 0;
    /// The scene's images; they outlive its textures.
    virtual TextureCache& images() = 0;
};

/// A texture plug-in: its table and its factory.
struct TextureEntry {
    PluginInfo info;
    std::unique_ptr<Texture> (*make)(const Params& params, TextureContext& context);
    bool is_solid = false;  ///< Whether it is a function of the position.
};
/// All texture plug-ins, in the order of `etendue list`.
const std::vector<TextureEntry>& texture_registry();

}  // namespace etendue
