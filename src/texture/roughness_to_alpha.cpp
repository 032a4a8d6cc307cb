// The α of microfacets from pbrt's roughness.
//   roughness (required)   texture
//   curve (pbrt4)          pbrt4: its square root; pbrt3: a polynomial of its logarithm

#include <algorithm>
#include <cmath>

#include "texture/texture.h"

namespace etendue {
namespace {

class RoughnessToAlpha final : public Texture {
public:
    RoughnessToAlpha(const Params& params, TextureContext& context)
        : roughness_(context.texture(params, "roughness", Rgb(0.1f))),
          is_polynomial_(params.choice("curve", {"pbrt4", "pbrt3"}, 0) == 1) {}

    Rgb eval(const TexturePoint& at) const override { return Rgb(eval_scalar(at)); }
    float eval_scalar(const TexturePoint& at) const override {
        return alpha(roughness_.eval_scalar(at));
    }
    Rgb mean() const override { return Rgb(alpha(luminance(roughness_.mean()))); }
    void resolution(int& width, int& height) const override {
        roughness_.resolution(width, height);
    }

private:
    float alpha(float roughness) const {
        if (!is_polynomial_) return std::sqrt(roughness);
        const float x = std::log(std::max(roughness, 1e-3f));
        return 1.62142f + x * (0.819955f + x * (0.1734f + x * (0.0171201f + x * 0.000640711f)));
    }

    TextureRef roughness_;
    bool is_polynomial_;
};

}  // namespace

TextureEntry roughness_to_alpha_entry() {
    return {{"texture",
             "roughness_to_alpha",
             "Microfacet roughness α from a roughness of pbrt.",
             {{"roughness", ParamKind::Texture, "", "pbrt's roughness; required."},
              {"curve", ParamKind::String, "pbrt4",
               "pbrt4 (the square root) or pbrt3 (a polynomial of the logarithm)."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<RoughnessToAlpha>(params, context);
            }};
}

}  // namespace etendue
