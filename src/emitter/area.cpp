// Area emitter: radiance L_e from the front of a shape, or from both sides, the same in all directions. Sampling
// chooses a primitive with probability proportional to area times mean radiance, a point uniform in area, and a
// direction with density cos θ / π, or |cos θ| / 2π. Next events take a point that Shape::sample_seen() chooses for the
// observer. Where the shape is masked, a ray meets it, and sees L_e, with a probability equal to the opacity, so that the
// light it emits has this factor.

#include "emitter/area.h"

#include <numbers>

#include "math/distribution.h"
#include "math/frame.h"
#include "math/warp.h"

namespace etendue {
namespace {

class AreaEmitter final : public Emitter {
public:
    AreaEmitter(const Shape& shape, TextureRef radiance, bool two_sided,
                std::function<float(const TexturePoint& at)> opacity)
        : Emitter(Extent::Surface), shape_(shape), radiance_(radiance), two_sided_(two_sided),
          opacity_(std::move(opacity)), leaves_out_hidden_(!two_sided || !opacity_) {
        const size_t n = shape.primitive_count();
        std::vector<double> weights(n), areas(n);
        double flux = 0, floor = 0;
        constexpr double kFloor = 0.05;
        // Many points of few primitives, which have larger parts of the texture.
        const int grid = std::clamp(int(std::sqrt(4096.0 / double(n))), 4, 32);
        const double mean = luminance(radiance.mean());
        for (uint32_t i = 0; i < n; ++i) {
            areas[i] = shape.primitive_area(i);
            double L = mean;
            if (!radiance.is_constant() || opacity_) {
                // Mean over points of the primitive. A share of the overall mean is added below, so that a
                // primitive that is dark at all these points can still be chosen.
                double sum = 0;
                for (int k = 0; k < grid * grid; ++k) {
                    const Vec2 uv = shape
                                        .sample(i, {(float(k % grid) + 0.5f) / float(grid),
                                                    (float(k / grid) + 0.5f) / float(grid)})
                                        .uv;
                    sum += double(luminance(emitted(uv, i)));
                }
                L = sum / (grid * grid);
                flux += areas[i] * L;
                L += kFloor * mean;
            } else {
                flux += areas[i] * L;
            }
            weights[i] = areas[i] * L;
            floor += areas[i] * kFloor * mean;
        }
        // So that the emitter itself can be chosen, even if all of its points were dark.
        flux = std::max(flux, floor);
        power_ = std::numbers::pi * flux * (two_sided ? 2 : 1);
        choice_ = AliasTable(weights);
        pdf_.resize(n);
        for (size_t i = 0; i < n && !choice_.empty(); ++i)
            pdf_[i] = areas[i] > 0 ? float(choice_.pmf(uint32_t(i)) / areas[i]) : 0.0f;
    }

    EmissionSample sample_emission(FinePoint u_y0, Vec2 u_d) const override {
        const ShapeSample s = sample_point(u_y0);
        const Vec3 d = sample_direction(s.ng, u_d);
        return {s.p,
                s.ng,
                d,
                emitted(s.uv, s.prim),
                pdf_[s.prim],
                pdf_direction(emitted_cos(s.ng, d)),
                s.uv,
                s.prim};
    }
    Vec3 sample_direction(Vec3 ng, Vec2 u) const override {
        if (!two_sided_) return Frame::from_normal(ng).to_world(sample_cosine_hemisphere(u));
        const bool front = u.x < 0.5f;
        u.x = std::min(front ? 2 * u.x : 2 * u.x - 1, kOneMinusEpsilon);
        return Frame::from_normal(front ? ng : -ng).to_world(sample_cosine_hemisphere(u));
    }

    bool sample_direct(Vec3 from, FinePoint u, DirectSample& out) const override {
        const auto choice = choice_.sample(u.x);
        const Vec2 u_point{to_float(choice.u), to_float(u.y)};
        const ShapeSample s = leaves_out_hidden_ ? shape_.sample_seen(choice.index, from, u_point)
                                                 : shape_.sample(choice.index, u_point);
        const Vec3 v = s.p - from;
        const float dist2 = length2(v);
        if (!(dist2 > 0)) return false;
        const float dist = std::sqrt(dist2);
        const Vec3 wi = v * (1 / dist);
        const float cos = emitted_cos(s.ng, -wi);
        if (!(cos > 0)) return false;
        const float pdf = pdf_[s.prim] * s.density;
        if (!(pdf > 0)) return false;
        out = {s.p,
               s.ng,
               wi,
               dist,
               emitted(s.uv, s.prim),
               pdf,
               pdf_[s.prim],
               pdf_direction(cos),
               s.uv,
               s.prim,
               s.slack};
        return true;
    }
    float direct_pdf(Vec3 p, Vec3 ng, uint32_t prim, Vec3 from) const override {
        return leaves_out_hidden_ ? pdf_[prim] * shape_.seen_density(prim, p, ng, from)
                                  : pdf_[prim];
    }

