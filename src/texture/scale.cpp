// Product of two textures, like `scale` of Mitsuba 0.6 and pbrt.
//   value (required)   texture; its name may be left out
//   scale (1)          factor: number, colour or texture

#include "texture/texture.h"

namespace etendue {
namespace {

class Scale final : public Texture {
public:
    Scale(const Params& params, TextureContext& context)
        : value_(context.texture(params, value_name(params), Rgb(1))),
          scale_(context.texture(params, "scale", Rgb(1))) {}

    Rgb eval(const TexturePoint& at) const override { return value_.eval(at) * scale_.eval(at); }
    float eval_scalar(const TexturePoint& at) const override {
        return is_by_number() ? value_.eval_scalar(at) * number() : luminance(eval(at));
    }
    Vec2 gradient(const TexturePoint& at) const override {
        return is_by_number() ? value_.gradient(at) * number() : Texture::gradient(at);
    }
    bool has_jet() const override { return value_.has_jet() && scale_.has_jet(); }
    RgbDual eval_jet(const TextureJetPoint& at) const override {
        return value_.eval_jet(at) * scale_.eval_jet(at);
    }
    Dual scalar_jet(const TextureJetPoint& at) const override {
        return is_by_number() ? value_.scalar_jet(at) * double(number()) : luminance(eval_jet(at));
    }
    Vec2Dual gradient_jet(const TextureJetPoint& at) const override {
        return is_by_number() ? value_.gradient_jet(at) * double(number())
                              : Texture::gradient_jet(at);
    }
    Rgb mean() const override {  // exact where one of the two is constant
        return value_.mean() * scale_.mean();
    }
    void resolution(int& width, int& height) const override {
        value_.resolution(width, height);
        refine(width, height, {&scale_});
    }

private:
    bool is_by_number() const { return scale_.is_constant() && is_grey(scale_.mean()); }
    float number() const { return scale_.mean().r; }
    static std::string value_name(const Params& params) {
        if (params.has("value")) return "value";
        for (const auto& c : params.children("texture"))
            if (c.name != "scale") return c.name;
        params.fail("texture \"scale\" needs a texture to scale");
    }

    TextureRef value_, scale_;
};

}  // namespace

TextureEntry scale_entry() {
    return {{"texture",
             "scale",
             "Product of a texture and a number, a colour or another texture.",
             {{"value", ParamKind::Texture, "", "The texture to scale; it may be unnamed."},
              {"scale", ParamKind::Texture, "1", "The factor."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<Scale>(params, context);
            }};
}

}  // namespace etendue
