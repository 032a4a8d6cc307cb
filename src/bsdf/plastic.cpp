// Smooth plastic: a clear dielectric coat over a diffuse base.
//   diffuse_reflectance (0.5)   colour or texture in [0, 1]
//   specular_reflectance (1)    colour or texture in [0, 1], factor on the mirror reflection
//   int_ior (polypropylene), ext_ior (air)   indices of the coat and outside; numbers or names
//   nonlinear (false)           whether interreflection under the coat saturates the colour
//   thickness (0)               optical thickness of the coat: its thickness times its absorption coefficient
// Reciprocal. One-sided.

#include "bsdf/plastic.h"

#include "bsdf/ior.h"
#include "bsdf/plastic_params.h"

namespace etendue {

PlasticParams::PlasticParams(const Params& params, MaterialContext& context)
    : diffuse(context.texture(params, "diffuse_reflectance", Rgb(0.5f), 1)),
      specular(context.texture(params, "specular_reflectance", Rgb(1), 1)),
      eta(read_ior(params, "int_ior", "polypropylene") / read_ior(params, "ext_ior", "air")),
      nonlinear(params.flag("nonlinear", false)), thickness(params.number("thickness", 0, 0)) {}

PlasticParams::Colors PlasticParams::eval(const TexturePoint& at, float loss) const {
    const Rgb d = diffuse.eval(at), s = specular.eval(at);
    const Rgb lost = nonlinear ? Rgb(1) - d + d * loss : Rgb(loss);
    const float sum = s.mean() + d.mean();
    return {.diffuse = d / (lost * sqr(eta)),
            .specular = s,
            .specular_share = sum > 0 ? s.mean() / sum : 0};
}

Rgb PlasticParams::mean_albedo() const {
    return lerp(fresnel_dielectric(1, eta).R, diffuse.mean(), specular.mean());
}

std::vector<ParamInfo> PlasticParams::table() {
    return {{"diffuse_reflectance", ParamKind::Texture, "0.5",
             "Albedo of the base under the coat, in [0, 1]."},
            {"specular_reflectance", ParamKind::Texture, "1",
             "Factor on the reflection of the coat, in [0, 1]."},
            {"int_ior", ParamKind::FloatOrName, "polypropylene",
             "Index of refraction of the coat, above 0."},
            {"ext_ior", ParamKind::FloatOrName, "air", "Index of refraction outside, above 0."},
            {"nonlinear", ParamKind::Bool, "false",
             "Whether interreflection under the coat saturates the colour."},
            {"thickness", ParamKind::Float, "0",
             "Optical thickness of the coat: its thickness times its absorption coefficient."}};
}

namespace {

class Plastic final : public Material {
public:
    Plastic(const Params& params, MaterialContext& context)
        : params_(params, context), loss_(loss_below_coat(params_.eta, params_.thickness)) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const auto [diffuse, specular, specular_share] = params_.eval(point.texture_point(), loss_);
        list.add(frame,
                 PlasticLobe{diffuse, specular, params_.eta, specular_share, params_.thickness},
                 weight);
    }
    Rgb mean_albedo() const override { return params_.mean_albedo(); }

private:
    PlasticParams params_;
    float loss_;
};

}  // namespace

MaterialEntry plastic_entry() {
    return {
        {"bsdf", "plastic", "Smooth dielectric coat over a diffuse base.", PlasticParams::table()},
        make_material<Plastic>};
}

}  // namespace etendue
