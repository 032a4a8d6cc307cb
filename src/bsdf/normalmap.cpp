// Normal mapping: shades a material with normals from a texture.
//   normalmap (required)  texture of (n + 1)/2 in the shading frame with x along ∂p/∂u; raw, not
//                         sRGB
//   scale (1)             factor on the x and y of n
//   nested: one bsdf
// In a two-sided material the normals are tilted equally on both sides, as in Mitsuba 3.

#include "bsdf/wrapper.h"

namespace etendue {
namespace {

class NormalMap final : public WrapperMaterial {
public:
    NormalMap(const Params& params, MaterialContext& context) : WrapperMaterial(params, context) {
        refuse_view_dependence(params);
        if (!params.has("normalmap"))
            params.fail("bsdf \"normalmap\" needs a texture \"normalmap\"");
        scale_ = params.number("scale", 1);
        normals_ = context.texture(params, "normalmap", Rgb(0.5f, 0.5f, 1), 1);
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const Rgb c = normals_.eval(point.texture_point());
        nested_->append(point, tilted(point, frame, c), weight, list);
    }
    bool perturbs_normals() const override { return true; }
    bool has_jet() const override { return normals_.has_jet() && nested_->has_jet(); }
    void turn(const SurfacePointJet& point, FrameOf<Vec3Dual>& frame) const override {
        frame = tilted(point, frame, normals_.eval_jet(point.at));
        nested_->turn(point, frame);
    }

private:
    template <class Point, class V, class Color>
    FrameOf<V> tilted(const Point& point, const FrameOf<V>& frame, const Color& c) const {
        // A two-sided material reverses t together with n, but the y of the map must not change.
        const float t_sign = dot(frame.n, point.ng) < 0 ? -1.0f : 1.0f;
        const V n =
            frame.to_world({(2 * c.r - 1) * scale_, (2 * c.g - 1) * scale_ * t_sign, 2 * c.b - 1});
        return perturbed_frame(point, frame, n);
    }

    TextureRef normals_;
    float scale_;
};

}  // namespace

MaterialEntry normalmap_entry() {
    return {
        {"bsdf",
         "normalmap",
         "Shades a material with normals from a texture.",
         {{"normalmap", ParamKind::Texture, "",
           "Raw texture that holds (n + 1)/2, with the normal n in the shading frame; required."},
          {"scale", ParamKind::Float, "1", "Factor on the x and y of the normals."},
          {"flip_invalid_normals", ParamKind::Bool, "false", kFlipInvalidNormalsDoc},
          {"use_shadowing_function", ParamKind::Bool, "false", kShadowingFunctionDoc},
          {"bsdf", ParamKind::Object, "", "The nested material."}}},
        make_material<NormalMap>};
}

}  // namespace etendue
