// Bilinear interpolation of four colours at the corners of the unit square, of its multiples beyond.
//   v00 (0), v01 (1), v10 (0), v11 (1)   colours; vij is that at u = i, v = j
//   to_uv (identity)                     affine map of (u, v)

#include <algorithm>

#include "texture/texture.h"
#include "texture/uv_transform.h"

namespace etendue {
namespace {

class Bilerp final : public Texture {
public:
    explicit Bilerp(const Params& params)
        : v00_(params.rgb("v00", Rgb(0))), v01_(params.rgb("v01", Rgb(1))),
          v10_(params.rgb("v10", Rgb(0))), v11_(params.rgb("v11", Rgb(1))),
          to_uv_(params.transform("to_uv")) {}

    Rgb eval(const TexturePoint& at) const override { return at_uv<Rgb>(at.uv); }
    bool has_jet() const override { return true; }
    RgbDual eval_jet(const TextureJetPoint& at) const override { return at_uv<RgbDual>(at.uv); }
    Rgb mean() const override {
        constexpr int kGrid = 16;  // not one point: outside of the unit square, values end at 0
        Rgb sum(0);
        for (int i = 0; i < kGrid * kGrid; ++i)
            sum += at_uv<Rgb>(
                Vec2{(float(i % kGrid) + 0.5f) / kGrid, (float(i / kGrid) + 0.5f) / kGrid});
        return sum / float(kGrid * kGrid);
    }
    void resolution(int& width, int& height) const override { width = height = 16; }

private:
    template <class Color, class V>
    Color at_uv(V uv) const {
        using T = decltype(uv.x);
        const V p = to_uv_.point(uv);
        const Color c = lerp(p.x, lerp(p.y, v00_, v01_), lerp(p.y, v10_, v11_));
        return {std::max(c.r, T(0)), std::max(c.g, T(0)), std::max(c.b, T(0))};
    }

    Rgb v00_, v01_, v10_, v11_;
    UvTransform to_uv_;
};

}  // namespace

TextureEntry bilerp_entry() {
    return {{"texture",
             "bilerp",
             "Bilinear interpolation of four colours.",
             {{"v00", ParamKind::Rgb, "0", "Colour at (0, 0)."},
              {"v01", ParamKind::Rgb, "1", "Colour at (0, 1)."},
              {"v10", ParamKind::Rgb, "0", "Colour at (1, 0)."},
              {"v11", ParamKind::Rgb, "1", "Colour at (1, 1)."},
              {"to_uv", ParamKind::Transform, "identity", "Affine map of (u, v)."}}},
            [](const Params& params, TextureContext&) -> std::unique_ptr<Texture> {
                return std::make_unique<Bilerp>(params);
            }};
}

}  // namespace etendue
