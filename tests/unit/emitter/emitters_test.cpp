// Emitters against their own densities: power is the integral of what is emitted, samples have the densities they claim.

#include "emitter/emitter.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "chi2.h"
#include "emitter/area.h"
#include "emitter/environment.h"
#include "emitter/point.h"
#include "image/image_io.h"
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
    std::function<float(const TexturePoint&)> opacity() const override { return {}; }
};

std::unique_ptr<Emitter> spot(const char* falloff, double cutoff = 50, double beam = 20) {
    SceneDescription scene;
    scene.objects = {{"emitter",
                      "spot",
                      "",
                      {},
                      {{"intensity", Rgb(2), {}},
                       {"cutoff_angle", cutoff, {}},
                       {"beam_width", beam, {}},
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

// The cosines of such angles are 1 in a float, or a few units below it.
TEST(Spot, OfNarrowBeamsHasOneDensity) {
    testing::Random random(2);
    for (const double cutoff : {0.01, 0.05, 0.3}) {
        const auto emitter = spot("angle", cutoff, cutoff);
        const double solid_angle = 4 * M_PI * sqr(std::sin(cutoff * M_PI / 360));
        EXPECT_NEAR(emitter->power() / (2 * solid_angle), 1, 1e-5) << cutoff;
        int seen = 0;
        for (int i = 0; i < 10000; ++i) {
            const EmissionSample s = emitter->sample_emission({}, random.next_2d());
            const Emitter::Emission again = emitter->eval_emission({}, {}, 0, s.d);
            EXPECT_EQ(again.pdf_d, s.pdf_d);
            seen += s.Le.g > 0;
            if (s.pdf_d > 0) {
                EXPECT_NEAR(double(s.pdf_d) * solid_angle, 1, 1e-5) << cutoff;
            }
        }
        EXPECT_GT(seen, 9970) << cutoff;
        for (const double part : {0.99, 1.01}) {
            const double angle = part * cutoff * M_PI / 180;
            const Vec3 d{float(std::sin(angle)), 0, float(std::cos(angle))};
            EXPECT_EQ(emitter->eval_emission({}, {}, 0, d).pdf_d > 0, part < 1) << cutoff;
        }
    }
}

TEST(Spot, FallsOffAsItSays) {
    const auto at = [](const char* falloff, double degrees) {
        const double radians = degrees * M_PI / 180;
        return spot(falloff)
            ->eval_emission({}, {}, 0, {float(std::sin(radians)), 0, float(std::cos(radians))})
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
        EXPECT_NEAR(two->eval_emission(s.ng, s.uv, s.prim, s.d).pdf_d, s.pdf_d, 1e-5);
    }
    EXPECT_NEAR(sum / kSamples / two->power(), 1, 1e-3);
    EXPECT_NEAR(double(front) / kSamples, 0.5, 4 * 0.5 / std::sqrt(double(kSamples)));
}

/// From outside, the points of a sphere lie on the part that is seen, and are uniform in solid angle: a term of the light at the
/// observer then has no variance.
TEST(AreaEmitter, SpheresAreSampledBySolidAngle) {
    const Vec3 center{1, -2, 0.5f};
    for (const float radius : {1.0f, 1e-3f}) {
        const Sphere sphere(center, radius, false);
        const auto emitter = make_area_emitter(sphere, Rgb(1));
        for (const float distance : {1.001f, 1.5f, 20.0f, 3000.0f}) {
            const Vec3 from = center + normalize({0.3f, -0.5f, 0.8f}) * (radius * distance);
            const double sine = 1 / double(distance),
                         solid_angle = 2 * M_PI * sine * sine / (1 + std::sqrt(1 - sine * sine));
            testing::Random random(6);
            Vec3 mean;
            constexpr int kPoints = 4000;
            for (int i = 0; i < kPoints; ++i) {
                DirectSample s;
                const bool lit =
                    emitter->sample_direct(from, {random.next_1d(), random.next_1d()}, s);
                mean = mean + normalize(s.p - from) * (1.0f / kPoints);
                if (!lit) continue;  // at the rim
                ASSERT_NEAR(length(s.p - center), radius, 1e-5f * radius + 1e-6f);
                ASSERT_EQ(s.pdf, emitter->direct_pdf(s.p, s.ng, s.prim, from));
                ASSERT_FLOAT_EQ(s.pdf_y0, float(1 / sphere.area()));
                // The rounding of points is large beside a distant small sphere, and at its rim.
                const double cosine = -double(dot(s.ng, s.wi));
                if (radius < 1 || cosine < 0.05) continue;
                ASSERT_NEAR(cosine / (double(sqr(s.dist)) * double(s.pdf)) / solid_angle, 1, 1e-3)
                    << distance;
            }
            // The mean of cos θ over the cone.
            const double expected = (1 + std::sqrt(1 - sine * sine)) / 2;
            EXPECT_NEAR(double(dot(mean, normalize(center - from))), expected, 0.02);
        }
    }
}

/// From the earth to the sun in millimetres and in units beyond, and among atoms.
TEST(AreaEmitter, SpheresAreSampledBySolidAngleAtAnyScale) {
    for (const float scale : {1e-18f, 1e-8f, 1.0f, 1e14f, 1e17f}) {
        const Sphere sphere({2 * scale, 0, scale}, scale, false);
        const auto emitter = make_area_emitter(sphere, Rgb(1));
        const Vec3 from{-scale, 0.5f * scale, 0};
        testing::Random random(8);
        int lit = 0;
        for (int i = 0; i < 100; ++i) {
            DirectSample s;
            if (!emitter->sample_direct(from, {random.next_1d(), random.next_1d()}, s)) continue;
            ++lit;
            const double cosine = -double(dot(s.ng, s.wi)), d2 = sqr(double(s.dist)),
                         distance2 = 10.25 * sqr(double(scale)),
                         sine2 = sqr(double(scale)) / distance2,
                         solid_angle = 2 * M_PI * sine2 / (1 + std::sqrt(1 - sine2));
            if (cosine < 0.05) continue;
            ASSERT_GT(s.pdf, 0) << scale;
            // A density per area overflows or vanishes for the largest and smallest.
            ASSERT_NEAR(cosine / (d2 * double(s.pdf)) / solid_angle, 1, 1e-3) << scale;
        }
        EXPECT_GT(lit, 90) << scale;
    }
}

/// By rays that meet the sphere, which know nothing of how it is sampled: ∫ p dA = 1.
TEST(AreaEmitter, DensityOfSpheresIsOneInTotal) {
    const Sphere sphere({0, 0, 0}, 1, false), inward({0, 0, 0}, 1, true);
    for (const bool two_sided : {false, true})
        for (const Sphere* s : {&sphere, &inward})
            for (const Vec3 from : {Vec3{0, 0.2f, 0.1f}, Vec3{0.8f, 0.9f, 0}, Vec3{5, -1, 2}}) {
                const auto emitter = make_area_emitter(*s, Rgb(1), two_sided);
                testing::Random random(7);
                double sum = 0;
                for (int i = 0; i < kSamples; ++i) {
                    const ShapeSample at = s->sample(0, random.next_2d());
                    sum += double(emitter->direct_pdf(at.p, at.ng, 0, from)) * s->area();
                }
                EXPECT_NEAR(sum / kSamples, 1, 0.02);
            }
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

// ---- Points with an image of their intensity

class ImageLights : public ::testing::Test {
protected:
    std::unique_ptr<Emitter> make(const EmitterEntry& entry, int width, int height,
                                  std::vector<Rgb> pixels, std::vector<Param> params = {}) {
        const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
        const std::string file = ::testing::TempDir() + "etendue-" + test->name() + ".exr";
        write_image(file, rgb_image(width, height, pixels));
        params.push_back({"filename", file, {}});
        scene_.objects = {{"emitter", entry.info.name, "", {}, std::move(params), {}}};
        return std::move(entry.make({scene_, 0}, context_).front());
    }

    /// Samples of emission against the density and the intensity that are claimed for both directions.
    void expect_consistent(const Emitter& light, int cells) {
        EXPECT_TRUE(light.is_delta());
        testing::Random random(5);
        testing::Chi2Grid grid(0, M_PI, cells, -M_PI, M_PI, cells);
        double flux = 0;
        for (int i = 0; i < kSamples; ++i) {
            const EmissionSample s = light.sample_emission({}, random.next_2d());
            grid.add(std::acos(double(s.d.z)), std::atan2(double(s.d.y), double(s.d.x)));
            if (!(s.pdf_d > 0)) continue;  // rounded across the edge of a black pixel
            flux += double(luminance(s.Le) / s.pdf_d);
            ASSERT_LE(s.pdf_d, light.max_pdf_d());
            const Emitter::Emission e = light.eval_emission(s.ng, s.uv, s.prim, s.d);
            ASSERT_EQ(e.pdf_d, s.pdf_d);
            ASSERT_EQ(e.Le_cos, s.Le);
            // Next event from a point in this direction.
            DirectSample direct;
            // Some directions of textures are sampled in vain.
            ASSERT_EQ(light.sample_direct(s.p + s.d * 4, {}, direct), !s.Le.is_zero());
            if (s.Le.is_zero()) continue;
            ASSERT_NEAR(direct.dist, 4, 1e-4);
            EXPECT_EQ(direct.pdf, 1);
        }
        EXPECT_NEAR(flux / kSamples / light.power(), 1, 0.01);
        const auto density = [&](double theta, double phi) {
            const double r = std::sin(theta);
            const Vec3 d{float(r * std::cos(phi)), float(r * std::sin(phi)),
                         float(std::cos(theta))};
            return r * double(light.eval_emission({}, {}, 0, d).pdf_d);
        };
        const testing::Chi2Result result = grid.test(density, 3);
        EXPECT_GT(result.p_value, 1e-3);
        EXPECT_NEAR(result.total_probability, 1, 5e-3);
    }

    static Emitter::Emission along(const Emitter& light, Vec3 d) {
        return light.eval_emission({}, {}, 0, normalize(d));
    }

    SceneDescription scene_;
    NoContext context_;
};

TEST_F(ImageLights, ProjectionShowsTheImageUpright) {
    // Two columns and one row: red on the left, that is -x; the view is 90° high and twice as wide.
    const auto light =
        make(projection_entry(), 2, 1, {Rgb(1, 0, 0), Rgb(0, 1, 0)}, {{"intensity", Rgb(3), {}}});
    EXPECT_EQ(along(*light, {-0.1f, 0, 1}).Le_cos, Rgb(3, 0, 0));
    EXPECT_EQ(along(*light, {1.9f, 0.9f, 1}).Le_cos, Rgb(0, 3, 0));
    for (const Vec3 d : {Vec3{2.1f, 0, 1}, {0, 1.1f, 1}, {0, 0, -1}, {1, 0, 0}}) {
        EXPECT_EQ(along(*light, d).Le_cos, Rgb(0));
        EXPECT_EQ(along(*light, d).pdf_d, 0);
    }
    const auto rows = make(projection_entry(), 1, 2, {Rgb(1), Rgb(2)});
    EXPECT_EQ(along(*rows, {0, 0.5f, 1}).Le_cos, Rgb(1));  // the upper row
}

TEST_F(ImageLights, ProjectionIsSampledByItsImage) {
    const std::vector<Rgb> pixels = {Rgb(1), Rgb(0), Rgb(5), Rgb(0.5f, 0, 2), Rgb(3), Rgb(0.1f)};
    const auto light =
        make(projection_entry(), 3, 2, pixels,
             {{"fov", 100.0, {}}, {"to_world", Transform::rotate({1, 2, 3}, 50), {}}});
    expect_consistent(*light, 24);
    const auto mirrored =
        make(projection_entry(), 3, 2, pixels, {{"to_world", Transform::scale({-2, 2, 2}), {}}});
    expect_consistent(*mirrored, 24);
}

TEST_F(ImageLights, GoniometricIsSampledByItsImage) {
    std::vector<Rgb> pixels;
    for (int i = 0; i < 8 * 8; ++i) pixels.push_back(Rgb(float(i * 7 % 11), 1, float(i % 3)));
    for (const char* projection : {"latlong", "equalarea"}) {
        SCOPED_TRACE(projection);
        const auto light =
            make(goniometric_entry(), 8, 8, pixels,
                 {{"projection", std::string(projection), {}},
                  // The poles of the first one, where its density diverges, are ±z.
                  {"to_world",
                   Transform::rotate({0, 0, 1}, 25) * Transform::rotate({1, 0, 0}, 90),
                   {}}});
        expect_consistent(*light, 24);
    }
}

TEST_F(ImageLights, GoniometricHasTheDirectionsOfItsImage) {
    // Square with the zenith +z in the middle.
    std::vector<Rgb> pixels(9, Rgb(1));
    pixels[4] = Rgb(7);
    const auto light = make(
        goniometric_entry(), 3, 3, pixels,
        {{"projection", std::string("equalarea"), {}},
         {"to_world", Transform::translate({1, 2, 3}) * Transform::rotate({1, 0, 0}, 90), {}}});
    EXPECT_EQ(along(*light, {0, -1, 0}).Le_cos, Rgb(7));
    EXPECT_EQ(along(*light, {0, 1, 0}).Le_cos, Rgb(1));
    EXPECT_EQ(light->sample_emission({}, {0.5f, 0.5f}).p, (Vec3{1, 2, 3}));
    // The upper half of a latitude-longitude image is that of +y.
    const auto up = make(goniometric_entry(), 1, 2, {Rgb(4), Rgb(0)});
    EXPECT_EQ(along(*up, {0, 1, 0}).Le_cos, Rgb(4));
    EXPECT_EQ(along(*up, {0, -1, 0}).Le_cos, Rgb(0));
}

TEST_F(ImageLights, AreScaledToAPower) {
    const std::vector<Rgb> pixels = {Rgb(1), Rgb(2), Rgb(3), Rgb(0)};
    for (const auto& entry : {goniometric_entry(), projection_entry()})
        EXPECT_NEAR(make(entry, 2, 2, pixels, {{"power", 60.0, {}}})->power(), 60, 1e-3);
    const auto white = make(projection_entry(), 1, 1, {Rgb(1)});
    EXPECT_NEAR(white->power(), 4 * M_PI / 6, 1e-5);  // one of the six faces of a cube
}

TEST_F(ImageLights, RefuseWhatTheyCannotDo) {
    const std::vector<Rgb> pixels = {Rgb(0), Rgb(0)};
    EXPECT_THROW(make(projection_entry(), 2, 1, pixels, {{"power", 1.0, {}}}), SceneError);
    EXPECT_THROW(
        make(goniometric_entry(), 2, 1, pixels, {{"projection", std::string("equalarea"), {}}}),
        SceneError);
    EXPECT_THROW(
        make(projection_entry(), 2, 1, pixels, {{"to_world", Transform::scale({1, 2, 1}), {}}}),
        SceneError);
}

// ---- Points with a texture

/// Black on the left, (u, v, 1) on the right.
class RightHalf final : public Texture {
public:
    Rgb eval(const TexturePoint& at) const override {
        return at.uv.x < 0.5f ? Rgb(0) : Rgb(at.uv.x, at.uv.y, 1);
    }
    Rgb mean() const override { return {0.375f, 0.25f, 0.5f}; }
    void resolution(int& width, int& height) const override { width = 40, height = 20; }
};

class TextureLights : public ImageLights {
protected:
    class Context final : public EmitterContext {
    public:
        TextureRef texture(const Params&, std::string_view, Rgb fallback, float) override {
            return is_constant ? TextureRef(fallback) : TextureRef(&texture_);
        }
        const Shape* shape() const override { return nullptr; }
        std::function<float(const TexturePoint&)> opacity() const override { return nullptr; }
        bool is_constant = false;

    private:
        RightHalf texture_;
    };

    std::unique_ptr<Emitter> make(const EmitterEntry& entry, std::vector<Param> params) {
        scene_.objects = {{"emitter", entry.info.name, "", {}, std::move(params), {}}};
        return std::move(entry.make({scene_, 0}, context_).front());
    }
    Context context_;
};

// Irradiance π times the texture on the plane z = 1; like the image of a camera, with +x on the left.
TEST_F(TextureLights, ProjectorLightsAPlaneByItsTexture) {
    const auto light = make(projector_entry(), {{"fov", 90.0, {}}, {"scale", 2.0, {}}});
    for (const Vec2 at : {Vec2{0.1f, 0.2f}, {-0.6f, 0.4f}, {-0.9f, -0.45f}, {0.9f, -0.3f}}) {
        // u from the left edge x = 1, v from the upper edge y = 1/2.
        const Rgb texture = RightHalf().eval({(1 - at.x) / 2, (0.5f - at.y)});
        const Vec3 d{at.x, at.y, 1};
        const float cosine = 1 / length(d);
        const Rgb irradiance = along(*light, d).Le_cos * (cosine * sqr(cosine));
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(irradiance[c], 2 * M_PI * texture[c], 1e-4);
    }
    for (const Vec3 d : {Vec3{1.1f, 0, 1}, {0, 0.6f, 1}, {0, 0, -1}, {1, 0, 0}})
        EXPECT_EQ(along(*light, d).pdf_d, 0);
    EXPECT_NEAR(light->power() / (2 * M_PI * 2 * luminance({0.375f, 0.25f, 0.5f})), 1, 0.01);
}

TEST_F(TextureLights, ProjectorIsSampledByItsTexture) {
    const auto light =
        make(projector_entry(),
             {{"fov", 100.0, {}}, {"to_world", Transform::rotate({1, 2, 3}, 50), {}}});
    expect_consistent(*light, 24);
    // Without a texture, the image is square, and all of it has the same irradiance.
    context_.is_constant = true;
    const auto constant = make(projector_entry(), {{"fov", 60.0, {}}});
    expect_consistent(*constant, 24);
    EXPECT_NEAR(constant->power(), M_PI * 4 / 3, 1e-3);
}

TEST_F(TextureLights, SpotHasTheTextureAcrossItsBeam) {
    const std::vector<Param> params = {
        {"intensity", Rgb(2), {}}, {"cutoff_angle", 45.0, {}}, {"beam_width", 30.0, {}}};
    const auto light = make(spot_entry(), params);
    // The square around the cone is [-1, 1]² at the distance 1.
    for (const Vec2 at : {Vec2{0.3f, -0.2f}, {0.1f, 0.5f}, {0.6f, -0.5f}, {-0.4f, 0}}) {
        const Rgb texture = RightHalf().eval({(1 + at.x) / 2, (1 + at.y) / 2});
        const Vec3 d{at.x, at.y, 1};
        const double angle = std::acos(1 / double(length(d))) * 180 / M_PI,
                     share = std::min((45 - angle) / 15, 1.0);
        const Rgb intensity = along(*light, d).Le_cos;
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(intensity[c], 2 * share * texture[c], 1e-4);
    }
    EXPECT_EQ(along(*light, {0.9f, 0.9f, 1}).Le_cos, Rgb(0));  // in the corner of the square
    expect_consistent(*light, 24);
    // A constant is a factor, and keeps the density of the cone.
    context_.is_constant = true;
    EXPECT_EQ(along(*make(spot_entry(), params), {0, 0, 1}).Le_cos, Rgb(2));
}

TEST_F(TextureLights, RefuseWhatTheyCannotDo) {
    EXPECT_THROW(make(spot_entry(), {{"cutoff_angle", 120.0, {}}}), SceneError);
    EXPECT_THROW(make(spot_entry(), {{"to_world", Transform::scale({1, 2, 1}), {}}}), SceneError);
    EXPECT_THROW(
        make(projector_entry(), {{"fov", 50.0, {}}, {"focal_length", std::string("30mm"), {}}}),
        SceneError);
}

// All points at which the texture is looked at to measure the power may be dark.
TEST(AreaEmitter, CanBeChosenThoughItsTextureIsNearlyBlack) {
    class Needle final : public Texture {
    public:
        Rgb eval(const TexturePoint& at) const override {
            return at.uv.x > 0.4871f && at.uv.x < 0.4873f ? Rgb(1e3f) : Rgb(0);
        }
        Rgb mean() const override { return Rgb(0.2f); }
    } needle;
    const TriangleMesh mesh(
        {.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .triangles = {{0, 1, 2}}});
    const auto emitter = make_area_emitter(mesh, TextureRef(&needle), false, 0);
    EXPECT_GT(emitter->power(), 0);
}

}  // namespace
}  // namespace etendue
