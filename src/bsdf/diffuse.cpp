// Ideal diffuse reflection.
//   reflectance (0.5)  colour or texture in [0, 1]
// One-sided: black from behind.

#include "bsdf/diffuse.h"

#include "bsdf/material.h"

namespace etendue {
namespace {

class Diffuse final : public Material {
public:
    Diffuse(const Params& params, MaterialContext& context)
        : reflectance_(context.texture(params, "reflectance", Rgb(0.5f), 1)) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        list.add(frame, DiffuseLobe{reflectance_.eval(point)}, weight);
    }
    bool needs_tangents() const override { return false; }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override { return reflectance_.mean(); }

private:
    TextureRef reflectance_;
};

}  // namespace

MaterialEntry diffuse_entry() {
    return {{"bsdf",
             "diffuse",
             "Ideal diffuse (Lambertian) reflection.",
             {{"reflectance", ParamKind::Texture, "0.5",
               "Fraction of light that is reflected, in [0, 1]."}}},
            make_material<Diffuse>};
}

}  // namespace etendue