    EmitterHit eval_surface(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const override {
        const float cos = emitted_cos(ng, w);
        if (!(cos > 0)) return {};
        return {radiance_at(uv, prim), 0, pdf_[prim], pdf_direction(cos)};
    }

    Emission eval_emission(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const override {
        const float cos = emitted_cos(ng, w);
        if (!(cos > 0)) return {Rgb(), 0};
        return {emitted(uv, prim) * cos, pdf_direction(cos)};
    }

    void set_power(double power) {
        if (!(power_ > 0)) return;
        factor_ = float(power / power_);
        power_ = power;
    }
    double power() const override { return power_; }
    float opacity(Vec2 uv, uint32_t prim) const override {
        return opacity_ ? opacity_(texture_point(uv, prim)) : 1.0f;
    }
    float slack(uint32_t prim) const override { return shape_.slack(prim); }
    float max_pdf_d() const override { return pdf_direction(1); }
    bool emits_by_cosine() const override { return !two_sided_; }

private:
    /// cos θ of light that leaves along `w`; at most zero where none does.
    float emitted_cos(Vec3 ng, Vec3 w) const {
        const float cos = dot(ng, w);
        return two_sided_ ? std::fabs(cos) : cos;
    }
    float pdf_direction(float cos) const { return cos * kInvPi * (two_sided_ ? 0.5f : 1.0f); }
    TexturePoint texture_point(Vec2 uv, uint32_t prim) const {
        const SurfaceGeometry g = shape_.surface(prim, uv.x, uv.y, false);
        return {g.uv, g.color, g.p, {}, {}, g.alpha, g.second_uv};
    }
    Rgb radiance_at(Vec2 uv, uint32_t prim) const {
        if (radiance_.is_constant()) return radiance_.mean() * factor_;
        return radiance_.eval(texture_point(uv, prim)) * factor_;
    }
    Rgb emitted(Vec2 uv, uint32_t prim) const {
        return opacity_ ? radiance_at(uv, prim) * opacity(uv, prim) : radiance_at(uv, prim);
    }
    ShapeSample sample_point(FinePoint u) const {
        const auto choice = choice_.sample(u.x);
        return shape_.sample(choice.index, {to_float(choice.u), to_float(u.y)});
    }

    const Shape& shape_;
    TextureRef radiance_;
    bool two_sided_;
    std::function<float(const TexturePoint& at)> opacity_;  ///< Empty where the shape is opaque.
    /// Whether no light leaves points that are hidden behind the rest of the shape.
    bool leaves_out_hidden_;
    float factor_ = 1;  ///< Of the radiance.
    AliasTable choice_;
    std::vector<float> pdf_;  ///< Area density of points, by primitive.
    double power_;
};

}  // namespace

std::unique_ptr<Emitter> make_area_emitter(const Shape& shape, TextureRef radiance, bool two_sided,
                                           double power,
                                           std::function<float(const TexturePoint& at)> opacity) {
    auto emitter = std::make_unique<AreaEmitter>(shape, radiance, two_sided, std::move(opacity));
    if (power > 0) emitter->set_power(power);
    return emitter;
}

EmitterEntry area_entry() {
    return {{"emitter",
             "area",
             "Emission from the front of a shape, or from both sides.",
             {{"radiance", ParamKind::Texture, "1", "Radiance in W/(m² sr)."},
              {"power", ParamKind::Float, "that of the radiance",
               "Emitted power in W, weighted by luminance, to which the radiance is scaled."},
              {"two_sided", ParamKind::Bool, "false", "Whether the back emits, too."}}},
            [](const Params& p, EmitterContext& c) {
                if (!c.shape()) p.fail("emitter \"area\" must be nested in a shape");
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_area_emitter(*c.shape(), c.texture(p, "radiance", Rgb(1)),
                                                 p.flag("two_sided", false),
                                                 p.number("power", 0, 0), c.opacity()));
                return made;
            }};
}

}  // namespace etendue
