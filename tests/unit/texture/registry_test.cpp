// Texture plug-ins made from scene descriptions.

#include <filesystem>
#include <fstream>
#include <limits>

#include <gtest/gtest.h>

#include "image/image_io.h"
#include "texture/bitmap.h"
#include "texture/texture_cache.h"

namespace etendue {
namespace {

/// The part of the scene builder that textures need.
class Builder final : public TextureContext {
public:
    explicit Builder(const SceneDescription& scene) : scene_(scene) {}

    TextureRef texture(const Params& params, std::string_view name, Rgb fallback, float) override {
        const auto* child = params.child(name);
        return child ? TextureRef(build(child->object)) : TextureRef(params.rgb(name, fallback));
    }
    TextureCache& images() override { return images_; }

    const Texture* build(int object) {
        const Params params(scene_, object);
        for (const TextureEntry& e : texture_registry())
            if (params.object().type == e.info.name) {
                check_params(scene_, object, e.info,
                             [](const SourceLocation& where, const std::string& message) {
                                 throw SceneError(where, message);
                             });
                made_.push_back(e.make(params, *this));
                return made_.back().get();
            }
        params.fail("no such texture");
    }

private:
    const SceneDescription& scene_;
    TextureCache images_;
    std::vector<std::unique_ptr<Texture>> made_;
};

SceneObject object(const std::string& type,
                   std::vector<std::pair<std::string, ParamValue>> params) {
    SceneObject o;
    o.category = "texture";
    o.type = type;
    for (auto& [name, value] : params) o.params.push_back({name, value, {"scene.xml", 7}});
    return o;
}

class TextureRegistry : public testing::Test {
protected:
    void SetUp() override {
        const auto* test = testing::UnitTest::GetInstance()->current_test_info();
        folder_ = std::filesystem::path(testing::TempDir()) /
                  (std::string("etendue-texture-") + test->name());
        std::filesystem::create_directories(folder_);
        scene_.search_paths = {(folder_ / "elsewhere").string(), folder_.string()};
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    const Texture& build(SceneObject root) {
        scene_.objects.insert(scene_.objects.begin(), std::move(root));
        return *builder_.build(0);
    }
    /// The message of the error for an object; "" without one.
    std::string error(SceneObject root) {
        try {
            build(std::move(root));
        } catch (const SceneError& e) {
            return e.what();
        }
        return "";
    }
    void write(const std::string& name, std::initializer_list<Rgb> row) {
        write_image((folder_ / name).string(),
                    rgb_image(int(row.size()), 1, std::vector<Rgb>(row)));
    }

    std::filesystem::path folder_;
    SceneDescription scene_;
    Builder builder_{scene_};
};

TEST_F(TextureRegistry, CheckerboardHasMitsubasSquares) {
    const Texture& t =
        build(object("checkerboard", {{"color0", Rgb(1, 0, 0)}, {"color1", Rgb(0, 0, 1)}}));
    const Vec2 first[] = {
        {0.2f, 0.2f}, {0.7f, 0.7f}, {1.2f, 0.2f}, {-0.2f, -0.2f}, {2.2f, -0.7f}, {0.5f, 0.2f}, {}};
    const Vec2 second[] = {{0.7f, 0.2f}, {0.2f, 0.7f}, {-0.2f, 0.2f}};
    for (const Vec2 uv : first) EXPECT_EQ(t.eval(uv), Rgb(1, 0, 0)) << uv.x << ", " << uv.y;
    for (const Vec2 uv : second) EXPECT_EQ(t.eval(uv), Rgb(0, 0, 1)) << uv.x << ", " << uv.y;
    EXPECT_EQ(t.mean(), Rgb(0.5f, 0, 0.5f));
}

TEST_F(TextureRegistry, CheckerboardDefaultsAndToUv) {
    // mi.load_dict({"type": "checkerboard", "to_uv": translate(0.25, 0, 0) @ scale(2, 1, 1)}).eval at (0.3, 0.2)
    const Transform to_uv = Transform::translate({0.25f, 0, 0}) * Transform::scale({2, 1, 1});
    const Texture& t = build(object("checkerboard", {{"to_uv", to_uv}}));
    EXPECT_FLOAT_EQ(t.eval_scalar({0.3f, 0.2f}), 0.2f);
    EXPECT_FLOAT_EQ(t.eval_scalar({0.1f, 0.2f}), 0.4f);
    int width, height;
    t.resolution(width, height);
    EXPECT_EQ(width, 4);
    EXPECT_EQ(height, 2);
}

TEST_F(TextureRegistry, CheckerboardHoldsTextures) {
    write("ramp.exr", {Rgb(0), Rgb(1, 2, 3)});
    SceneObject board = object("checkerboard", {{"color1", 0.5}});
    board.children.push_back({"color0", 1, {}});
    scene_.objects.push_back(object("bitmap", {{"filename", std::string("ramp.exr")}}));
    const Texture& t = build(board);
    EXPECT_FLOAT_EQ(t.eval({0.4f, 0.1f}).b, 0.9f);  // at 0.4 · 2 − 0.5 = 0.3 between the texels
    EXPECT_EQ(t.eval({0.6f, 0.1f}), Rgb(0.5f));
    EXPECT_NEAR(t.gradient({0.4f, 0.1f}).x, 2 * luminance({1, 2, 3}), 1e-5);
    EXPECT_EQ(t.gradient({0.6f, 0.1f}), Vec2());
    EXPECT_NEAR(t.mean().g, 0.75f, 1e-6);
}

TEST_F(TextureRegistry, ScaleMultiplies) {
    write("ramp.exr", {Rgb(0), Rgb(1, 2, 3)});
    for (const ParamValue& factor : {ParamValue(0.5), ParamValue(Rgb(0.5f, 0.25f, 1))}) {
        scene_.objects.clear();
        scene_.objects.push_back(object("bitmap", {{"filename", std::string("ramp.exr")}}));
        SceneObject scale = object("scale", {{"scale", factor}});
        scale.children.push_back({"", 1, {}});
        const Texture& t = build(scale);
        const Rgb f = factor.index() == 5 ? Rgb(0.5f, 0.25f, 1) : Rgb(0.5f);
        EXPECT_NEAR(t.eval({0.75f, 0.5f}).g, 2 * f.g, 1e-6);
        EXPECT_NEAR(t.gradient({0.4f, 0.1f}).x, 2 * luminance(Rgb(1, 2, 3) * f), 1e-4);
        EXPECT_NEAR(t.mean().b, 1.5f * f.b, 1e-6);
        // Exact beside a texel's centre too where the factor is grey.
        if (f.r == f.g) {
            EXPECT_NEAR(t.gradient({0.26f, 0.1f}).x, 2 * luminance(Rgb(1, 2, 3) * f), 1e-4);
        }
    }
    scene_.objects.clear();
    EXPECT_NE(error(object("scale", {})).find("needs a texture"), std::string::npos);
}

TEST_F(TextureRegistry, BitmapTakesItsParameters) {
    write("ramp.png", {Rgb(0), Rgb(0.5f, 0.5f, 0.5f)});
    const Texture& srgb = build(object("bitmap", {{"filename", std::string("ramp.png")},
                                                  {"filter_type", std::string("nearest")},
                                                  {"wrap_mode", std::string("clamp")}}));
    EXPECT_NEAR(srgb.eval_scalar({7, 0}), 0.5f, 3e-3);
    const Texture& raw =
        build(object("bitmap", {{"filename", (folder_ / "ramp.png").string()}, {"raw", true}}));
    EXPECT_NEAR(raw.eval_scalar({0.75f, 0}), 188 / 255.0f, 1e-6);
}

TEST_F(TextureRegistry, MissingFilesAreExplained) {
    write("leaves.png", {Rgb(0)});
    const std::string message = error(object("bitmap", {{"filename", std::string("leafs.png")}}));
    EXPECT_NE(message.find("scene.xml:7: there is no file \"leafs.png\""), std::string::npos)
        << message;
    EXPECT_NE(message.find((folder_ / "elsewhere").string()), std::string::npos) << message;
    EXPECT_NE(message.find("did you mean \"leaves.png\""), std::string::npos) << message;
    EXPECT_NE(error(object("bitmap", {})).find("needs the parameter \"filename\""),
              std::string::npos);
}

TEST_F(TextureRegistry, BadImagesAreExplained) {
    std::ofstream(folder_ / "broken.png") << "this is not a picture";
    std::string message = error(object("bitmap", {{"filename", std::string("broken.png")}}));
    EXPECT_NE(message.find("scene.xml:7"), std::string::npos) << message;
    EXPECT_NE(message.find("broken.png"), std::string::npos) << message;
    write("nan.exr", {Rgb(std::numeric_limits<float>::quiet_NaN()), Rgb(1)});
    message = error(object("bitmap", {{"filename", std::string("nan.exr")}}));
    EXPECT_NE(message.find("3 values that are infinite or NaN"), std::string::npos) << message;
    write("opaque.png", {Rgb(1)});
    message = error(
        object("bitmap", {{"filename", std::string("opaque.png")}, {"channel", std::string("a")}}));
    EXPECT_NE(message.find("has no alpha"), std::string::npos) << message;
}

TEST_F(TextureRegistry, NegativeColoursCountAsZeroUnlessRaw) {
    write("negative.exr", {Rgb(-1, 2, -3)});
    EXPECT_EQ(build(object("bitmap", {{"filename", std::string("negative.exr")}})).eval({0, 0}),
              Rgb(0, 2, 0));
    EXPECT_EQ(build(object("bitmap", {{"filename", std::string("negative.exr")}, {"raw", true}}))
                  .eval({0, 0}),
              Rgb(-1, 2, -3));
}

TEST(TextureCache, LoadsEachImageOnce) {
    const std::string path = testing::TempDir() + "/etendue-cached.png";
    write_image(path, rgb_image(2, 1, std::vector<Rgb>{Rgb(0), Rgb(1)}));
    TextureCache cache;
    const PixelBuffer& first = cache.load(path, false);
    EXPECT_EQ(&first, &cache.load(testing::TempDir() + "/./etendue-cached.png", false));
    EXPECT_EQ(cache.memory_bytes(), 6u);
    EXPECT_NE(&first, &cache.load(path, true));
    EXPECT_THROW(cache.load(path + "no", false), std::runtime_error);
    EXPECT_EQ(cache.memory_bytes(), 12u);
    std::filesystem::remove(path);
}

/// Names of images that a scene file holds are for messages.
TEST(TextureCache, ImagesOfOneNameAreSeveral) {
    const EncodedImage black{"image", "P5 1 1 255\n" + std::string(1, '\0')},
        white{"image", "P5 1 1 255\n\xff"};
    TextureCache cache;
    const PixelBuffer& first = cache.decode(black, false);
    EXPECT_EQ(&first, &cache.decode(black, false));
    EXPECT_EQ(std::get<std::vector<uint8_t>>(first.data)[0], 0);
    EXPECT_EQ(std::get<std::vector<uint8_t>>(cache.decode(white, false).data)[0], 255);
}

TEST(TextureRef, ScalarOfAConstantIsItsLuminance) {
    const Rgb colour(0.9f, 0.2f, 0.4f);
    EXPECT_EQ(TextureRef(colour).eval_scalar({}), luminance(colour));
    EXPECT_EQ(TextureRef(Rgb(0.3f)).eval_scalar({}), 0.3f);
}

TEST(TextureDefaults, GradientIsByCentralDifferences) {
    struct Quadratic final : Texture {
        Rgb eval(const TexturePoint& at) const override {
            return Rgb(at.uv.x * at.uv.x + 3 * at.uv.y);
        }
        Rgb mean() const override { return Rgb(11.0f / 6); }
    };
    const Vec2 g = Quadratic().gradient({0.5f, 0.25f});
    EXPECT_NEAR(g.x, 1, 1e-4);
    EXPECT_NEAR(g.y, 3, 1e-4);
}

TEST_F(TextureRegistry, MixTakesItsWeightFromTheSecond) {
    const Texture& mix = build(object(
        "mix", {{"value0", Rgb(1, 0, 0)}, {"value1", Rgb(0, 1, 0)}, {"weight", Rgb(0.25f)}}));
    EXPECT_EQ(mix.eval({0.3f, 0.7f}), Rgb(0.75f, 0.25f, 0));
    EXPECT_EQ(mix.mean(), Rgb(0.75f, 0.25f, 0));
}

TEST_F(TextureRegistry, SpecularColoursBecomeMetal) {
    const auto make = [&](const char* output) -> const Texture& {
        return build(object("specular_to_metallic", {{"diffuse", Rgb(0.4f, 0.2f, 0)},
                                                     {"specular", Rgb(0.02f)},
                                                     {"output", std::string(output)}}));
    };
    EXPECT_EQ(make("metallic").eval_scalar({}), 0);
    EXPECT_FLOAT_EQ(make("specular_weight").eval_scalar({}), 0.5f);
    EXPECT_NEAR(make("base_color").eval({}).g, 0.2f, 1e-6);
    EXPECT_EQ(make("base_color").mean(), make("base_color").eval({}));
    EXPECT_EQ(build(object("specular_to_metallic", {{"output", std::string("metallic")}}))
                  .eval_scalar({}),
              1);
}

TEST_F(TextureRegistry, SheenBecomesFuzz) {
    const auto make = [&](Rgb color, const char* output) -> const Texture& {
        return build(object("sheen_to_fuzz", {{"color", color}, {"output", std::string(output)}}));
    };
    const Rgb sheen(0.2f, 0.4f, 0.1f);
    EXPECT_EQ(make(sheen, "fuzz_weight").eval_scalar({}), 0.4f);
    EXPECT_EQ(make(sheen, "fuzz_color").eval({}), Rgb(0.5f, 1, 0.25f));
    EXPECT_EQ(make(sheen, "fuzz_color").mean(), Rgb(0.5f, 1, 0.25f));
    // Without sheen, any colour will do.
    EXPECT_EQ(make(Rgb(0), "fuzz_weight").eval_scalar({}), 0);
    EXPECT_EQ(make(Rgb(0), "fuzz_color").eval({}), Rgb(1));
}

TEST_F(TextureRegistry, BilerpMeetsItsCorners) {
    const Texture& t = build(object("bilerp", {{"v00", Rgb(1, 0, 0)},
                                               {"v01", Rgb(0, 1, 0)},
                                               {"v10", Rgb(0, 0, 1)},
                                               {"v11", Rgb(1, 1, 1)}}));
    EXPECT_EQ(t.eval({0, 0}), Rgb(1, 0, 0));
    EXPECT_EQ(t.eval({0, 1}), Rgb(0, 1, 0));
    EXPECT_EQ(t.eval({1, 0}), Rgb(0, 0, 1));
    EXPECT_EQ(t.eval({0.5f, 0.5f}), Rgb(0.5f));
}

TEST_F(TextureRegistry, RoughnessBecomesAlphaAsInItsVersionOfPbrt) {
    EXPECT_FLOAT_EQ(
        build(object("roughness_to_alpha", {{"roughness", Rgb(0.04f)}})).eval_scalar({}), 0.2f);
    // The polynomial of pbrt-v3 at 0.1.
    EXPECT_NEAR(build(object("roughness_to_alpha",
                             {{"roughness", Rgb(0.1f)}, {"curve", std::string("pbrt3")}}))
                    .eval_scalar({}),
                0.46176f, 1e-4);
}

}  // namespace
}  // namespace etendue
