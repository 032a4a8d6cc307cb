// Irradiance gradients against finite differences where the irradiance is known.

#include "reuse/irradiance_cache.h"

#include <cmath>

#include <gtest/gtest.h>

namespace etendue {
namespace {

/// A lamp in the plane z = h, a disc of the radius a about (0, 0, h); the plane is dark around it.
struct DiscLamp {
    double a = 1.3, h = 1;
    Rgb Le{3, 2, 1};

    IncidentRadiance radiance(Vec3 p, Vec3 d) const {
        if (!(d.z > 0)) return {};
        const float t = float(h - double(p.z)) / d.z;
        const Vec3 q = p + d * t;
        return {sqr(q.x) + sqr(q.y) < sqr(float(a)) ? Le : Rgb(), t};
    }
    /// ∫ cos θ dω over the lamp, wholly above the horizon of n.
    double projected_solid_angle(Vec3 p, Vec3 n) const {
        constexpr int kRings = 200, kSectors = 400;
        double sum = 0;
        for (int i = 0; i < kRings; ++i)
            for (int j = 0; j < kSectors; ++j) {
                const double r = a * (i + 0.5) / kRings, phi = 2 * M_PI * (j + 0.5) / kSectors;
                const double x = r * std::cos(phi) - double(p.x),
                             y = r * std::sin(phi) - double(p.y), z = h - double(p.z),
                             d2 = x * x + y * y + z * z;
                const double cosine = x * double(n.x) + y * double(n.y) + z * double(n.z);
                sum += cosine * z / (d2 * d2) * r * (a / kRings) * (2 * M_PI / kSectors);
            }
        return sum;
    }
};

IrradianceRecord record(const DiscLamp& lamp, Vec3 p, Vec3 n) {
    Sampler sampler(SamplerKind::Independent, 3);
    sampler.start(0, 0);
    sampler.seek(Stream::Auxiliary, 0);
    return measure_irradiance(p, n, 100'000, sampler, [&](Vec3 d) { return lamp.radiance(p, d); });
}

// In a corner the distance to the nearest surface is 0 or the smallest float.
TEST(IrradianceCache, GradientsAreNumbersInCorners) {
    Sampler sampler(SamplerKind::Independent, 3);
    sampler.start(0, 0);
    for (const float distance : {0.0f, 1e-45f, 1e-38f, kInf}) {
        sampler.seek(Stream::Auxiliary, 0);
        const IrradianceRecord r =
            measure_irradiance({}, {0, 0, 1}, 1000, sampler, [&](Vec3 d) -> IncidentRadiance {
                return {Rgb(), d.x > 0 ? distance : 1};
            });
        for (int c = 0; c < 3; ++c) {
            EXPECT_TRUE(is_finite(r.rotation[size_t(c)])) << distance;
            EXPECT_TRUE(is_finite(r.translation[size_t(c)])) << distance;
        }
    }
}

TEST(IrradianceCache, GradientsAreThoseOfADiscLamp) {
    const DiscLamp lamp;
    for (const Vec3 p : {Vec3{0.4f, 0, 0}, Vec3{0.5f, -0.7f, 0.2f}, Vec3{0, 0, 0.3f}}) {
        const Vec3 n{0, 0, 1};
        const IrradianceRecord r = record(lamp, p, n);
        const double E = lamp.projected_solid_angle(p, n);
        constexpr float kStep = 0.01f;
        for (int c = 0; c < 3; ++c) {
            const double L = double(lamp.Le[c]);
            EXPECT_NEAR(r.E[c], L * E, 0.005 * L * E);
            for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}}) {
                const Vec3 d = axis * kStep;
                const double moved =
                    (lamp.projected_solid_angle(p + d, n) - lamp.projected_solid_angle(p - d, n)) /
                    (2 * double(kStep));
                EXPECT_NEAR(dot(r.translation[size_t(c)], axis), L * moved, 0.03 * L * E);
                const Vec3 lean = normalize(n + d);
                const double turned =
                    (lamp.projected_solid_angle(p, lean) - E * double(lean.z)) / double(kStep);
                EXPECT_NEAR(dot(r.rotation[size_t(c)], cross(n, axis)), L * turned, 0.01 * L * E);
            }
        }
    }
}

TEST(IrradianceCache, InterpolatesBetweenRecords) {
    const DiscLamp lamp;
    IrradianceCache cache;
    cache.reset(0.3f, 0.01f, 10);
    const Vec3 n{0, 0, 1};
    std::vector<IrradianceRecord> records;
    for (const float x : {-0.6f, -0.3f, 0.0f, 0.3f, 0.6f})
        records.push_back(record(lamp, {x, 0.1f, 0}, n));
    cache.add(records);
    for (float x = -0.6f; x <= 0.6f; x += 0.05f) {
        const Vec3 lean = normalize(Vec3{0.03f, 0.02f, 1});
        const auto E = cache.find({x, 0.15f, 0}, lean);
        ASSERT_TRUE(E);
        const double exact = 3 * lamp.projected_solid_angle({x, 0.15f, 0}, lean);
        EXPECT_NEAR(E->r, exact, 0.02 * exact);
    }
    EXPECT_FALSE(cache.find({3, 0, 0}, n));
    EXPECT_FALSE(cache.find({0, 0, 0}, -n));
    EXPECT_FALSE(cache.find({0, 0.1f, -0.2f}, n)) << "behind all records";
}

}  // namespace
}  // namespace etendue
