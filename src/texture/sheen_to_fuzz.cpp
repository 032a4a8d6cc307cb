// The colour of sheen, such as that of glTF, in the parameters of `openpbr`: its largest component is the weight of the
// fuzz, and the colour divided by it the colour of the fuzz.
//   color (1)               a colour or texture
//   output (fuzz_color)     or fuzz_weight: which parameter the texture is

#include "texture/texture.h"

namespace etendue {
namespace {

class SheenToFuzz final : public Texture {
public:
    SheenToFuzz(const Params& params, TextureContext& context)
        : color_(context.texture(params, "color", Rgb(1), 1)),
          is_weight_(params.choice("output", {"fuzz_color", "fuzz_weight"}, 0) == 1) {}

    Rgb eval(const TexturePoint& at) const override { return of(color_.eval(at)); }
    float eval_scalar(const TexturePoint& at) const override {
        return is_weight_ ? eval(at).r : luminance(eval(at));
    }
    Rgb mean() const override { return of(color_.mean()); }  // exact where it is constant
    void resolution(int& width, int& height) const override { color_.resolution(width, height); }

private:
    Rgb of(Rgb color) const {
        const float weight = color.max();
        if (is_weight_) return Rgb(weight);
        return weight > 0 ? color / weight : Rgb(1);
    }

    TextureRef color_;
    bool is_weight_;
};

}  // namespace

TextureEntry sheen_to_fuzz_entry() {
    return {
        {"texture",
         "sheen_to_fuzz",
         "A colour of sheen in the parameters of openpbr.",
         {{"color", ParamKind::Texture, "1", "The colour of the sheen, in [0, 1]."},
          {"output", ParamKind::String, "fuzz_color",
           "Parameter that the texture is: fuzz_color, or fuzz_weight, the largest component."}}},
        [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
            return std::make_unique<SheenToFuzz>(params, context);
        }};
}

}  // namespace etendue
