// Noise and the textures made of it, against their formulas.

#include <cmath>

#include <gtest/gtest.h>

#include "random.h"
#include "texture/noise.h"
#include "texture/texture.h"

namespace etendue {
namespace {

/// Gradient of the noise at a point of the lattice.
Vec3 lattice_gradient(Vec3 p) {
    constexpr float h = 1 / 1024.0f;
    return Vec3{noise(p + Vec3{h, 0, 0}), noise(p + Vec3{0, h, 0}), noise(p + Vec3{0, 0, h})} *
           (1 / h);
}

TEST(Noise, HasOneOfTwelveGradientsAtPointsOfTheLattice) {
    testing::Random random(1);
    Vec3 sum;
    for (int i = 0; i < 200; ++i) {
        const Vec3 p{std::floor(random.next_1d() * 200 - 100),
                     std::floor(random.next_1d() * 200 - 100),
                     std::floor(random.next_1d() * 200 - 100)};
        EXPECT_EQ(noise(p), 0);
        const Vec3 g = lattice_gradient(p);
        for (const float c : {g.x, g.y, g.z})
            EXPECT_NEAR(std::fabs(c), std::round(std::fabs(c)), 0.01);
        EXPECT_NEAR(length2(g), 2, 0.05);
        sum = sum + g;
    }
    for (const float c : {sum.x, sum.y, sum.z})
        EXPECT_LT(std::fabs(c), 4 * std::sqrt(200 * 2 / 3.0));
}

TEST(Noise, InterpolatesTheCornersOfACell) {
    // 6t⁵ - 15t⁴ + 10t³ at 1/2 is 1/2, at 1/4 it is 53/512.
    for (const auto& [t, fade] : {std::pair(0.5f, 0.5f), {0.25f, 53 / 512.0f}}) {
        const Vec3 cell{3, -7, 12}, within{t, 0.5f, 0.5f};
        double expected = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3 o{float(corner & 1), float(corner >> 1 & 1), float(corner >> 2)};
            const Vec3 d = within - o;
            expected += 0.25 * double(o.x == 1 ? fade : 1 - fade) *
                        double(dot(lattice_gradient(cell + o), d));
        }
        EXPECT_NEAR(noise(cell + within), expected, 2e-3);
    }
}

TEST(Noise, IsContinuousAndHasAPeriod) {
    testing::Random random(2);
    double sum = 0, squares = 0;
    constexpr int kPoints = 20000;
    for (int i = 0; i < kPoints; ++i) {
        const Vec3 p{random.next_1d() * 50, random.next_1d() * 50, random.next_1d() * 50};
        const float n = noise(p);
        sum += double(n);
        squares += double(n * n);
        ASSERT_LE(std::fabs(n), 1.05f);
        const Vec3 edge{std::floor(p.x), p.y, p.z};
        EXPECT_NEAR(noise(edge - Vec3{1e-5f, 0, 0}), noise(edge), 2e-4);
    }
    EXPECT_NEAR(sum / kPoints, 0, 0.02);
    EXPECT_NEAR(std::sqrt(squares / kPoints), 0.27, 0.04);
    EXPECT_NEAR(noise({1.25f + 256, 2.5f - 512, 3.75f}), noise({1.25f, 2.5f, 3.75f}), 1e-5);
    for (const float huge : {1e20f, -3e38f, kInf}) EXPECT_TRUE(std::isfinite(noise({huge, 1, 2})));
}

TEST(Noise, OctavesAreSummed) {
    const Vec3 p{0.3f, 1.7f, -2.2f};
    const float a = noise(p), b = noise(p * 1.99f), c = noise(p * (1.99f * 1.99f));
    EXPECT_NEAR(fbm(p, 0.6f, 3), a + 0.6f * b + 0.36f * c, 1e-5);
    EXPECT_NEAR(turbulence(p, 0.6f, 3),
                std::fabs(a) + 0.6f * std::fabs(b) + 0.36f * std::fabs(c) + 0.2f * 0.216f, 1e-5);
}

/// Textures without images.
class Context final : public TextureContext {
public:
    explicit Context(const SceneDescription& scene) : scene_(scene) {}
    TextureRef texture(const Params& params, std::string_view name, Rgb fallback, float) override {
        const auto* child = params.child(name);
        return child ? TextureRef(build(child->object)) : TextureRef(params.rgb(name, fallback));
    }
    TextureCache& images() override { throw std::runtime_error("no images"); }
    const Texture* build(int object) {
        const Params params(scene_, object);
        for (const TextureEntry& e : texture_registry())
            if (params.object().type == e.info.name) {
                made_.push_back(e.make(params, *this));
                return made_.back().get();
            }
        params.fail("no such texture");
    }

private:
    const SceneDescription& scene_;
    std::vector<std::unique_ptr<Texture>> made_;
};

class SolidTextures : public ::testing::Test {
protected:
    const Texture& make(const std::string& type,
                        std::vector<std::pair<std::string, ParamValue>> params,
                        std::vector<SceneObject::Child> children = {}) {
        SceneObject o;
        o.category = "texture";
        o.type = type;
        for (auto& [name, value] : params) o.params.push_back({name, value, {}});
        o.children = std::move(children);
        scene_.objects.push_back(o);
        return *context_.build(int(scene_.objects.size()) - 1);
    }
    static TexturePoint at(Vec3 p) { return {{}, {1, 1, 1}, p}; }

