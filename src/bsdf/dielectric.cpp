// Smooth boundary between two dielectrics: the surface of glass or water.
//   int_ior (bk7), ext_ior (air)   indices behind and in front of the surface; numbers or names
//   specular_reflectance (1), specular_transmittance (1)   factors; only 1 is physical

#include "bsdf/dielectric.h"

#include "bsdf/ior.h"

namespace etendue {
namespace {

class Dielectric final : public Material {
public:
    Dielectric(const Params& params, MaterialContext& context)
        : eta_(read_relative_ior(params)),
          reflectance_(context.texture(params, "specular_reflectance", Rgb(1))),
          transmittance_(context.texture(params, "specular_transmittance", Rgb(1))) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        list.add(frame,
                 DielectricLobe{eta_, reflectance_.eval(point.texture_point()),
                                transmittance_.eval(point.texture_point())},
                 weight);
    }
    bool is_transmissive() const override { return true; }
    bool may_be_smooth() const override { return false; }
    Rgb mean_albedo() const override {
        return DielectricLobe{eta_, reflectance_.mean(), transmittance_.mean()}.albedo_estimate();
    }

private:
    float eta_;
    TextureRef reflectance_, transmittance_;
};

}  // namespace

MaterialEntry dielectric_entry() {
    return {{"bsdf", "dielectric",
             "Smooth boundary between two dielectrics, such as glass and air.",
             dielectric_params()},
            make_material<Dielectric>};
}

}  // namespace etendue
