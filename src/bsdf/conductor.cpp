// Smooth metal, or a perfect mirror.
//   material (none), or eta, k   named metal, "none" for reflectance 1, or its complex index
//   specular_reflectance (1)     factor of the reflectance; only 1 is physical
// One-sided: black from behind.

#include "bsdf/conductor.h"

#include "bsdf/ior.h"

namespace etendue {
namespace {

class Conductor final : public Material {
public:
    Conductor(const Params& params, MaterialContext& context)
        : ior_(params, context),
          reflectance_(context.texture(params, "specular_reflectance", Rgb(1))) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        list.add(frame, ConductorLobe{ior_.eta.eval(at), ior_.k.eval(at), reflectance_.eval(at)},
                 weight);
    }
    bool may_be_smooth() const override { return false; }
    Rgb mean_albedo() const override {
        return ConductorLobe{ior_.eta.mean(), ior_.k.mean(), reflectance_.mean()}.albedo_estimate();
    }

private:
    ConductorIndex ior_;
    TextureRef reflectance_;
};

}  // namespace

MaterialEntry conductor_entry() {
    return {{"bsdf", "conductor", "Smooth metal with Fresnel reflectance, or a perfect mirror.",
             conductor_params()},
            make_material<Conductor>};
}

}  // namespace etendue
