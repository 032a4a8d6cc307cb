// Checkerboard with 2 × 2 squares in the unit square of (u, v).
//   color0 (0.4)       the squares of the diagonal, that of (0, 0) among them; colour or texture
//   color1 (0.2)       the others
//   to_uv (identity)   affine map of (u, v); nested textures take the coordinates before it, as in Mitsuba 3

#include <cmath>

#include "texture/texture.h"
#include "texture/uv_transform.h"

namespace etendue {
namespace {

class Checkerboard final : public Texture {
public:
    Checkerboard(const Params& params, TextureContext& context)
        : color0_(context.texture(params, "color0", Rgb(0.4f))),
          color1_(context.texture(params, "color1", Rgb(0.2f))), to_uv_(params.transform("to_uv")) {
    }

    Rgb eval(const TexturePoint& at) const override { return square(at.uv).eval(at); }
    float eval_scalar(const TexturePoint& at) const override {
        return square(at.uv).eval_scalar(at);
    }
    Vec2 gradient(const TexturePoint& at) const override {
        return square(at.uv).gradient(at);
    }  // edges have none
    Rgb mean() const override { return (color0_.mean() + color1_.mean()) * 0.5f; }
    void resolution(int& width, int& height) const override {
        width = height = 2;
        to_uv_.resolution(width, height);
        refine(width, height, {&color0_, &color1_});
    }

private:
    const TextureRef& square(Vec2 uv) const {
        const Vec2 p = to_uv_.point(uv);
        const bool right = p.x - std::floor(p.x) > 0.5f, low = p.y - std::floor(p.y) > 0.5f;
        return right == low ? color0_ : color1_;
    }

    TextureRef color0_, color1_;
    UvTransform to_uv_;
};

}  // namespace

TextureEntry checkerboard_entry() {
    return {{"texture",
             "checkerboard",
             "Checkerboard of two colours, with two by two squares in the unit square of (u, v).",
             {{"color0", ParamKind::Texture, "0.4",
               "Colour of the squares on the diagonal from (0, 0)."},
              {"color1", ParamKind::Texture, "0.2", "Colour of the other squares."},
              {"to_uv", ParamKind::Transform, "identity", "Affine map of (u, v)."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<Checkerboard>(params, context);
            }};
}

}  // namespace etendue
