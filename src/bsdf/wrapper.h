#pragma once
// Shared parts of materials that modify nested materials.

#include <algorithm>

#include <fmt/format.h>

#include "bsdf/material.h"

namespace etendue {

/// The materials nested in `params`; throws SceneError where there are fewer than `lo` or more than `hi`.
inline std::vector<const Material*> nested_materials(const Params& params, MaterialContext& context,
                                                     size_t lo, size_t hi) {
    std::vector<const Material*> nested = context.nested(params);
    if (nested.size() < lo || nested.size() > hi)
        params.fail(fmt::format("bsdf \"{}\" must hold {} nested bsdf{}, but holds {}",
                                params.object().type,
                                lo == hi ? std::to_string(lo) : fmt::format("{} or {}", lo, hi),
                                hi == 1 ? "" : "s", nested.size()));
    return nested;
}

/// Throws SceneError where BsdfSample::event could not tell the delta events of a mixture apart.
inline void check_components(const Params& params, const Material& mixture) {
    constexpr int kMost = 128;
    if (mixture.may_have_delta() && mixture.max_components() > kMost)
        params.fail(
            fmt::format("bsdf \"{}\" has {} materials, but where one of them may be a mirror or "
                        "clear glass, {} are the most",
                        params.object().type, mixture.max_components(), kMost));
}

/// A material that modifies one nested material; everything not overridden is that of the nested one.
class WrapperMaterial : public Material {
public:
    float opacity(const TexturePoint& at) const override { return nested_->opacity(at); }
    bool is_opaque() const override { return nested_->is_opaque(); }
    bool is_transmissive() const override { return nested_->is_transmissive(); }
    bool is_two_sided() const override { return nested_->is_two_sided(); }
    bool may_be_smooth() const override { return nested_->may_be_smooth(); }
    bool may_have_delta() const override { return nested_->may_have_delta(); }
    int max_components() const override { return nested_->max_components(); }
    bool perturbs_normals() const override { return nested_->perturbs_normals(); }
    bool has_jet() const override { return nested_->has_jet(); }
    void turn(const SurfacePointJet& point, FrameOf<Vec3Dual>& frame) const override {
        nested_->turn(point, frame);
    }
    Rgb mean_albedo() const override { return nested_->mean_albedo(); }

protected:
    WrapperMaterial(const Params& params, MaterialContext& context)
        : nested_(nested_materials(params, context, 1, 1).front()) {}

    const Material* nested_;
};

// Options of the bump and normal maps of Mitsuba 3.7, which are known but not supported.
inline constexpr const char* kFlipInvalidNormalsDoc =
    "Refused if true: it would turn normals toward the viewer.";
inline constexpr const char* kShadowingFunctionDoc =
    "Refused if true: it would soften the shadow terminator for one view direction.";

/// Throws SceneError where one of these options is set: they make a material depend on which of the two directions is
/// that of the view.
inline void refuse_view_dependence(const Params& params) {
    for (const char* name : {"flip_invalid_normals", "use_shadowing_function"})
        if (params.flag(name, false))
            params.fail(
                name,
                fmt::format("parameter \"{}\" must be false: it is not defined for light paths",
                            name));
}

/// The shading frame `frame` turned to the normal `n` (of any length, in world space). The result stays on the side of
/// `frame.n` of the geometric surface: an `n` beyond it is mirrored about `frame.n`, as in Mitsuba 3 [Schüssler et al.
/// 2017]. The condition uses ng, never the direction of view, so that both ends of a path see the same surface. Where
/// mirroring does not help, or `n` is zero or not finite, `frame` is returned.
template <class Point, class V>
FrameOf<V> perturbed_frame(const Point& point, const FrameOf<V>& frame, V n) {
    using std::isfinite;
    const auto len = length(n);
    if (!(len > 0 && isfinite(len))) return frame;
    n = n * (1 / len);
    auto is_inside = [&](V m) {
        return dot(m, frame.n) > 0 && dot(m, point.ng) * dot(frame.n, point.ng) > 0;
    };
    if (!is_inside(n)) n = reflect(n, frame.n);
    return is_inside(n) ? FrameOf<V>::from_normal_and_tangent(n, frame.s) : frame;
}

}  // namespace etendue
