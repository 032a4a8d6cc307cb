#pragma once
// Materials, each made from a <bsdf> of the scene file. A material looks up its textures at a surface point and returns
// the `Bsdf` there; it is immutable and shared by all threads.

#include <memory>
#include <vector>

#include "bsdf/bsdf.h"
#include "description/params.h"
#include "texture/texture.h"

namespace etendue {

/// A point on a surface as materials see it. Directions are unit vectors.
struct SurfacePoint {
    Vec3 p;
    Vec3 ng;  ///< Geometric normal in the shape's orientation (not turned toward wo).
    Vec3 ns;  ///< Interpolated normal, on the same side as ng.
    Vec3 dpdu,
        dpdv;  ///< Tangents (not unit vectors); may be zero where there is no parametrisation.
    Vec2 uv;
    Vec3 wo;              ///< Toward the predecessor.
    Vec3 color{1, 1, 1};  ///< Vertex colour.
    float alpha = 1;      ///< Of the vertex colour.
    Vec2 second_uv = {};  ///< As in SurfaceGeometry.

    TexturePoint texture_point() const { return {uv, color, p, dpdu, dpdv, alpha, second_uv}; }
};

/// As SurfacePoint, in double, with derivatives by two parameters of the surface.
struct SurfacePointJet {
    Vec3d ng, wo;
    TextureJetPoint at;
};

/// Storage for the second and further components of mixtures during a walk. reset() keeps the memory for reuse.
class ComponentArena {
public:
    const BsdfComponent* keep(const BsdfComponent& c) {
        if (used_ == blocks_.size() * kBlock)
            blocks_.push_back(std::make_unique<BsdfComponent[]>(kBlock));
        BsdfComponent& place = blocks_[used_ / kBlock][used_ % kBlock];
        ++used_;
        return &(place = c);
    }
    /// Stores the further components of a copied BSDF, which has read them from another arena.
    void adopt(Bsdf& bsdf) { bsdf.first_.next = copy_of(bsdf.first_.next); }
    void reset() { used_ = 0; }
    size_t memory_bytes() const { return blocks_.size() * kBlock * sizeof(BsdfComponent); }

private:
    /// In the same order.
    const BsdfComponent* copy_of(const BsdfComponent* c) {
        if (!c) return nullptr;
        BsdfComponent copy = *c;
        copy.next = copy_of(c->next);
        return keep(copy);
    }

    static constexpr size_t kBlock = 4;
    std::vector<std::unique_ptr<BsdfComponent[]>> blocks_;
    size_t used_ = 0;
};

class Material {
public:
    virtual ~Material() = default;
    /// Appends this material's lobes at `point` to `list`, scaled by `weight` (which may exceed 1), in the shading frame
    /// `frame` (which a two-sided material turns toward wo).
    virtual void append(const SurfacePoint& point, const Frame& frame, float weight,
                        class ComponentList& list) const = 0;
    /// Probability that a ray meets the surface: 1 unless masked, 0 for `null`.
    virtual float opacity(const TexturePoint&) const { return 1; }
    virtual bool is_opaque() const { return true; }  ///< Whether opacity is 1 everywhere.
    /// Whether a lobe transmits light to the other side of the surface.
    virtual bool is_transmissive() const { return false; }
    virtual bool is_two_sided() const { return is_transmissive(); }
    /// False if all lobes are delta at every point, so that connections are never possible.
    virtual bool may_be_smooth() const { return true; }
    /// False if no lobe is delta at any point.
    virtual bool may_have_delta() const { return true; }
    /// The most lobes that append() adds.
    virtual int max_components() const { return 1; }
    /// Whether it shades with other normals than that of the shape.
    virtual bool perturbs_normals() const { return false; }
    /// Whether turn() does to frames what append() does.
    virtual bool has_jet() const { return !perturbs_normals(); }
    /// Turns the shading frame to the one in which append() has its lobes.
    virtual void turn(const SurfacePointJet&, FrameOf<Vec3Dual>& /*frame*/) const {}
    /// Whether append() uses SurfacePoint::dpdu and dpdv.
    virtual bool needs_tangents() const { return true; }
    /// Approximate average reflectance, for heuristics.
    virtual Rgb mean_albedo() const = 0;