    SceneDescription scene_;
    Context context_{scene_};
};

TEST_F(SolidTextures, CheckerboardOfCubes) {
    const Transform half = Transform::scale({2, 2, 2});
    const Texture& plain = make("checkerboard3d", {});
    const Texture& fine = make("checkerboard3d", {{"color1", Rgb(0.2f)}, {"to_texture", half}});
    EXPECT_EQ(plain.eval(at({0.5f, 0.5f, 0.5f})), Rgb(1));
    EXPECT_EQ(plain.eval(at({1.5f, 0.5f, 0.5f})), Rgb(0));
    EXPECT_EQ(plain.eval(at({-0.5f, 0.5f, 0.5f})), Rgb(0));
    EXPECT_EQ(plain.eval(at({-0.5f, 0.5f, -0.5f})), Rgb(1));
    EXPECT_EQ(plain.eval(at({-0.5f, -1.5f, -2.5f})), Rgb(1));
    EXPECT_EQ(fine.eval(at({0.6f, 0.2f, 0.2f})), Rgb(0.2f));
    EXPECT_EQ(fine.eval(at({0.6f, 0.6f, 0.2f})), Rgb(1));
}

TEST_F(SolidTextures, SumsOfNoise) {
    const Transform to_texture = Transform::translate({1, 2, 3}) * Transform::scale({2, 3, 4});
    const std::pair<std::string, ParamValue> space = {"to_texture", to_texture};
    const Texture& f = make("fbm", {space, {"octaves", int64_t{3}}, {"roughness", 0.7}});
    const Texture& wrinkled = make("wrinkled", {space});
    const Texture& windy = make("windy", {space});
    testing::Random random(3);
    bool is_negative = false;
    for (int i = 0; i < 100; ++i) {
        const Vec3 p{random.next_1d() * 9, random.next_1d() * 9, random.next_1d() * 9};
        const Vec3 q = to_texture.point(p);
        const float value = f.eval_scalar(at(p));
        EXPECT_FLOAT_EQ(value, fbm(q, 0.7f, 3));
        EXPECT_EQ(f.eval(at(p)), Rgb(clamp(value, 0, 1)));
        is_negative |= value < 0;
        EXPECT_FLOAT_EQ(wrinkled.eval_scalar(at(p)), turbulence(q, 0.5f, 8));
        EXPECT_FLOAT_EQ(windy.eval_scalar(at(p)),
                        std::fabs(fbm(q * 0.1f, 0.5f, 3)) * fbm(q, 0.5f, 6));
    }
    EXPECT_TRUE(is_negative);
}

TEST_F(SolidTextures, MarbleIsASpline) {
    const Texture& marble = make("marble", {{"variation", 0.0}, {"scale", 2.0}});
    const auto red = [&](double phase) { return marble.eval(at({5, float(phase / 2), -3})).r; };
    EXPECT_NEAR(red(M_PI / 2), 1.5 * 0.58, 1e-4);
    EXPECT_NEAR(red(-M_PI / 2), 1.5 * 0.58, 1e-4);
    EXPECT_NEAR(red(0), 1.5 * 0.5, 1e-4);  // t = 1/2: start of the fourth segment
    EXPECT_NEAR(red(M_PI / 6), 1.5 * (0.6 + 6 * 0.58 + 0.2) / 8, 1e-4);  // t = 3/4
    // The noise shifts the phase.
    const Texture& veined = make("marble", {{"variation", 3.0}});
    const Vec3 p{0.4f, 0.3f, 0.2f};
    EXPECT_EQ(veined.eval(at(p)),
              make("marble", {{"variation", 0.0}}).eval(at({0, p.y + 3 * fbm(p, 0.5f, 8), 0})));
}

TEST_F(SolidTextures, DotsLieInTheirCells) {
    const Texture& dots = make("dots", {});
    testing::Random random(4);
    double covered = 0;
    constexpr int kPoints = 40000;
    for (int i = 0; i < kPoints; ++i) {
        const Vec2 uv{random.next_1d() * 100, random.next_1d() * 100};
        const float s = std::floor(uv.x + 0.5f), t = std::floor(uv.y + 0.5f);
        const Vec2 centre{s + 0.15f * noise(s + 1.5f, t + 2.8f),
                          t + 0.15f * noise(s + 4.5f, t + 9.8f)};
        const bool inside =
            noise(s + 0.5f, t + 0.5f) > 0 && std::hypot(uv.x - centre.x, uv.y - centre.y) < 0.35f;
        ASSERT_EQ(dots.eval(uv), Rgb(inside ? 1 : 0));
        covered += inside;
    }
    EXPECT_NEAR(covered / kPoints, double(dots.mean().g), 0.02);
}

TEST_F(SolidTextures, HeightsSlopeAlongTheTangents) {
    const Texture& f = make("fbm", {{"octaves", int64_t{2}}});
    const Texture& scaled = make("scale", {{"scale", 0.1}}, {{"value", 0, {}}});
    const Vec3 p{0.35f, 0.6f, 0.8f}, dpdu{2, 0, 1}, dpdv{0, -3, 0};
    const TexturePoint point({0.1f, 0.2f}, {1, 1, 1}, p, dpdu, dpdv);
    constexpr float h = 1e-2f;
    const auto slope = [&](Vec3 d) {
        return (fbm(p + d * h, 0.5f, 2) - fbm(p - d * h, 0.5f, 2)) / (2 * h);
    };
    EXPECT_NEAR(f.gradient(point).x, slope(dpdu), 0.02);
    EXPECT_NEAR(f.gradient(point).y, slope(dpdv), 0.02);
    EXPECT_NEAR(scaled.gradient(point).x, 0.1f * f.gradient(point).x, 1e-5);
    EXPECT_FLOAT_EQ(scaled.eval_scalar(at({0.3f, 0.2f, 9})),
                    0.1f * f.eval_scalar(at({0.3f, 0.2f, 9})));
}

}  // namespace
}  // namespace etendue
