#pragma once
// Emitters: the near end of every path. Densities here are for a given emitter; the scene multiplies by the probability
// of choosing it. Finite emitters have points with area densities; emitters at infinity have directions with
// solid-angle densities, and their light starts on the scene's bounding disc [Veach 1997, §8.2; path-space notes].

#include <cstdint>
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
    Vec3 ng;  ///< Normal at y_0; for emitters without a surface the direction d.
    Vec3 d;   ///< Direction in which light leaves, unit length.
    Rgb Le;  ///< Radiance (intensity of point-like emitters, irradiance of directional ones) along d.
    /// Density of y_0: area measure; 1 for a point; for infinite emitters solid angle of d (1 for a delta direction).
    float pdf_y0;
    /// Density of d at y_0: solid angle; for infinite emitters density of p on the bounding disc.
    float pdf_d;
    Vec2 uv;  ///< Of y_0 on a textured emitter.
    uint32_t prim = 0;
};

/// y_0 as next event estimation chooses it for a given point of the scene.
struct DirectSample {
    Vec3 p;  ///< y_0; for infinite emitters the point's direction wi.
    Vec3 ng;
    Vec3 wi;       ///< From the scene point toward y_0, unit length.
    float dist;    ///< kInf for infinite emitters.
    Rgb Le;        ///< Toward the scene point.
    float pdf;     ///< p_NE: of y_0 in the measure of EmissionSample::pdf_y0.
    float pdf_y0;  ///< p_L(y_0): density with which emission sampling would make it.
    float
        pdf_d;  ///< Density with which it would leave toward the scene point, as EmissionSample::pdf_d.
    Vec2 uv;
    uint32_t prim = 0;
};

/// What an eye path that arrives at the emitter finds.
struct EmitterHit {
    Rgb Le;
    float pdf;  ///< As DirectSample::pdf, for the point the eye path came from.
    float pdf_y0;
    float pdf_d;
};

class Emitter {
public:
    virtual ~Emitter() = default;

    /// `u_y0` chooses among primitives or texels first, so that it has the bits to do so.
    virtual EmissionSample sample_emission(FinePoint u_y0, Vec2 u_d) const = 0;
    /// False where the emitter sends nothing to `from`.
    virtual bool sample_direct(Vec3 from, FinePoint u, DirectSample& out) const = 0;
    /// Emitted power in W (luminance), the measure by which emitters are chosen.
    virtual double power() const = 0;

    /// Finite emitters: radiance from a surface point along `w` (unit), and the densities. Zero where unreachable.
    virtual EmitterHit eval_surface(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const;
    /// Infinite emitters: radiance that arrives from direction `d`.
    virtual EmitterHit eval_infinite(Vec3 d) const;
    /// Value and density of light leaving a point sampled on this emitter along `w`: {Le·|cos θ|, pdf_d}.
    struct Emission {
        Rgb Le_cos;
        float pdf_d;
    };
    virtual Emission eval_emission(Vec3 ng, Vec2 uv, Vec3 w) const = 0;
    /// Finite emitters: a direction, of density eval_emission().pdf_d, from a point with the normal `ng`.
    virtual Vec3 sample_direction(Vec3 ng, Vec2 u) const = 0;

    /// Bound of the density of directions from a point of a finite emitter; kInf where none is known.
    virtual float max_pdf_d() const { return kInf; }
    /// The disc from which an emitter at infinity lights the scene; for light that travels along -d it lies around
    /// center + d·radius, normal to d.
    struct Disc {
        Vec3 center;
        float radius;
    };
    virtual Disc disc() const { return {}; }

    virtual bool is_infinite() const { return false; }
    /// True where an eye path can never hit it.
    virtual bool is_delta() const { return false; }
    /// True for emitters with a surface (|cos θ| at y_0 belongs to G).
    virtual bool is_area() const { return false; }
    virtual void set_scene_bounds(Vec3 /*center*/, float /*radius*/) {}

    /// Probability that the scene chooses this emitter, for emission and for next event estimation.
    float selection_pmf = 0;
    /// Where its light starts, as the scene counts media; none where it is negative.
    int16_t medium = -1;
};

/// What the makers need besides parameters.
class EmitterContext {
public:
    virtual ~EmitterContext() = default;
    virtual TextureRef texture(const Params& params, std::string_view name, Rgb fallback,
                               float hi = kInf) = 0;
    /// The shape an area emitter sits on; nullptr for others.
    virtual const Shape* shape() const = 0;
};

struct EmitterEntry {
    PluginInfo info;
    /// May make several: `sunsky` is a sky and a sun.
    std::vector<std::unique_ptr<Emitter>> (*make)(const Params& params, EmitterContext& context);
};
const std::vector<EmitterEntry>& emitter_registry();

}  // namespace etendue
