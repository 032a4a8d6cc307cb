// A material of diffuse and specular colours, such as the older one of glTF, in the parameters of `principled` and `openpbr`.
//   diffuse (1), specular (1)   colours or textures
//   output (base_color)         or metallic, specular_weight: which parameter the texture is

#include "color/metallic_color.h"
#include "texture/texture.h"

namespace etendue {
namespace {

class SpecularToMetallic final : public Texture {
public:
    SpecularToMetallic(const Params& params, TextureContext& context)
        : diffuse_(context.texture(params, "diffuse", Rgb(1))),
          specular_(context.texture(params, "specular", Rgb(1))),
          output_(
              Output(params.choice("output", {"base_color", "metallic", "specular_weight"}, 0))) {}

    Rgb eval(const TexturePoint& at) const override {
        return of(diffuse_.eval(at), specular_.eval(at));
    }
    float eval_scalar(const TexturePoint& at) const override {
        return output_ == Output::BaseColor ? luminance(eval(at)) : eval(at).r;
    }
    Rgb mean() const override {  // exact where both are constant
        return of(diffuse_.mean(), specular_.mean());
    }
    void resolution(int& width, int& height) const override {
        diffuse_.resolution(width, height);
        refine(width, height, {&specular_});
    }

private:
    enum class Output { BaseColor, Metallic, SpecularWeight };

    Rgb of(Rgb diffuse, Rgb specular) const {
        const MetallicColor made = metallic_color(diffuse, specular);
        switch (output_) {
        case Output::Metallic: return Rgb(made.metallic);
        case Output::SpecularWeight: return Rgb(made.specular_weight);
        default: return made.base;
        }
    }

    TextureRef diffuse_, specular_;
    Output output_;
};

}  // namespace

TextureEntry specular_to_metallic_entry() {
    return {{"texture",
             "specular_to_metallic",
             "A diffuse and a specular colour in the parameters of principled and openpbr.",
             {{"diffuse", ParamKind::Texture, "1", "The diffuse colour."},
              {"specular", ParamKind::Texture, "1", "The reflectance at normal incidence."},
              {"output", ParamKind::String, "base_color",
               "Parameter that the texture is: base_color, metallic (base_metalness) or "
               "specular_weight."}}},
            [](const Params& params, TextureContext& context) -> std::unique_ptr<Texture> {
                return std::make_unique<SpecularToMetallic>(params, context);
            }};
}

}  // namespace etendue
