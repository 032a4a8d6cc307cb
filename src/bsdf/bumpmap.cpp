// Bump mapping [Blinn 1978]: shades a material with the normal of the surface displaced along its
// normal.
//   displacement (required)  texture of heights in units of the scene; its name may be left out
//   scale (1)                factor of the heights
//   nested: one bsdf
// With the height h(u, v) the components of the tangents ∂p/∂u and ∂p/∂v along n become ∂h/∂u and ∂h/∂v; the change of
// n along the surface is neglected. In a two-sided material bumps are raised on both sides. Surfaces without tangents
// are not changed.

#include "bsdf/wrapper.h"

namespace etendue {
namespace {

class BumpMap final : public WrapperMaterial {
public:
    BumpMap(const Params& params, MaterialContext& context)
        : WrapperMaterial(params, context), scale_(params.number("scale", 1)) {
        refuse_view_dependence(params);
        const auto textures = params.children("texture");
        if (textures.size() > 1 || (textures.empty() && !params.has("displacement")))
            params.fail("bsdf \"bumpmap\" must hold exactly one texture, the displacement");
        height_ = context.texture(params, textures.empty() ? "displacement" : textures.front().name,
                                  Rgb(0));
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        nested_->append(point, bumped(point, at, frame, height_.gradient(at) * scale_), weight,
                        list);
    }
    bool perturbs_normals() const override { return true; }
    bool has_jet() const override { return height_.has_jet() && nested_->has_jet(); }
    void turn(const SurfacePointJet& point, FrameOf<Vec3Dual>& frame) const override {
        const Vec2Dual slope = height_.gradient_jet(point.at) * double(scale_);
        frame = bumped(point, point.at, frame, slope);
        nested_->turn(point, frame);
    }

private:
    template <class Point, class At, class V, class Slope>
    FrameOf<V> bumped(const Point& point, const At& at, const FrameOf<V>& frame,
                      const Slope& slope) const {
        if (height_.is_constant()) return frame;
        const V n = frame.n, normal = cross(at.dpdu + n * (slope.x - dot(n, at.dpdu)),
                                            at.dpdv + n * (slope.y - dot(n, at.dpdv)));
        return perturbed_frame(point, frame, dot(normal, n) < 0 ? -normal : normal);
    }

    TextureRef height_;
    float scale_;
};

}  // namespace

MaterialEntry bumpmap_entry() {
    return {{"bsdf",
             "bumpmap",
             "Shades a material with the normals of a displaced surface [Blinn 1978].",
             {{"displacement", ParamKind::Texture, "",
               "Heights in scene units; the texture may be unnamed."},
              {"arbitrary", ParamKind::Texture, "",
               "The same as displacement; the name in Mitsuba's manual."},
              {"scale", ParamKind::Float, "1", "Factor on the heights."},
              {"flip_invalid_normals", ParamKind::Bool, "false", kFlipInvalidNormalsDoc},
              {"use_shadowing_function", ParamKind::Bool, "false", kShadowingFunctionDoc},
              {"bsdf", ParamKind::Object, "", "The nested material."}}},
            make_material<BumpMap>};
}

}  // namespace etendue
