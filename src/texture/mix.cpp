// Linear mixture of two textures: (1 - weight)·value0 + weight·value1.
//   value0 (0), value1 (1)   colours or textures
//   weight (0.5)             number or texture

#include "texture/texture.h"

namespace etendue {
namespace {

class Mix final : public Texture {
public:
    Mix(const Params& params, TextureContext& context)
        : value0_(context.texture(params, "value0", Rgb(0))),
          value1_(context.texture(params, "value1", Rgb(1))),
          weight_(context.texture(params, "weight", Rgb(0.5f), 1)) {}

    Rgb eval(const TexturePoint& at) const override {
        return lerp(weight_.eval_scalar(at), value0_.eval(at), value1_.eval(at));
    }
    float eval_scalar(const TexturePoint& at) const override {
        return lerp(weight_.eval_scalar(at), value0_.eval_scalar(at), value1_.eval_scalar(at));
    }
    bool has_jet() const override {
        return value0_.has_jet() && value1_.has_jet() && weight_.has_jet();
    }
    RgbDual eval_jet(const TextureJetPoint& at) const override {
        return lerp(weight_.scalar_jet(at), value0_.eval_jet(at), value1_.eval_jet(at));
    }
    Dual scalar_jet(const TextureJetPoint& at) const override {
        return lerp(weight_.scalar_jet(at), value0_.scalar_jet(at), value1_.scalar_jet(at));
    }
    Rgb mean() const override {  // exact where the weight is constant
        return lerp(luminance(weight_.mean()), value0_.mean(), value1_.mean());
    }
    void resolution(int& width, int& height) const override {
        width = height = 1;
        refine(width, height, {&value0_, &value1_, &weight_});
    }

private:
    TextureRef value0_, value1_, weight_;
};

}  // namespace

TextureEntry mix_entry() {
    return {{"texture",
             "mix",
             "Linear mixture of two textures.",
             {{"value0", ParamKind::Texture, "0", "Where the weight is 0."},
              {"value1", ParamKind::Texture, "1", "Where the weight is 1."},
              {"weight", ParamKind::Texture, "0.5", "Fraction of value1, in [0, 1]."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<Mix>(params, context);
            }};
}

}  // namespace etendue
