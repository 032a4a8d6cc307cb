// Linear blend of two materials: (1 - weight)·first + weight·second.
//   weight (required)  number or texture; clamped to [0, 1]
//   nested: two bsdfs, which may be blends themselves
// Opacities are blended in the same way. Where a ray meets the surface, each material has its share of the blended
// opacity.

#include <array>

#include "bsdf/wrapper.h"

namespace etendue {
namespace {

class BlendBsdf final : public Material {
public:
    BlendBsdf(const Params& params, MaterialContext& context) {
        if (!params.has("weight"))
            params.fail("bsdf \"blendbsdf\" needs a \"weight\" (number or texture)");
        weight_ = context.texture(params, "weight", Rgb(0.5f), 1);
        const auto nested = nested_materials(params, context, 2, 2);
        nested_ = {nested[0], nested[1]};
        check_components(params, *this);
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const std::array<float, 2> share = shares(point.texture_point());
        const float total = share[0] + share[1];
        if (!(total > 0)) return;
        for (int i = 0; i < 2; ++i)
            if (share[i] > 0) nested_[i]->append(point, frame, weight * share[i] / total, list);
    }
    float opacity(const TexturePoint& at) const override {
        const std::array<float, 2> share = shares(at);
        return share[0] + share[1];
    }
    bool is_opaque() const override { return nested_[0]->is_opaque() && nested_[1]->is_opaque(); }
    bool is_transmissive() const override {
        return nested_[0]->is_transmissive() || nested_[1]->is_transmissive();
    }
    bool is_two_sided() const override {
        return nested_[0]->is_two_sided() || nested_[1]->is_two_sided();
    }
    bool may_be_smooth() const override {
        return nested_[0]->may_be_smooth() || nested_[1]->may_be_smooth();
    }
    bool may_have_delta() const override {
        return nested_[0]->may_have_delta() || nested_[1]->may_have_delta();
    }
    int max_components() const override {
        return nested_[0]->max_components() + nested_[1]->max_components();
    }
    bool perturbs_normals() const override {
        return nested_[0]->perturbs_normals() || nested_[1]->perturbs_normals();
    }
    Rgb mean_albedo() const override {
        return lerp(luminance(weight_.mean()), nested_[0]->mean_albedo(),
                    nested_[1]->mean_albedo());
    }

private:
    /// Probability that a ray meets the first or the second material at `uv`.
    std::array<float, 2> shares(const TexturePoint& at) const {
        const float w = weight_.eval_scalar(at);
        return {(1 - w) * nested_[0]->opacity(at), w * nested_[1]->opacity(at)};
    }

    TextureRef weight_;
    std::array<const Material*, 2> nested_;
};

}  // namespace

MaterialEntry blendbsdf_entry() {
    return {{"bsdf",
             "blendbsdf",
             "Linear blend of two materials.",
             {{"weight", ParamKind::Texture, "",
               "Fraction of the second material, in [0, 1]; required."},
              {"bsdf", ParamKind::Object, "", "The two nested materials."}}},
            make_material<BlendBsdf>};
}

}  // namespace etendue
