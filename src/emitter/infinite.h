#pragma once
// Emitters at infinity: their common base class and their entries.

#include "emitter/emitter.h"

namespace etendue {

/// An emitter whose points are directions. Light that arrives from direction `d` travels along -d.
class InfiniteEmitter : public Emitter {
public:
    explicit InfiniteEmitter(Extent extent = Extent::Infinite) : Emitter(extent) {}

    EmissionSample sample_emission(FinePoint u_y0, Vec2 u_d) const final;
    EmissionSample sample_emission_from(Vec3 d, Vec2 u_d) const final;
    bool sample_direct(Vec3 from, FinePoint u, DirectSample& out) const final;
    EmitterHit eval_infinite(Vec3 d) const final;
    Emission eval_emission(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const final;
    /// Always the direction of y_0; only the point on the bounding disc varies.
    Vec3 sample_direction(Vec3 ng, Vec2) const final { return ng; }
    Disc disc() const final { return {center_, radius_}; }
    void set_scene_bounds(Vec3 center, float radius) final;

protected:
    /// Direction d from which light arrives, its radiance (irradiance if delta) and solid-angle density.
    struct Sample {
        Vec3 d;
        Rgb L;
        float pdf;
    };
    struct Arrival {
        Rgb L;
        float pdf;
    };
    EmissionSample emission(const Sample& from, Vec2 u_d) const;
    virtual Sample sample_arrival(FinePoint u) const = 0;
    virtual Rgb radiance(Vec3 d) const = 0;
    virtual float pdf_direction(Vec3 d) const = 0;
    float scene_radius() const { return radius_; }
    /// radiance() and pdf_direction() together.
    virtual Arrival arrival(Vec3 d) const { return {radiance(d), pdf_direction(d)}; }
    /// Density on the bounding disc, 1/(πR²).
    float pdf_disk() const { return pdf_disk_; }

private:
    Vec3 center_;
    float radius_ = 1, pdf_disk_ = kInvPi;
};

EmitterEntry constant_entry();
EmitterEntry envmap_entry();
EmitterEntry directional_entry();
EmitterEntry sky_entry();
EmitterEntry sun_entry();
EmitterEntry sunsky_entry();

}  // namespace etendue
