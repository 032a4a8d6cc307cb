// Opacity mask: a ray meets the nested material with probability `opacity`, and otherwise passes unchanged.
//   opacity (0.5)  number or texture; clamped to [0, 1]
//   nested: one bsdf
// Ray traversal (Scene::intersect()) decides whether a ray passes, so the nested material is not scaled.

#include "bsdf/wrapper.h"

namespace etendue {
namespace {

class Mask final : public WrapperMaterial {
public:
    Mask(const Params& params, MaterialContext& context)
        : WrapperMaterial(params, context),
          opacity_(context.texture(params, "opacity", Rgb(0.5f), 1)) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        nested_->append(point, frame, weight, list);
    }
    float opacity(const TexturePoint& at) const override {
        return opacity_.eval_scalar(at) * nested_->opacity(at);
    }
    bool is_opaque() const override {
        return nested_->is_opaque() && opacity_.is_constant() && opacity_.eval_scalar(Vec2()) >= 1;
    }

private:
    TextureRef opacity_;
};

}  // namespace

MaterialEntry mask_entry() {
    return {{"bsdf",
             "mask",
             "Lets light pass through a material where its opacity is below one.",
             {{"opacity", ParamKind::Texture, "0.5",
               "Probability that a ray hits the surface, in [0, 1]."},
              {"bsdf", ParamKind::Object, "", "The nested material."}}},
            make_material<Mask>};
}

}  // namespace etendue
