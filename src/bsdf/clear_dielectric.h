#pragma once

#include "bsdf/ior.h"

namespace etendue {

/// A material of one lobe that reflects and transmits without scattering: {η, factor of reflection, of transmission}.
template <class Lobe>
class ClearDielectric final : public Material {
public:
    ClearDielectric(const Params& params, MaterialContext& context)
        : eta_(read_relative_ior(params)),
          reflectance_(context.texture(params, "specular_reflectance", Rgb(1))),
          transmittance_(context.texture(params, "specular_transmittance", Rgb(1))) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        list.add(frame, Lobe{eta_, reflectance_.eval(at), transmittance_.eval(at)}, weight);
    }
    bool is_transmissive() const override { return true; }
    bool may_be_smooth() const override { return false; }
    Rgb mean_albedo() const override {
        return Lobe{eta_, reflectance_.mean(), transmittance_.mean()}.albedo_estimate();
    }

private:
    float eta_;
    TextureRef reflectance_, transmittance_;
};

}  // namespace etendue
