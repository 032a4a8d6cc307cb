#pragma once
// Emitters: the first vertex of every path. Densities are those of a given emitter; the scene multiplies them by the
// probability of choosing it. y_0 of a finite emitter is a point with an area density. y_0 of an emitter at infinity is
// a direction with a solid-angle density, and its light starts on a disc outside the scene [Veach 1997, §8.2].

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "color/rgb.h"
#include "description/params.h"
#include "geometry/shape.h"
#include "math/vec.h"
#include "texture/texture.h"

namespace etendue {

/// The start of a light sub-path: y_0 and the direction to y_1.
struct EmissionSample {
    Vec3 p;   ///< Finite: y_0. Infinite: a point on the bounding disc, outside the scene.
    Vec3 ng;  ///< Normal at y_0; d for emitters without a surface.
    Vec3 d;   ///< Direction in which light leaves, unit length.
    Rgb Le;   ///< Radiance along d (intensity of point emitters, irradiance of directional ones).
    /// Density of y_0: area measure; 1 for a point; for infinite emitters solid angle of d (1 for a delta direction).
    float pdf_y0;
    /// Density of d at y_0: solid angle; for infinite emitters density of p on the bounding disc.
    float pdf_d;
    Vec2 uv;  ///< Parameters of y_0 within its primitive, as in RayHit.
    uint32_t prim = 0;
};

/// y_0 sampled by next event estimation from a given point of the scene.
struct DirectSample {
    Vec3 p;  ///< y_0; for infinite emitters the direction wi.
    Vec3 ng;
    Vec3 wi;       ///< From the scene point toward y_0, unit length.
    float dist;    ///< kInf for infinite emitters.
    Rgb Le;        ///< As EmissionSample::Le, toward the scene point.
    float pdf;     ///< p_NE(y_0), in the measure of EmissionSample::pdf_y0.
    float pdf_y0;  ///< p_L(y_0): density of y_0 for sample_emission().
    float pdf_d;   ///< Density of the direction to the scene point for sample_emission().
    Vec2 uv;       ///< As EmissionSample.
    uint32_t prim = 0;
    float slack = 0;  ///< As Emitter::slack().
};

/// Radiance and densities where an eye path hits the emitter.
struct EmitterHit {
    Rgb Le;
    float
        pdf;  ///< As DirectSample::pdf, of emitters at infinity; of others see Emitter::direct_pdf().
    float pdf_y0;
    float pdf_d;
};

class Emitter {
public:
    /// What its points are; `Direction` is a single one at infinity.
    enum class Extent : uint8_t { Surface, Point, Infinite, Direction };

    explicit Emitter(Extent extent) : extent_(extent) {}
    virtual ~Emitter() = default;

    /// `u_y0` also chooses among primitives or texels, hence its precision.
    virtual EmissionSample sample_emission(FinePoint u_y0, Vec2 u_d) const = 0;
    /// False where the sampled point sends no light to `from`.
    virtual bool sample_direct(Vec3 from, FinePoint u, DirectSample& out) const = 0;
    /// Finite emitters with a surface: DirectSample::pdf at `p` of primitive `prim`, with the normal `ng`.
    virtual float direct_pdf(Vec3 /*p*/, Vec3 /*ng*/, uint32_t /*prim*/, Vec3 /*from*/) const {
        return 0;
    }
    /// Whether sample_direct() reads tables that the processor's caches do not hold.
    virtual bool has_large_tables() const { return false; }
    /// Asks for the memory that sample_direct() reads there for `u` at any point, in two parts: of the search in the tables;
    /// and once this has come, of its result, with what the first part returned.
    virtual int prefetch_search(FinePoint /*u*/) const { return 0; }
    virtual void prefetch_result(FinePoint /*u*/, int /*searched*/) const {}
    /// Emitted power in W, weighted by luminance; emitters are chosen proportionally to it.
    virtual double power() const = 0;

