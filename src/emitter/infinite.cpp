#include "emitter/infinite.h"

#include "math/frame.h"

#include "math/warp.h"
#include <numbers>

namespace etendue {

EmissionSample InfiniteEmitter::sample_emission(FinePoint u_y0, Vec2 u_d) const {
    return emission(sample_arrival(u_y0), u_d);
}

EmissionSample InfiniteEmitter::sample_emission_from(Vec3 d, Vec2 u_d) const {
    const Arrival a = arrival(d);
    return emission({d, a.L, a.pdf}, u_d);
}

EmissionSample InfiniteEmitter::emission(const Sample& s, Vec2 u_d) const {
    const Vec2 disk = sample_uniform_disk(u_d);
    const Frame frame = Frame::from_normal(s.d);
    const Vec3 p = center_ + (frame.s * disk.x + frame.t * disk.y + s.d) * radius_;
    return {p, -s.d, -s.d, s.L, s.pdf, pdf_disk_, {}, 0};
}

bool InfiniteEmitter::sample_direct(Vec3, FinePoint u, DirectSample& out) const {
    const Sample s = sample_arrival(u);
    if (s.L.is_zero() || !(s.pdf > 0)) return false;
    out = {s.d, -s.d, s.d, kInf, s.L, s.pdf, s.pdf, pdf_disk_, {}, 0};
    return true;
}

EmitterHit InfiniteEmitter::eval_infinite(Vec3 d) const {
    if (is_delta()) return {};
    const Arrival a = arrival(d);
    return {a.L, a.pdf, a.pdf, pdf_disk_};
}

Emitter::Emission InfiniteEmitter::eval_emission(Vec3, Vec2, uint32_t, Vec3 w) const {
    return {radiance(-w), pdf_disk_};
}

void InfiniteEmitter::set_scene_bounds(Vec3 center, float radius) {
    center_ = center;
    radius_ = radius;
    pdf_disk_ = 1 / (kPi * radius * radius);
}

namespace {

class ConstantEmitter final : public InfiniteEmitter {
public:
    explicit ConstantEmitter(Rgb L) : L_(L) {}
    double power() const override {
        return 4 * std::numbers::pi * std::numbers::pi * sqr(double(scene_radius())) *
               luminance(L_);
    }

private:
    Sample sample_arrival(FinePoint u) const override {
        return {sample_uniform_sphere(to_float(u)), L_, kUniformSpherePdf};
    }
    Rgb radiance(Vec3) const override { return L_; }
    float pdf_direction(Vec3) const override { return kUniformSpherePdf; }

    Rgb L_;
};

class DirectionalEmitter final : public InfiniteEmitter {
public:
    DirectionalEmitter(Vec3 travel, Rgb irradiance)
        : InfiniteEmitter(Extent::Direction), d_(-travel), E_(irradiance) {}
    double power() const override {
        return std::numbers::pi * sqr(double(scene_radius())) * luminance(E_);
    }

private:
    Sample sample_arrival(FinePoint) const override { return {d_, E_, 1}; }
    Rgb radiance(Vec3) const override { return E_; }
    float pdf_direction(Vec3) const override { return 0; }

    Vec3 d_;
    Rgb E_;
};

}  // namespace

EmitterEntry constant_entry() {
    return {{"emitter",
             "constant",
             "Environment with the same radiance from every direction.",
             {{"radiance", ParamKind::Rgb, "1", "Radiance in W/(m² sr)."}}},
            [](const Params& p, EmitterContext&) {
                return one_emitter(std::make_unique<ConstantEmitter>(p.rgb("radiance", Rgb(1))));
            }};
}

EmitterEntry directional_entry() {
    return {
        {"emitter",
         "directional",
         "Parallel light from infinity.",
         {{"irradiance", ParamKind::Rgb, "1", "Irradiance on a plane normal to the light, W/m²."},
          {"direction", ParamKind::Vector, "0, 0, 1",
           "Direction in which the light travels, instead of to_world."},
          {"to_world", ParamKind::Transform, "identity", "The light travels along its +z."}}},
        [](const Params& p, EmitterContext&) {
            if (p.has("direction") && p.has("to_world"))
                p.fail("to_world", "give either \"direction\" or \"to_world\", not both");
            const Vec3 d = p.has("direction") ? p.vector("direction", {})
                                              : p.transform("to_world").vector({0, 0, 1});
            if (!(length2(d) > 0)) p.fail("direction", "parameter \"direction\" must not be zero");
            return one_emitter(
                std::make_unique<DirectionalEmitter>(normalize(d), p.rgb("irradiance", Rgb(1))));
        }};
}

}  // namespace etendue
