// Rough diffuse reflection [Oren & Nayar 1994], the qualitative model without interreflection, as pbrt-v3 has it.
//   reflectance (0.5)  colour or texture in [0, 1], albedo of the facets
//   sigma (20)         standard deviation of the facets' slopes in degrees
// Reciprocal. One-sided. Up to 1.6 % more light than `reflectance` is reflected at grazing angles where sigma is near
// 11 degrees.

#include "bsdf/orennayar.h"

#include "bsdf/material.h"

namespace etendue {
namespace {

class OrenNayar final : public Material {
public:
    OrenNayar(const Params& params, MaterialContext& context)
        : reflectance_(context.texture(params, "reflectance", Rgb(0.5f), 1)) {
        const float sigma2 = sqr(params.number("sigma", 20, 0, 90) * kPi / 180);
        A_ = 1 - sigma2 / (2 * (sigma2 + 0.33f));
        B_ = 0.45f * sigma2 / (sigma2 + 0.09f);
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        list.add(frame, OrenNayarLobe{reflectance_.eval(point.texture_point()), A_, B_}, weight);
    }
    bool needs_tangents() const override { return false; }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override { return reflectance_.mean(); }

private:
    TextureRef reflectance_;
    float A_, B_;
};

}  // namespace

MaterialEntry orennayar_entry() {
    return {{"bsdf",
             "orennayar",
             "Rough diffuse reflection [Oren & Nayar 1994].",
             {{"reflectance", ParamKind::Texture, "0.5", "Albedo of the facets, in [0, 1]."},
              {"sigma", ParamKind::Float, "20",
               "Standard deviation of the facets' slopes in degrees, 0 to 90."}}},
            make_material<OrenNayar>};
}

}  // namespace etendue
