// Diffuse reflection and transmission, as of paper or a leaf.
//   reflectance (0.25)     colour or texture
//   transmittance (0.25)   colour or texture; the sum of both must be at most 1, which is not checked for textures
// The same from both sides.

#include "bsdf/diffusetransmission.h"

#include "bsdf/material.h"

namespace etendue {
namespace {

class DiffuseTransmission final : public Material {
public:
    DiffuseTransmission(const Params& params, MaterialContext& context)
        : reflectance_(context.texture(params, "reflectance", Rgb(0.25f), 1)),
          transmittance_(context.texture(params, "transmittance", Rgb(0.25f), 1)) {
        if (reflectance_.is_constant() && transmittance_.is_constant() &&
            (reflectance_.mean() + transmittance_.mean()).max() > 1)
            params.fail("bsdf \"diffusetransmission\" reflects and transmits more than there is: "
                        "reflectance + transmittance is above 1");
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        list.add(frame,
                 DiffuseTransmissionLobe{reflectance_.eval(point.texture_point()),
                                         transmittance_.eval(point.texture_point())},
                 weight);
    }
    bool is_transmissive() const override { return true; }
    bool needs_tangents() const override { return false; }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override { return reflectance_.mean() + transmittance_.mean(); }

private:
    TextureRef reflectance_, transmittance_;
};

}  // namespace

MaterialEntry diffusetransmission_entry() {
    return {{"bsdf",
             "diffusetransmission",
             "Diffuse reflection and transmission.",
             {{"reflectance", ParamKind::Texture, "0.25",
               "Fraction of light that is reflected, in [0, 1]."},
              {"transmittance", ParamKind::Texture, "0.25",
               "Fraction of light that is transmitted; at most 1 together with reflectance."}}},
            make_material<DiffuseTransmission>};
}

}  // namespace etendue
