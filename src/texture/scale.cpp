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
        if (!scale_.is_constant() || !is_grey(scale_.eval(at))) return luminance(eval(at));
        return value_.eval_scalar(at) * scale_.eval_scalar(at);
    }
    Vec2 gradient(const TexturePoint& at) const override {
        if (!scale_.is_constant() || !is_grey(scale_.eval(at))) return Texture::gradient(at);
        return value_.gradient(at) * scale_.eval(at).r;
    }
    Rgb mean() const override {  // exact where one of the two is constant
        return value_.mean() * scale_.mean();
    }
    void resolution(int& width, int& height) const override {
        value_.resolution(width, height);
        refine(width, height, {&scale_});
    }

private:
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
