#include "math/warp.h"

#include <gtest/gtest.h>

#include <cmath>

#include "chi2.h"
#include "random.h"

namespace etendue {
namespace {

using testing::Chi2Grid;
using testing::Chi2Result;
using testing::Random;

/// All χ² tests of this file together raise a false alarm with this probability (were the seeds not
/// fixed).
constexpr double kFalseAlarmOfWarps = 1e-3;
constexpr int kWarps = 8;
constexpr int kDrawsOfWarp = 200000;
constexpr double kTau = 2 * M_PI;

void expect_passes(const Chi2Result& result) {
    EXPECT_GT(result.p_value, sidak(kFalseAlarmOfWarps, kWarps))
        << "chi2 " << result.statistic << " at " << result.degrees << " degrees of freedom";
    EXPECT_NEAR(result.total_probability, 1, 1e-4);
}

double azimuth(double x, double y) {
    const double phi = std::atan2(y, x);
    return phi < 0 ? phi + kTau : phi;
}

/// χ² of directions against a density that depends on cos θ only, on the grid (cos θ, φ) where
/// solid angle is area.
template <class Sample, class Pdf>
void expect_directions(Sample&& sample, Pdf&& pdf, double lowest_cosine) {
    Random random(1);
    Chi2Grid grid(lowest_cosine, 1, 20, 0, kTau, 24);
    for (int i = 0; i < kDrawsOfWarp; ++i) {
        const Vec3 w = sample(random.next_2d());
        ASSERT_NEAR(length(w), 1, 1e-6f);
        // Near the pole x and y know the angle better than z does.
        const double sin2 = double(w.x) * w.x + double(w.y) * w.y;
        grid.add(sin2 < 0.5 && w.z > 0 ? std::sqrt(1 - sin2) : w.z, azimuth(w.x, w.y));
    }
    expect_passes(grid.test([&](double z, double) { return pdf(float(z)); }));
}

TEST(Warp, CosineHemisphere) {
    expect_directions(sample_cosine_hemisphere, pdf_cosine_hemisphere, 0);
    EXPECT_EQ(pdf_cosine_hemisphere(-0.5f), 0);
}

TEST(Warp, UniformSphere) {
    expect_directions(
        sample_uniform_sphere, [](float) { return kUniformSpherePdf; }, -1);
}

TEST(Warp, UniformCones) {
    for (const float cos_max : {0.99999f, 0.9f, 0.0f, -0.7f})
        expect_directions([&](Vec2 u) { return sample_uniform_cone(u, 1 - cos_max); },
                          [&](float) { return pdf_uniform_cone(1 - cos_max); }, cos_max);
}

// The sun: the sine of the angle must be smooth although its cosine has few values left in a float.
TEST(Warp, NarrowConesAreFine) {
    const float most = 2 * sqr(std::sin(0.00465f / 2));
    float before = 0;
    for (int i = 1; i <= 1000; ++i) {
        const Vec3 w = sample_uniform_cone({float(i) / 1001, 0}, most);
        EXPECT_GT(w.x, before);
        before = w.x;
    }
}

TEST(Warp, UniformDisk) {
    Random random(2);
    Chi2Grid grid(0, 1, 16, 0, kTau, 24);  // r² and φ: equal cells have equal areas
    for (int i = 0; i < kDrawsOfWarp; ++i) {
        const Vec2 p = sample_uniform_disk(random.next_2d());
        grid.add(double(p.x) * p.x + double(p.y) * p.y, azimuth(p.x, p.y));
    }
    expect_passes(grid.test([](double, double) { return kUniformDiskPdf / 2; }));
}

// The concentric map keeps neighbours together: a step in the square is at most √(4 + π²/4) = 2.54
// times as long on the disc.
TEST(Warp, UniformDiskIsContinuous) {
    constexpr int n = 64;
    constexpr float h = 1.0f / n;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j <= n; ++j) {
            const Vec2 a{float(i) * h, float(j) * h}, b{float(i + 1) * h, float(j) * h};
            const Vec2 across = sample_uniform_disk(a) - sample_uniform_disk(b);
            const Vec2 along = sample_uniform_disk({a.y, a.x}) - sample_uniform_disk({b.y, b.x});
            EXPECT_LT(std::hypot(across.x, across.y), 2.6f * h);
            EXPECT_LT(std::hypot(along.x, along.y), 2.6f * h);
        }
    EXPECT_EQ(sample_uniform_disk({0.5f, 0.5f}), (Vec2{0, 0}));
}

TEST(Warp, UniformTriangle) {
    Random random(3);
    Chi2Grid grid(0, 1, 16, 0, 1, 16);
    for (int i = 0; i < kDrawsOfWarp; ++i) {
        const Vec2 b = sample_uniform_triangle(random.next_2d());
        ASSERT_GE(b.x, 0);
        ASSERT_GE(b.y, 0);
        ASSERT_LE(b.x + b.y, 1 + 1e-6f);
        grid.add(b.x, b.y);
    }
    expect_passes(grid.test([](double x, double y) { return x + y <= 1 ? 2.0 : 0.0; }, 4));
}

TEST(Warp, ExtremeNumbers) {
    for (const float x : {0.0f, 0x1p-24f, 0.5f, kOneMinusEpsilon})
        for (const float y : {0.0f, 0x1p-24f, 0.5f, kOneMinusEpsilon}) {
            const Vec2 u{x, y};
            EXPECT_NEAR(length(sample_cosine_hemisphere(u)), 1, 1e-6f);
            EXPECT_GE(sample_cosine_hemisphere(u).z, 0);
            EXPECT_NEAR(length(sample_uniform_sphere(u)), 1, 1e-6f);
            EXPECT_NEAR(length(sample_uniform_cone(u, 0.7f)), 1, 1e-6f);
            EXPECT_GE(sample_uniform_cone(u, 0.7f).z, 0.3f - 1e-6f);
            const Vec2 b = sample_uniform_triangle(u);
            EXPECT_LE(b.x + b.y, 1 + 1e-6f);
        }
}

}  // namespace
}  // namespace etendue
