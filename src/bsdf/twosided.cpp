// Makes a reflecting material visible from both sides.
//   nested: one bsdf for both sides, or two, the first where the normal points, the second behind
// The frame is turned to wo's side of the geometric surface, or of the shading surface where normals are not strict.
// Nested materials must not transmit light.

#include "bsdf/wrapper.h"

namespace etendue {
namespace {

class TwoSided final : public Material {
public:
    TwoSided(const Params& params, MaterialContext& context) {
        const auto nested = nested_materials(params, context, 1, 2);
        for (const Material* m : nested)
            if (m->is_transmissive() || !m->is_opaque())
                params.fail("bsdf \"twosided\" cannot hold a material that lets light pass "
                            "(to mask it, put the \"twosided\" into a \"mask\")");
        front_ = nested.front();
        back_ = nested.back();
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        if (sees_front(point, frame))
            front_->append(point, frame, weight, list);
        else
            append_back(point, frame, weight, list);
    }
    bool is_two_sided() const override { return true; }
    bool may_be_smooth() const override {
        return front_->may_be_smooth() || back_->may_be_smooth();
    }
    bool may_have_delta() const override {
        return front_->may_have_delta() || back_->may_have_delta();
    }
    int max_components() const override {
        return std::max(front_->max_components(), back_->max_components());
    }
    bool needs_tangents() const override {
        return front_->needs_tangents() || back_->needs_tangents();
    }
    bool perturbs_normals() const override {
        return front_->perturbs_normals() || back_->perturbs_normals();
    }
    bool has_jet() const override { return front_->has_jet() && back_->has_jet(); }
    void turn(const SurfacePointJet& point, FrameOf<Vec3Dual>& frame) const override {
        const bool is_front = sees_front(point, frame);
        if (!is_front) frame = frame.flipped();
        (is_front ? front_ : back_)->turn(point, frame);
    }
    Rgb mean_albedo() const override {
        return (front_->mean_albedo() + back_->mean_albedo()) * 0.5f;
    }

private:
    /// A function of its own: together, both cases would load two coordinates of the normal at once, which stalls on the
    /// stores that have just written them.
    [[gnu::noinline]] void append_back(const SurfacePoint& point, const Frame& frame, float weight,
                                       ComponentList& list) const {
        back_->append(point, frame.flipped(), weight, list);
    }

    const Material* front_;
    const Material* back_;
};

}  // namespace

MaterialEntry twosided_entry() {
    return {
        {"bsdf",
         "twosided",
         "Shows one reflecting material on both sides, or one material on the front and another on "
         "the back.",
         {{"bsdf", ParamKind::Object, "",
           "One or two nested materials without transmission: first the front, then the back."}}},
        make_material<TwoSided>};
}

}  // namespace etendue
