// Grid of lines in the unit square of (u, v), as in Mitsuba 0.6.
//   color0 (0.2)        background; colour or texture
//   color1 (0.4)        lines; colour or texture
//   line_width (0.01)   half the width of the lines along the edges of the unit square, in (u, v)
//   to_uv (identity)    affine map of (u, v); nested textures take the coordinates before it

#include <cmath>

#include "texture/texture.h"
#include "texture/uv_transform.h"

namespace etendue {
namespace {

class GridTexture final : public Texture {
public:
    GridTexture(const Params& params, TextureContext& context)
        : color0_(context.texture(params, "color0", Rgb(0.2f))),
          color1_(context.texture(params, "color1", Rgb(0.4f))),
          line_width_(params.number("line_width", 0.01f, 0, 0.5f)),
          to_uv_(params.transform("to_uv")) {}

    Rgb eval(const TexturePoint& at) const override { return part(at.uv).eval(at); }
    float eval_scalar(const TexturePoint& at) const override { return part(at.uv).eval_scalar(at); }
    Vec2 gradient(const TexturePoint& at) const override { return part(at.uv).gradient(at); }
    Rgb mean() const override {
        const float background = sqr(1 - 2 * line_width_);
        return lerp(background, color1_.mean(), color0_.mean());
    }
    void resolution(int& width, int& height) const override {
        const float cells = 2 / std::fmax(line_width_, 1e-3f);
        width = height = int(cells);
        to_uv_.resolution(width, height);
    }

private:
    const TextureRef& part(Vec2 uv) const {
        const Vec2 p = to_uv_.point(uv);
        const auto is_line = [&](float x) { return std::fabs(x - std::round(x)) < line_width_; };
        return is_line(p.x) || is_line(p.y) ? color1_ : color0_;
    }

    TextureRef color0_, color1_;
    float line_width_;
    UvTransform to_uv_;
};

}  // namespace

TextureEntry gridtexture_entry() {
    return {{"texture",
             "gridtexture",
             "Lines along the edges of the unit square of (u, v).",
             {{"color0", ParamKind::Texture, "0.2", "Colour of the background."},
              {"color1", ParamKind::Texture, "0.4", "Colour of the lines."},
              {"line_width", ParamKind::Float, "0.01", "Half the width of the lines, in (u, v)."},
              {"to_uv", ParamKind::Transform, "identity", "Affine map of (u, v)."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<GridTexture>(params, context);
            }};
}

}  // namespace etendue
