// Polka dots at random places, like `dots` of pbrt; which cells have one follows from etendue's own noise.
//   inside (1), outside (0)   colours or textures
//   to_uv (identity)          affine map of (u, v); a dot lies in the unit square around a point of integers

#include <cmath>

#include "texture/noise.h"
#include "texture/texture.h"
#include "texture/uv_transform.h"

namespace etendue {
namespace {

class Dots final : public Texture {
public:
    Dots(const Params& params, TextureContext& context)
        : inside_(context.texture(params, "inside", Rgb(1))),
          outside_(context.texture(params, "outside", Rgb(0))), to_uv_(params.transform("to_uv")) {}

    Rgb eval(const TexturePoint& at) const override { return part(at.uv).eval(at); }
    float eval_scalar(const TexturePoint& at) const override { return part(at.uv).eval_scalar(at); }
    Vec2 gradient(const TexturePoint& at) const override {
        return part(at.uv).gradient(at);
    }  // edges have none
    Rgb mean() const override {
        // The noise at the centre of a cell is a sum of 16 random signs, which is above 0 with probability 0.402.
        const float dots = 0.402f * kPi * kRadius * kRadius;
        return lerp(dots, outside_.mean(), inside_.mean());
    }
    void resolution(int& width, int& height) const override {
        width = height = 8;
        to_uv_.resolution(width, height);
        refine(width, height, {&inside_, &outside_});
    }

private:
    static constexpr float kRadius = 0.35f;

    const TextureRef& part(Vec2 uv) const {
        const Vec2 p = to_uv_.point(uv);
        const float s = std::floor(p.x + 0.5f), t = std::floor(p.y + 0.5f);
        if (!(noise(s + 0.5f, t + 0.5f) > 0)) return outside_;
        // The dot stays within its cell.
        constexpr float kShift = 0.5f - kRadius;
        const float x = p.x - (s + kShift * noise(s + 1.5f, t + 2.8f)),
                    y = p.y - (t + kShift * noise(s + 4.5f, t + 9.8f));
        return x * x + y * y < kRadius * kRadius ? inside_ : outside_;
    }

    TextureRef inside_, outside_;
    UvTransform to_uv_;
};

}  // namespace

TextureEntry dots_entry() {
    return {{"texture",
             "dots",
             "Polka dots at random places.",
             {{"inside", ParamKind::Texture, "1", "Colour of the dots."},
              {"outside", ParamKind::Texture, "0", "Colour around them."},
              {"to_uv", ParamKind::Transform, "identity", "Affine map of (u, v)."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<Dots>(params, context);
            }};
}

}  // namespace etendue
