// 1 where another texture reaches a threshold, and 0 elsewhere, as the alpha of glTF.
//   value (required)   number or texture
//   cutoff (0.5)       the threshold

#include "texture/texture.h"

namespace etendue {
namespace {

class Threshold final : public Texture {
public:
    Threshold(const Params& params, TextureContext& context)
        : value_(context.texture(params, "value", Rgb(1))), cutoff_(params.number("cutoff", 0.5f)) {
    }

    Rgb eval(const TexturePoint& at) const override { return Rgb(eval_scalar(at)); }
    float eval_scalar(const TexturePoint& at) const override {
        return value_.eval_scalar(at) >= cutoff_ ? 1.0f : 0.0f;
    }
    Rgb mean() const override { return Rgb(0.5f); }  // unknown
    void resolution(int& width, int& height) const override { value_.resolution(width, height); }

private:
    TextureRef value_;
    float cutoff_;
};

}  // namespace

TextureEntry threshold_entry() {
    return {{"texture",
             "threshold",
             "1 where a texture reaches a threshold, and 0 elsewhere.",
             {{"value", ParamKind::Texture, "1", "The texture."},
              {"cutoff", ParamKind::Float, "0.5", "The threshold."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<Threshold>(params, context);
            }};
}

}  // namespace etendue