    // Points of a surface are given by their primitive and the parameters (u, v) within it, as in RayHit.

    /// Finite emitters: radiance from a surface point along the unit vector `w`, and densities; zero from behind. The
    /// radiance is what a ray sees that meets the surface there. All other functions include the factor opacity(),
    /// which is the probability that a ray meets it.
    virtual EmitterHit eval_surface(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const;
    /// Infinite emitters: radiance arriving from direction `d`, and densities.
    virtual EmitterHit eval_infinite(Vec3 d) const;
    /// Value and density of emission along `w` from a point sampled on this emitter: {Le·|cos θ|, pdf_d}.
    struct Emission {
        Rgb Le_cos;
        float pdf_d;
    };
    virtual Emission eval_emission(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const = 0;
    /// Finite emitters: a direction of emission from a point with normal `ng`, with density eval_emission().pdf_d.
    virtual Vec3 sample_direction(Vec3 ng, Vec2 u) const = 0;

    /// Of a masked surface that emits.
    virtual float opacity(Vec2 /*uv*/, uint32_t /*prim*/) const { return 1; }

    /// Infinite emitters: emission of light that arrives from direction `d`, however that was chosen; `pdf_y0` is that
    /// of sample_emission().
    virtual EmissionSample sample_emission_from(Vec3 /*d*/, Vec2 /*u_d*/) const { return {}; }
    /// Finite emitters: upper bound of pdf_d at any point; kInf where none is known.
    virtual float max_pdf_d() const { return kInf; }
    /// Whether pdf_d is cos θ/π about the normal, and zero behind.
    virtual bool emits_by_cosine() const { return false; }
    /// The disc on which light from infinity starts: for light that travels along -d it is normal to d and centred at
    /// center + d·radius.
    struct Disc {
        Vec3 center;
        float radius;
    };
    virtual Disc disc() const { return {}; }

    bool is_infinite() const { return extent_ == Extent::Infinite || extent_ == Extent::Direction; }
    /// Whether it has no extent, so that no eye path hits it.
    bool is_delta() const { return extent_ == Extent::Point || extent_ == Extent::Direction; }
    /// Whether it has a surface, so that |cos θ| at y_0 is part of G.
    bool is_area() const { return extent_ == Extent::Surface; }
    /// SurfaceGeometry::slack of the points of its surface.
    virtual float slack(uint32_t /*prim*/) const { return 0; }
    virtual void set_scene_bounds(Vec3 /*center*/, float /*radius*/) {}

    /// Probability that the scene chooses this emitter, for emission and for next event estimation.
    float selection_pmf = 0;
    uint32_t index = 0;  ///< Among the emitters of the scene.
    /// MediumId of the medium in which its light starts, see Scene::medium_at().
    int16_t medium = -1;
    int16_t medium_behind = -1;  ///< The same where it starts at the back of a boundary.

private:
    Extent extent_;
};

/// Services of the scene builder for the construction of emitters.
class EmitterContext {
public:
    virtual ~EmitterContext() = default;
    virtual TextureRef texture(const Params& params, std::string_view name, Rgb fallback,
                               float hi = kInf) = 0;
    /// The shape of an area emitter; nullptr for emitters that are not nested in a shape.
    virtual const Shape* shape() const = 0;
    /// Opacity of that shape; empty where it is opaque.
    virtual std::function<float(const TexturePoint& at)> opacity() const = 0;
};

struct EmitterEntry {
    PluginInfo info;
    /// May return several emitters: `sunsky` is a sky and a sun.
    std::vector<std::unique_ptr<Emitter>> (*make)(const Params& params, EmitterContext& context);
};
const std::vector<EmitterEntry>& emitter_registry();
inline std::vector<std::unique_ptr<Emitter>> one_emitter(std::unique_ptr<Emitter> emitter) {
    std::vector<std::unique_ptr<Emitter>> made;
    made.push_back(std::move(emitter));
    return made;
}

}  // namespace etendue
