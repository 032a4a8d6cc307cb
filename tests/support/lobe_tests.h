#pragma once
// Checks that hold for every scattering lobe (bsdf/lobe.h), generic over its type. Each draws from
// a fixed seed; the statistical ones take the significance level of one test, which the caller
// corrects for their number (sidak()).

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "bsdf/lobe.h"
#include "chi2.h"
#include "math/warp.h"

namespace etendue::testing {

/// Random numbers as integrators pass them to lobes: multiples of 2^-24 in [0, 1).
class LobeRandom {
public:
    explicit LobeRandom(uint64_t seed) : engine_(seed) {}
    float next() { return float(engine_() >> 40) * 0x1p-24f; }
    Vec2 next_2d() {
        const float x = next();
        return {x, next()};
    }

private:
    std::mt19937_64 engine_;
};

/// The number for the choice of a lobe as walks pass it: 0 to a lobe that declares that it reads none. A `Bsdf` itself
/// does not read numbers that walks do not pass.
template <class L>
float lobe_choice(const L&, float u) {
    if constexpr (requires { L::kUsesLobeChoice; })
        return L::kUsesLobeChoice ? u : 0;
    else
        return u;
}

inline Vec3 direction(double theta_degrees, double phi_degrees) {
    const double t = theta_degrees * M_PI / 180, p = phi_degrees * M_PI / 180;
    return normalize(
        {float(std::sin(t) * std::cos(p)), float(std::sin(t) * std::sin(p)), float(std::cos(t))});
}

/// Normal, 45°, oblique and grazing incidence from above.
inline std::vector<Vec3> test_directions() {
    return {direction(0, 0), direction(45, 0), direction(60, 130), direction(85, -70)};
}
/// The same from both sides.
inline std::vector<Vec3> test_directions_both_sides() {
    std::vector<Vec3> all = test_directions();
    for (Vec3 w : test_directions()) all.push_back({w.x, w.y, -w.z});
    return all;
}

inline std::string describe(Vec3 w) {
    return "(" + std::to_string(w.x) + ", " + std::to_string(w.y) + ", " + std::to_string(w.z) +
           ")";
}

/// Polar coordinates (t, φ) about an axis with θ = π t^p: p > 1 concentrates the cells around the axis of a sharp lobe.
struct PolarMap {
    Frame frame;
    double power = 1;

