// Area emitter: radiance L_e(uv) from the front of a shape, the same in all directions. Sampling chooses a primitive
// with probability proportional to area times mean radiance, a point uniform in area, and a direction with density cos
// θ / π.

#include "emitter/area.h"

#include "math/distribution.h"
#include "math/frame.h"
#include "math/warp.h"

namespace etendue {
namespace {

class AreaEmitter final : public Emitter {
public:
    AreaEmitter(const Shape& shape, TextureRef radiance) : shape_(shape), radiance_(radiance) {
        const size_t n = shape.primitive_count();
        std::vector<double> weights(n), areas(n);
        double flux = 0;
        const double mean = luminance(radiance.mean());
        for (uint32_t i = 0; i < n; ++i) {
            areas[i] = shape.primitive_area(i);
            double L = mean;
            if (!radiance.is_constant()) {
                // Mean over a few points of the primitive. A share of the overall mean is added below, so that a
                // primitive that is dark at all these points can still be chosen.
                constexpr int kGrid = 4;
                double sum = 0;
                for (int k = 0; k < kGrid * kGrid; ++k)
                    sum +=
                        luminance(radiance.eval(shape
                                                    .sample(i, {(float(k % kGrid) + 0.5f) / kGrid,
                                                                (float(k / kGrid) + 0.5f) / kGrid})
                                                    .uv));
                L = sum / (kGrid * kGrid);
                flux += areas[i] * L;
                L += 0.05 * mean;
            } else {
                flux += areas[i] * L;
            }
            weights[i] = areas[i] * L;
        }
        power_ = double(kPi) * flux;
        choice_ = AliasTable(weights);
        pdf_.resize(n);
        for (size_t i = 0; i < n && !choice_.empty(); ++i)
            pdf_[i] = areas[i] > 0 ? float(choice_.pmf(uint32_t(i)) / areas[i]) : 0.0f;
    }

    EmissionSample sample_emission(FinePoint u_y0, Vec2 u_d) const override {
        const ShapeSample s = sample_point(u_y0);
        const Vec3 local = sample_cosine_hemisphere(u_d);
        const Vec3 d = Frame::from_normal(s.ng).to_world(local);
        return {s.p,  s.ng,  d, radiance_.eval(s.uv), pdf_[s.prim], pdf_cosine_hemisphere(local.z),
                s.uv, s.prim};
    }
    Vec3 sample_direction(Vec3 ng, Vec2 u) const override {
        return Frame::from_normal(ng).to_world(sample_cosine_hemisphere(u));
    }

    bool sample_direct(Vec3 from, FinePoint u, DirectSample& out) const override {
        const ShapeSample s = sample_point(u);
        const Vec3 v = s.p - from;
        const float dist2 = length2(v);
        if (!(dist2 > 0)) return false;
        const float dist = std::sqrt(dist2);
        const Vec3 wi = v * (1 / dist);
        const float cos = -dot(s.ng, wi);
        if (!(cos > 0)) return false;
        const float pdf = pdf_[s.prim];
        out = {s.p, s.ng, wi, dist, radiance_.eval(s.uv), pdf, pdf, cos * kInvPi, s.uv, s.prim};
        return true;
    }

    EmitterHit eval_surface(Vec3 ng, Vec2 uv, uint32_t prim, Vec3 w) const override {
        const float cos = dot(ng, w);
        if (!(cos > 0)) return {};
        return {radiance_.eval(uv), pdf_[prim], pdf_[prim], cos * kInvPi};
    }

    Emission eval_emission(Vec3 ng, Vec2 uv, Vec3 w) const override {
        const float cos = dot(ng, w);
        if (!(cos > 0)) return {Rgb(), 0};
        return {radiance_.eval(uv) * cos, cos * kInvPi};
    }

    double power() const override { return power_; }
    bool is_area() const override { return true; }
    float max_pdf_d() const override { return kInvPi; }

private:
    ShapeSample sample_point(FinePoint u) const {
        const auto choice = choice_.sample(u.x);
        return shape_.sample(choice.index, {to_float(choice.u), to_float(u.y)});
    }

    const Shape& shape_;
    TextureRef radiance_;
    AliasTable choice_;
    std::vector<float> pdf_;  ///< Area density of points, by primitive.
    double power_;
};

}  // namespace

std::unique_ptr<Emitter> make_area_emitter(const Shape& shape, TextureRef radiance) {
    return std::make_unique<AreaEmitter>(shape, radiance);
}

EmitterEntry area_entry() {
    return {{"emitter",
             "area",
             "Emission from the front of a shape.",
             {{"radiance", ParamKind::Texture, "1", "Radiance in W/(m² sr)."}}},
            [](const Params& p, EmitterContext& c) {
                if (!c.shape()) p.fail("emitter \"area\" must be nested in a shape");
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_area_emitter(*c.shape(), c.texture(p, "radiance", Rgb(1))));
                return made;
            }};
}

}  // namespace etendue
