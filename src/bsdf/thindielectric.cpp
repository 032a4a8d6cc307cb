// Pane so thin that transmitted light goes straight on; internal reflections are included.
//   int_ior (bk7), ext_ior (air)   indices of the pane and of the medium around it; numbers or names
//   specular_reflectance (1), specular_transmittance (1)   factors; only 1 is physical

#include "bsdf/thindielectric.h"

#include "bsdf/ior.h"

namespace etendue {
namespace {

class ThinDielectric final : public Material {
public:
    ThinDielectric(const Params& params, MaterialContext& context)
        : eta_(read_relative_ior(params)),
          reflectance_(context.texture(params, "specular_reflectance", Rgb(1))),
          transmittance_(context.texture(params, "specular_transmittance", Rgb(1))) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        list.add(frame,
                 ThinDielectricLobe{eta_, reflectance_.eval(point.texture_point()),
                                    transmittance_.eval(point.texture_point())},
                 weight);
    }
    bool is_transmissive() const override { return true; }
    bool may_be_smooth() const override { return false; }
    Rgb mean_albedo() const override {
        return ThinDielectricLobe{eta_, reflectance_.mean(), transmittance_.mean()}
            .albedo_estimate();
    }

private:
    float eta_;
    TextureRef reflectance_, transmittance_;
};

}  // namespace

MaterialEntry thindielectric_entry() {
    return {
        {"bsdf", "thindielectric",
         "Thin pane of glass: reflects, and transmits straight ahead, with internal reflections.",
         dielectric_params()},
        make_material<ThinDielectric>};
}

}  // namespace etendue
