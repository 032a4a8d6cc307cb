// Checkerboard of unit cubes, like `checkerboard` of pbrt with three dimensions.
//   color0 (1), color1 (0)   colours or textures; color0 is that of the cube [0, 1]³
//   to_texture (identity)    from the world to the space of the cubes

#include <cmath>

#include "texture/solid.h"

namespace etendue {
namespace {

class Checkerboard3d final : public SolidTexture {
public:
    Checkerboard3d(const Params& params, TextureContext& context)
        : SolidTexture(params), color0_(context.texture(params, "color0", Rgb(1))),
          color1_(context.texture(params, "color1", Rgb(0))) {}

    Rgb eval(const TexturePoint& at) const override { return cube(at).eval(at); }
    float eval_scalar(const TexturePoint& at) const override { return cube(at).eval_scalar(at); }
    Vec2 gradient(const TexturePoint& at) const override {
        return cube(at).gradient(at);
    }  // edges have none
    Rgb mean() const override { return (color0_.mean() + color1_.mean()) * 0.5f; }

    static TextureEntry entry() {
        return {{"texture",
                 "checkerboard3d",
                 "Checkerboard of unit cubes in space.",
                 {{"color0", ParamKind::Texture, "1", "Colour of the cube [0, 1]³."},
                  {"color1", ParamKind::Texture, "0", "Colour of its neighbours."},
                  to_texture_info()}},
                [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                    return std::make_unique<Checkerboard3d>(params, context);
                },
                true};
    }

private:
    const TextureRef& cube(const TexturePoint& at) const {
        const Vec3 p = point(at);
        const float sum = std::floor(p.x) + std::floor(p.y) + std::floor(p.z);
        return std::fmod(sum, 2.0f) == 0 ? color0_ : color1_;
    }

    TextureRef color0_, color1_;
};

}  // namespace

TextureEntry checkerboard3d_entry() {
    return Checkerboard3d::entry();
}

}  // namespace etendue