    double t(Vec3 w) const {
        // From the chord, since acos is inaccurate near the axis.
        return std::pow(2 * std::asin(std::min(1.0, 0.5 * double(length(w - frame.n)))) / M_PI,
                        1 / power);
    }
    double phi(Vec3 w) const {
        return std::atan2(double(dot(w, frame.t)), double(dot(w, frame.s)));
    }
    /// Direction at (t, φ) and dω / (dt dφ).
    Vec3 direction(double t, double phi, double& jacobian) const {
        const double theta = M_PI * std::pow(t, power), s = std::sin(theta);
        jacobian = s * M_PI * power * std::pow(t, power - 1);
        return normalize(frame.to_world(
            {float(s * std::cos(phi)), float(s * std::sin(phi)), float(std::cos(theta))}));
    }
};

/// Coordinates fitted to the samples of the lobe for `wo` in one hemisphere, from a pilot run.
template <class L>
PolarMap fit_polar_map(const L& lobe, Vec3 wo, bool upper) {
    LobeRandom random(1);
    std::vector<Vec3> draws;
    Vec3 peak{0, 0, upper ? 1.0f : -1.0f};
    float peak_pdf = 0;
    for (int i = 0; i < 500; ++i) {
        const float u_lobe = random.next();
        const auto s = lobe.sample(wo, lobe_choice(lobe, u_lobe), random.next_2d());
        if (!s || s->is_delta || (s->wi.z > 0) != upper) continue;
        draws.push_back(s->wi);
        if (s->pdf > peak_pdf) {
            peak_pdf = s->pdf;
            peak = s->wi;
        }
    }
    PolarMap map{Frame::from_normal(peak), 1};
    std::vector<double> distance;
    for (Vec3 w : draws) distance.push_back(map.t(w));
    if (distance.size() < 8) return {Frame::from_normal({0, 0, upper ? 1.0f : -1.0f}), 1};
    std::nth_element(distance.begin(), distance.begin() + long(distance.size() / 2),
                     distance.end());
    const double median = distance[distance.size() / 2];
    // A wide lobe fits (θ, φ) of the surface, where the horizon is a line of the grid.
    if (median > 0.1) return {Frame::from_normal({0, 0, upper ? 1.0f : -1.0f}), 1};
    map.power = std::log(std::max(median, 1e-7)) / std::log(0.4);
    return map;
}

/// χ² of sample() against the density of eval(), in each hemisphere; delta events and failures
/// count as outside. That ∫pdf is the probability of a smooth sample, and so at most one, is part
/// of the test.
template <class L>
void expect_samples_match_pdf(const L& lobe, Vec3 wo, double significance, int samples = 60000) {
    for (const bool upper : {true, false}) {
        const PolarMap map = fit_polar_map(lobe, wo, upper);
        Chi2Grid grid(0, 1, 20, -M_PI, M_PI, 16);
        LobeRandom random(2);
        for (int i = 0; i < samples; ++i) {
            const float u_lobe = random.next();
            const auto s = lobe.sample(wo, lobe_choice(lobe, u_lobe), random.next_2d());
            if (s && !s->is_delta && (s->wi.z > 0) == upper)
                grid.add(map.t(s->wi), map.phi(s->wi));
            else
                grid.add_outside();
        }
        const auto density = [&](double t, double phi) {
            double jacobian;
            const Vec3 wi = map.direction(t, phi, jacobian);
            return (wi.z > 0) == upper ? double(lobe.eval(wo, wi).pdf) * jacobian : 0.0;
        };
        const Chi2Result r = grid.test(density, 1);
        EXPECT_LE(r.total_probability, 1.001) << "wo " << describe(wo);
        EXPECT_GE(r.p_value, significance)
            << "wo " << describe(wo) << (upper ? " up" : " down") << ": chi2 " << r.statistic
            << " with " << r.degrees << " degrees of freedom, integral of pdf "
            << r.total_probability;
    }
}

/// `a` and `b` agree to `relative`, with a floor of `absolute`.
inline bool nearly(double a, double b, double relative, double absolute) {
    return std::fabs(a - b) <= relative * std::max(std::fabs(a), std::fabs(b)) + absolute;
}
inline bool nearly(Rgb a, Rgb b, double relative, double absolute) {
    return nearly(a.r, b.r, relative, absolute) && nearly(a.g, b.g, relative, absolute) &&
           nearly(a.b, b.b, relative, absolute);
}

/// Consistency of sample(): a unit direction, weight = f/pdf, the densities and η of eval(), and a density within the
/// bound of max_pdf(). `relative` allows for the effect of rounding a direction on a sharp lobe.
template <class L>
void expect_sample_agrees_with_eval(const L& lobe, Vec3 wo, double relative = 1e-3,
                                    int samples = 2000) {
    LobeRandom random(3);
    for (int i = 0; i < samples; ++i) {
        const float u_lobe = random.next();
        const auto s = lobe.sample(wo, lobe_choice(lobe, u_lobe), random.next_2d());
        if (!s) continue;
        ASSERT_NEAR(length(s->wi), 1, 2e-6);
        ASSERT_TRUE(is_finite(s->weight) && std::isfinite(s->pdf) && std::isfinite(s->pdf_rev));
        ASSERT_GT(s->pdf, 0);
        ASSERT_TRUE(s->weight.r >= 0 && s->weight.g >= 0 && s->weight.b >= 0);
        if (s->is_delta) {
            ASSERT_LE(s->pdf, 1.00001f);
            ASSERT_LE(s->pdf_rev, 1.00001f);
            continue;
        }
        const BsdfEval e = lobe.eval(wo, s->wi);
        const std::string where = "wo " + describe(wo) + " wi " + describe(s->wi);
        ASSERT_TRUE(nearly(e.pdf, s->pdf, relative, 1e-6))
            << where << ": pdf " << e.pdf << " " << s->pdf;
        ASSERT_TRUE(nearly(e.pdf_rev, s->pdf_rev, relative, 1e-6))
            << where << ": " << e.pdf_rev << " " << s->pdf_rev;
        ASSERT_TRUE(nearly(e.f, s->weight * s->pdf, relative, 1e-6))
            << where << ": f " << e.f.g << " weight·pdf " << s->weight.g * s->pdf;
        ASSERT_FLOAT_EQ(e.eta, s->eta) << where;
        // Cones of all sizes that contain the direction.
        const float angle = kPi * std::pow(random.next(), 4.0f);
        const Frame frame = Frame::from_normal(s->wi);
        const float off = angle * random.next(), phi = 2 * kPi * random.next();
        const DirectionCone cone{frame.to_world({std::sin(off) * std::cos(phi),
                                                 std::sin(off) * std::sin(phi), std::cos(off)}),
                                 angle};
        ASSERT_LE(s->pdf, lobe.max_pdf(wo, cone) * (1 + relative)) << where << ", angle " << angle;
    }
}

/// pdf_rev(wo, wi) = pdf(wi, wo), and f(wo, wi)/|cos θ_i| = η² f(wi, wo)/|cos θ_o| (reciprocity
/// where η = 1), for pairs that the lobe samples and for uniform ones; delta events against the
/// event sampled from the other end.
template <class L>
void expect_adjoint_symmetry(const L& lobe, Vec3 wo, double relative = 1e-3, int samples = 2000) {
    LobeRandom random(4);
    for (int i = 0; i < samples; ++i) {
        const float u_lobe = random.next();
        const Vec2 u = random.next_2d();
        Vec3 wi = sample_uniform_sphere(u);
        if (i % 2 == 0) {
            const auto s = lobe.sample(wo, lobe_choice(lobe, u_lobe), u);
            if (!s || s->is_delta) continue;
            wi = s->wi;
        }
        const BsdfEval a = lobe.eval(wo, wi), b = lobe.eval(wi, wo);
        const std::string where = "wo " + describe(wo) + " wi " + describe(wi);
        ASSERT_TRUE(nearly(a.pdf_rev, b.pdf, relative, 1e-6))
            << where << ": " << a.pdf_rev << " " << b.pdf;
        ASSERT_TRUE(nearly(a.pdf, b.pdf_rev, relative, 1e-6))
            << where << ": " << a.pdf << " " << b.pdf_rev;
        ASSERT_TRUE(
            nearly(a.f * std::fabs(wo.z), b.f * (sqr(a.eta) * std::fabs(wi.z)), relative, 1e-6))
            << where << ": " << a.f.g * std::fabs(wo.z) << " "
            << b.f.g * (sqr(a.eta) * std::fabs(wi.z));
        if (!a.f.is_zero()) {
            ASSERT_NEAR(a.eta * b.eta, 1, 1e-5) << where;
        }
    }
}

/// Each delta event has its reverse: sampled from wi, some event returns to wo with pmf and pmf_rev
/// exchanged and the same f = weight · pmf (times η² of refraction, which the convention of
/// BsdfSample::weight leaves out).
template <class L>
void expect_delta_events_reverse(const L& lobe, Vec3 wo, int samples = 200) {
    LobeRandom random(5);
    for (int i = 0; i < samples; ++i) {
        const float u_lobe = random.next();
        const auto s = lobe.sample(wo, lobe_choice(lobe, u_lobe), random.next_2d());
        if (!s || !s->is_delta) continue;
        bool found = false;
        for (int j = 0; j < 1000 && !found; ++j) {
            const auto back =
                lobe.sample(s->wi, lobe_choice(lobe, (float(j) + 0.5f) / 1000), random.next_2d());
            if (!back || !back->is_delta || length(back->wi - wo) > 1e-4f) continue;
            found = true;
            ASSERT_TRUE(nearly(back->pdf, s->pdf_rev, 1e-3, 1e-6)) << describe(wo);
            ASSERT_TRUE(nearly(back->pdf_rev, s->pdf, 1e-3, 1e-6)) << describe(wo);
            ASSERT_TRUE(nearly(back->weight * back->pdf, s->weight * s->pdf, 1e-3, 1e-6))
                << describe(wo);
            ASSERT_NEAR(s->eta * back->eta, 1, 1e-5);
        }
        // A thousand strata may miss an event of very small probability.
        ASSERT_TRUE(found || s->pdf_rev < 2e-3f) << describe(wo);
    }
}

struct Albedo {
    Rgb value;
    Rgb standard_error;
};
/// Mean weight of sample() over stratified numbers: the directional albedo, delta events included.
template <class L>
Albedo sampled_albedo(const L& lobe, Vec3 wo, int strata = 64) {
    LobeRandom random(6);
    double sum[3] = {}, sum2[3] = {};
    const int n = strata * strata;
    for (int i = 0; i < n; ++i) {
        const Vec2 jitter = random.next_2d();
        const Vec2 u{(float(i % strata) + jitter.x) / float(strata),
                     (float(i / strata) + jitter.y) / float(strata)};
        const auto s =
            lobe.sample(wo, lobe_choice(lobe, random.next()),
                        {std::min(u.x, kOneMinusEpsilon), std::min(u.y, kOneMinusEpsilon)});
        for (int c = 0; s && c < 3; ++c) {
            sum[c] += s->weight[c];
            sum2[c] += sqr(double(s->weight[c]));
        }
    }
    Albedo a;
    for (int c = 0; c < 3; ++c) {
        a.value[c] = float(sum[c] / n);
        a.standard_error[c] = float(std::sqrt(std::max(0.0, sum2[c] / n - sqr(sum[c] / n)) / n));
    }
    return a;
}

/// ∫ f of one colour channel over all directions, by quadrature of eval() in coordinates fitted to
/// the lobe: the albedo of the smooth part.
template <class L>
double integrated_albedo(const L& lobe, Vec3 wo, int channel, double tolerance = 5e-5) {
    double total = 0;
    for (const bool upper : {true, false}) {
        const PolarMap map = fit_polar_map(lobe, wo, upper);
        const auto f = [&](double t, double phi) {
            double jacobian;
            const Vec3 wi = map.direction(t, phi, jacobian);
            return (wi.z > 0) == upper ? double(lobe.eval(wo, wi).f[channel]) * jacobian : 0.0;
        };
        total += integrate_2d(f, 0, 1, -M_PI, M_PI, tolerance, 4);
    }
    return total;
}

/// No more light leaves than arrives.
template <class L>
void expect_energy_conserved(const L& lobe, Vec3 wo) {
    const Albedo a = sampled_albedo(lobe, wo);
    for (int c = 0; c < 3; ++c) {
        EXPECT_LE(a.value[c], 1 + 5 * a.standard_error[c] + 1e-4f) << "wo " << describe(wo);
    }
}

/// Finite, non-negative numbers for every pair of directions, with grazing and degenerate ones, and
/// for extreme u.
template <class L>
void expect_finite(const L& lobe) {
    std::vector<Vec3> directions;
    for (float z : {1.0f, 0.7f, 1e-3f, 1e-6f, 1e-12f, 1e-30f, 0.0f})
        for (float sign : {1.0f, -1.0f})
            for (double phi : {0.0, 90.0, 200.0}) {
                const float r = safe_sqrt(1 - z * z);
                const Vec3 d = direction(90, phi);
                directions.push_back({r * d.x, r * d.y, sign * z});
            }
    const auto ok = [](Rgb c) { return is_finite(c) && c.r >= 0 && c.g >= 0 && c.b >= 0; };
    for (Vec3 wo : directions) {
        for (Vec3 wi : directions) {
            const BsdfEval e = lobe.eval(wo, wi);
            ASSERT_TRUE(ok(e.f) && std::isfinite(e.pdf) && e.pdf >= 0 && std::isfinite(e.pdf_rev) &&
                        e.pdf_rev >= 0)
                << describe(wo) << describe(wi) << " f " << e.f.g << " pdf " << e.pdf << " rev "
                << e.pdf_rev;
        }
        for (float a : {0.0f, 0x1p-24f, 0.5f, kOneMinusEpsilon})
            for (float b : {0.0f, 0x1p-24f, 0.5f, kOneMinusEpsilon})
                for (float l : {0.0f, 0.5f, kOneMinusEpsilon}) {
                    const auto s = lobe.sample(wo, lobe_choice(lobe, l), {a, b});
                    if (!s) continue;
                    ASSERT_TRUE(ok(s->weight) && is_finite(s->wi) && std::isfinite(s->pdf) &&
                                s->pdf > 0 && std::isfinite(s->pdf_rev) && s->pdf_rev >= 0)
                        << describe(wo) << " u " << l << " " << a << " " << b << " weight "
                        << s->weight.g << " pdf " << s->pdf << " rev " << s->pdf_rev;
                }
    }
    const float roughness = lobe.roughness();
    EXPECT_TRUE(roughness >= 0 && std::isfinite(roughness));
    EXPECT_TRUE(ok(lobe.albedo_estimate()));
}

}  // namespace etendue::testing