    /// Whether nothing scatters where a direction is on different sides of the geometric and the shading surface. If
    /// not, the shading normal alone decides on which side a direction is.
    void set_strict_normals(bool strict) { has_strict_normals_ = strict; }

    /// Constructs the BSDF at `point` in `out`; further components of a mixture are stored in the arena.
    void make_bsdf(const SurfacePoint& point, ComponentArena& arena, Bsdf& out) const;
    Bsdf bsdf(const SurfacePoint& point, ComponentArena& arena) const {
        Bsdf out;
        make_bsdf(point, arena, out);
        return out;
    }

protected:
    /// Whether `frame`, which an outer material may have turned, points to the side from which the surface is seen.
    template <class Point, class V>
    bool sees_front(const Point& point, const FrameOf<V>& frame) const {
        if (!has_strict_normals_) return !(dot(point.wo, frame.n) < 0);
        return (dot(point.wo, point.ng) < 0) == (dot(frame.n, point.ng) < 0);
    }

private:
    bool has_strict_normals_ = true;
};

/// Collects the components of a tree of materials: the first in the Bsdf itself, the others in the arena.
class ComponentList {
public:
    /// `frame`: that of a BSDF without components.
    ComponentList(Vec3 ng, const Frame& frame, bool strict_normals, ComponentArena& arena,
                  Bsdf& out)
        : arena_(&arena), out_(&out), frame_(&frame) {
        out.ng_ = ng;
        out.has_strict_normals_ = strict_normals;
        out.has_smooth_ = out.has_delta_ = false;
        out.uses_lobe_choice_ = false;
        out.total_weight_ = 0;
        out.first_.next = nullptr;
    }
    /// Without components, the BSDF is a black one, with a lobe that has no value: nothing is left of what it was before.
    ~ComponentList() {
        if (!is_empty_) return;
        out_->first_.frame = *frame_;
        out_->first_.lobe = ConductorLobe{Rgb(1), Rgb(0), Rgb(0)};
        out_->total_weight_ = 1;
    }
    ComponentList(const ComponentList&) = delete;
    ComponentList& operator=(const ComponentList&) = delete;
    template <class L>
    void add(const Frame& frame, const L& lobe, float weight) {
        if (!(weight > 0)) return;
        out_->has_smooth_ |= lobe.has_smooth();
        out_->has_delta_ |= lobe.has_delta();
        out_->total_weight_ += weight;
        BsdfComponent& first = out_->first_;
        if (is_empty_) {
            first.frame = frame;
            first.lobe.template emplace<L>(lobe);
            first.weight = weight;
            out_->uses_lobe_choice_ = L::kUsesLobeChoice;
            is_empty_ = false;
        } else {
            out_->uses_lobe_choice_ = true;
            first.next =
                arena_->keep({.frame = frame, .lobe = lobe, .weight = weight, .next = first.next});
        }
    }

private:
    ComponentArena* arena_;
    Bsdf* out_;
    const Frame* frame_;
    bool is_empty_ = true;
};

/// Services of the scene builder for the construction of materials.
class MaterialContext {
public:
    virtual ~MaterialContext() = default;
    /// A constant or texture parameter; throws SceneError where a constant lies outside [0, hi], to which textures are
    /// clamped. The empty name is that of an unnamed child.
    virtual TextureRef texture(const Params& params, std::string_view name, Rgb fallback,
                               float hi = kInf) = 0;
    /// The nested materials in file order.
    virtual std::vector<const Material*> nested(const Params& params) = 0;
};

struct MaterialEntry {
    PluginInfo info;
    std::unique_ptr<Material> (*make)(const Params& params, MaterialContext& context);
};
/// The `make` of a material class with a constructor from the same arguments.
template <class M>
std::unique_ptr<Material> make_material(const Params& params, MaterialContext& context) {
    return std::make_unique<M>(params, context);
}
/// All BSDF plug-ins, in the order of `etendue list`.
const std::vector<MaterialEntry>& material_registry();

}  // namespace etendue
