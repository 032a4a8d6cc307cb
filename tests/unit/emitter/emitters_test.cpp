// Emitters against their own densities: power is the integral of what is emitted, samples have the densities they claim.

#include "emitter/emitter.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "emitter/area.h"
#include "emitter/environment.h"
#include "emitter/point.h"
#include "random.h"

namespace etendue {
namespace {

constexpr int kSamples = 200000;

/// Emitters of a maker, from parameters written in the test.
class NoContext final : public EmitterContext {
    TextureRef texture(const Params&, std::string_view, Rgb fallback, float) override {
        return TextureRef(fallback);
    }
    const Shape* shape() const override { return nullptr; }
};

std::unique_ptr<Emitter> spot(const char* falloff) {
    SceneDescription scene;
    scene.objects = {{"emitter",
                      "spot",
                      "",
                      {},
                      {{"intensity", Rgb(2), {}},
                       {"cutoff_angle", 50.0, {}},
                       {"beam_width", 20.0, {}},
                       {"falloff", std::string(falloff), {}}},
                      {}}};
    NoContext context;
    return std::move(spot_entry().make({scene, 0}, context).front());
}

TEST(Spot, PowerIsTheIntegralOfTheIntensity) {
    testing::Random random(1);
    for (const char* falloff : {"angle", "smooth", "quartic"}) {
        const auto emitter = spot(falloff);
        double sum = 0;
        for (int i = 0; i < kSamples; ++i) {
            const EmissionSample s = emitter->sample_emission({}, random.next_2d());
            sum += luminance(s.Le) / s.pdf_d;
        }
        // Linear in the angle: power(), which only chooses among emitters, is that of a line in the cosine.
        const double tolerance = std::string_view(falloff) == "angle" ? 0.1 : 0.01;
        EXPECT_NEAR(sum / kSamples / emitter->power(), 1, tolerance) << falloff;
    }
}

TEST(Spot, FallsOffAsItSays) {
    const auto at = [](const char* falloff, double degrees) {
        const double radians = degrees * M_PI / 180;
        return spot(falloff)
            ->eval_emission({}, {}, {float(std::sin(radians)), 0, float(std::cos(radians))})
            .Le_cos.g;
    };
    const double x = (std::cos(35 * M_PI / 180) - std::cos(50 * M_PI / 180)) /
                     (std::cos(20 * M_PI / 180) - std::cos(50 * M_PI / 180));
    EXPECT_NEAR(at("angle", 35), 1, 1e-5);
    EXPECT_NEAR(at("smooth", 35), 2 * x * x * (3 - 2 * x), 1e-5);
    EXPECT_NEAR(at("quartic", 35), 2 * std::pow(x, 4), 1e-5);
    for (const char* falloff : {"angle", "smooth", "quartic"}) {
        EXPECT_NEAR(at(falloff, 10), 2, 1e-6);
        EXPECT_EQ(at(falloff, 51), 0);
    }
}

TEST(AreaEmitter, TwoSidedShinesTheSameFromTheBack) {
    const Disk disk(Transform(), false);
    const auto one = make_area_emitter(disk, Rgb(3)), two = make_area_emitter(disk, Rgb(3), true);
    EXPECT_NEAR(two->power(), 2 * one->power(), 1e-4);
    const Vec3 n{0, 0, 1}, up = normalize({0.3f, 0.2f, 1}), down = -up;
    EXPECT_EQ(one->eval_surface(n, {}, 0, down).Le, Rgb(0));
    EXPECT_EQ(two->eval_surface(n, {}, 0, down).Le, Rgb(3));
    EXPECT_EQ(two->eval_surface(n, {}, 0, up).pdf_d, two->eval_surface(n, {}, 0, down).pdf_d);
    // ∫ L |cos| dω over samples of the density that is claimed, and how many go to each side.
    testing::Random random(2);
    double sum = 0;
    int front = 0;
    for (int i = 0; i < kSamples; ++i) {
        const FinePoint u{random.next_1d(), random.next_1d()};
        const EmissionSample s = two->sample_emission(u, random.next_2d());
        sum += luminance(s.Le) * std::fabs(dot(s.d, s.ng)) / (s.pdf_y0 * s.pdf_d);
        front += dot(s.d, s.ng) > 0;
        EXPECT_NEAR(two->eval_emission(s.ng, s.uv, s.d).pdf_d, s.pdf_d, 1e-5);
    }
    EXPECT_NEAR(sum / kSamples / two->power(), 1, 1e-3);
    EXPECT_NEAR(double(front) / kSamples, 0.5, 4 * 0.5 / std::sqrt(double(kSamples)));
}

TEST(AreaEmitter, IsScaledToAPower) {
    const Disk disk(Transform(), false);
    const auto emitter = make_area_emitter(disk, Rgb(3), true, 100);
    EXPECT_NEAR(emitter->power(), 100, 1e-3);
    EXPECT_NEAR(emitter->eval_surface({0, 0, 1}, {}, 0, {0, 0, 1}).Le.g, 100 / (2 * M_PI * M_PI),
                1e-4);
}

TEST(EqualAreaEnvironment, SquareAndSphereAreMappedOntoEachOther) {
    testing::Random random(3);
    for (int i = 0; i < 10000; ++i) {
        const Vec2 u = random.next_2d();
        const Vec3 d = equal_area_direction(u);
        EXPECT_NEAR(length(d), 1, 1e-5);
        const Vec2 back = equal_area_square(d);
        EXPECT_NEAR(back.x, u.x, 2e-3) << u.x << ' ' << u.y;
        EXPECT_NEAR(back.y, u.y, 2e-3) << u.x << ' ' << u.y;
    }
    // The centre is +z, the corners are -z, the middle of the right edge is +x [Clarberg 2008].
    EXPECT_NEAR(equal_area_direction({0.5f, 0.5f}).z, 1, 1e-6);
    EXPECT_NEAR(equal_area_direction({0.001f, 0.001f}).z, -1, 1e-3);
    EXPECT_NEAR(equal_area_direction({1, 0.5f}).x, 1, 1e-3);
    EXPECT_NEAR(equal_area_direction({0.5f, 1}).y, 1, 1e-3);
}

TEST(EqualAreaEnvironment, SamplesHaveTheDensityOfTheImage) {
    // Three dim quarters and a bright one.
    const auto environment = make_equal_area_environment(2, {Rgb(1), Rgb(2), Rgb(1), Rgb(6)},
                                                         Transform::rotate({1, 2, 3}, 40));
    environment->set_scene_bounds({}, 1);
    testing::Random random(4);
    double flux = 0, sphere = 0;
    int bright = 0;
    for (int i = 0; i < kSamples; ++i) {
        DirectSample s;
        ASSERT_TRUE(environment->sample_direct({}, {random.next_1d(), random.next_1d()}, s));
        flux += s.Le.g / s.pdf;
        sphere += 1 / s.pdf;
        bright += s.Le.g == 6;
        EXPECT_EQ(environment->eval_infinite(s.wi).pdf, s.pdf);
    }
    EXPECT_NEAR(flux / kSamples, 4 * M_PI * 2.5, 0.01 * 4 * M_PI);
    EXPECT_NEAR(sphere / kSamples, 4 * M_PI, 0.02 * 4 * M_PI);
    EXPECT_NEAR(double(bright) / kSamples, 0.6, 4 * 0.5 / std::sqrt(double(kSamples)));
    EXPECT_NEAR(environment->power(), M_PI * 4 * M_PI * 2.5, 1e-2);
}

}  // namespace
}  // namespace etendue
