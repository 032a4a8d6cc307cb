#include "bsdf/fresnel.h"

#include <gtest/gtest.h>

#include <complex>

namespace etendue {
namespace {

TEST(Fresnel, DielectricAtNormalIncidence) {
    EXPECT_NEAR(fresnel_dielectric(1, 1.5f).R, 0.04, 1e-6);
    EXPECT_NEAR(fresnel_dielectric(-1, 1.5f).R, 0.04, 1e-6);
}

TEST(Fresnel, DielectricVanishesAtBrewstersAngleForOnePolarisation) {
    // At tan θ = η only the s part is left: R = ½ ((η² − 1) / (η² + 1))².
    const double eta = 1.5, cos = 1 / std::sqrt(1 + eta * eta);
    EXPECT_NEAR(fresnel_dielectric(float(cos), 1.5f).R,
                0.5 * std::pow((eta * eta - 1) / (eta * eta + 1), 2), 1e-6);
}

TEST(Fresnel, RefractionObeysSnellAndReversesWithTheSameReflectance) {
    for (float eta : {0.6f, 1.1f, 1.5f, 2.4f})
        for (float z : {1.0f, 0.8f, 0.3f, 0.05f, -0.05f, -0.3f, -0.8f, -1.0f}) {
            const Vec3 w{safe_sqrt(1 - z * z) * 0.6f, safe_sqrt(1 - z * z) * -0.8f, z};
            const DielectricFresnel f = fresnel_dielectric(z, eta);
            const float sin_t = safe_sqrt(1 - z * z) / f.eta;
            if (sin_t >= 1) {
                EXPECT_EQ(f.R, 1);
                continue;
            }
            const Vec3 t = refract(w, f);
            EXPECT_NEAR(length(t), 1, 1e-6);
            EXPECT_LT(t.z * w.z, 0);
            EXPECT_NEAR(length(cross(t, {0, 0, 1})), sin_t, 1e-6);
            const DielectricFresnel back = fresnel_dielectric(t.z, eta);
            EXPECT_NEAR(back.R, f.R, 2e-5);
            EXPECT_NEAR(back.eta * f.eta, 1, 1e-6);
            const Vec3 w2 = refract(t, back);
            EXPECT_NEAR(length(w2 - w), 0, 1e-5);
            // The form for any facet normal agrees, whichever way it points.
            for (float sign : {1.0f, -1.0f}) {
                const Vec3 m{0, 0, sign};
                const DielectricFresnel g = fresnel_dielectric(dot(w, m), sign > 0 ? eta : 1 / eta);
                EXPECT_NEAR(length(refract(w, m, g) - t), 0, 1e-6);
            }
        }
}

TEST(Fresnel, DielectricReflectsAllAtGrazingAndBeyondTheCriticalAngle) {
    EXPECT_NEAR(fresnel_dielectric(1e-6f, 1.5f).R, 1, 1e-4);
    const float critical = std::sqrt(1 - 1 / (1.5f * 1.5f));
    EXPECT_EQ(fresnel_dielectric(-(critical - 1e-3f), 1.5f).R, 1);
    EXPECT_LT(fresnel_dielectric(-(critical + 1e-3f), 1.5f).R, 1);
}

TEST(Fresnel, ConductorMatchesComplexArithmetic) {
    for (double eta : {0.2, 1.0, 2.9})
        for (double k : {0.0, 0.5, 4.0})
            for (double cos : {1.0, 0.7, 0.2, 0.01}) {
                const std::complex<double> n(eta, k), n2 = n * n;
                const std::complex<double> root = std::sqrt(n2 - (1 - cos * cos));
                const double rs = std::norm((cos - root) / (cos + root));
                const double rp = std::norm((n2 * cos - root) / (n2 * cos + root));
                EXPECT_NEAR(fresnel_conductor(float(cos), Rgb(float(eta)), Rgb(float(k))).g,
                            0.5 * (rs + rp), 2e-5)
                    << eta << " " << k << " " << cos;
            }
}

TEST(Fresnel, ConductorWithoutAbsorptionIsADielectric) {
    for (float cos : {1.0f, 0.6f, 0.1f})
        EXPECT_NEAR(fresnel_conductor(cos, Rgb(1.5f), Rgb(0)).r, fresnel_dielectric(cos, 1.5f).R,
                    1e-5);
}

TEST(Fresnel, PerfectMirrorIndexReflectsEverything) {
    for (float cos : {1.0f, 0.5f, 0.1f, 1e-3f, 0.0f})
        EXPECT_EQ(fresnel_conductor(cos, Rgb(0), Rgb(1)), Rgb(1));
    EXPECT_TRUE(is_finite(fresnel_conductor(0, Rgb(1), Rgb(0))));
}

TEST(Fresnel, DiffuseReflectanceMatchesQuadrature) {
    for (float eta : {1.00001f, 1.0003f, 1.01f, 1.33f, 1.5f, 2.4f, 4.0f, 1 / 1.0003f, 1 / 1.33f,
                      1 / 1.5f, 0.25f}) {
        double sum = 0;
        const int n = 200000;
        for (int i = 0; i < n; ++i) {
            const double mu = (i + 0.5) / n;
            sum += 2 * fresnel_dielectric(float(mu), eta).R * mu / n;
        }
        EXPECT_NEAR(fresnel_diffuse_reflectance(eta), sum, 1e-4) << eta;
    }
}

TEST(Fresnel, DiffuseTransmittanceHasItsDigitsForAnyIndex) {
    for (const float eta : {0.1f, 0.7f, 1.0f, 1.5f, 10.0f})
        EXPECT_NEAR(fresnel_diffuse_transmittance(eta), 1 - fresnel_diffuse_reflectance(eta), 1e-6);
    for (const float eta : {1e3f, 1e4f, 1e6f}) {
        // 1 − R → 2 (μ + 1/μ) / η.
        const double limit = 16 / (3 * double(eta));
        EXPECT_NEAR(fresnel_diffuse_transmittance(eta) / limit, 1, 0.05) << eta;
        EXPECT_NEAR(fresnel_diffuse_transmittance(1 / eta) * sqr(double(eta)) /
                        fresnel_diffuse_transmittance(eta),
                    1, 1e-5);
    }
}

}  // namespace
}  // namespace etendue
