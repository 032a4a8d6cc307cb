// Auxiliary images of what mirrors and clear glass show.

#include "render/aov.h"

#include <gtest/gtest.h>

#include "test_scenes.h"

namespace etendue::test {
namespace {

/// The layers at the middle of the image.
std::vector<Rgb> middle(const Scene& scene, const std::vector<std::string>& names) {
    std::vector<Rgb> values;
    for (const AovImage& a : render_aovs(scene, names, 16, 0, 1))
        values.push_back(a.pixels[scene.film().pixel_count() / 2]);
    return values;
}

void expect_near(Rgb a, Rgb b, float tolerance = 1e-4f) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << i;
}

const std::string kEye = sensor("0,0,3", "0,0,0", 5, "1");
/// At z = 5, behind the camera, facing it.
const std::string kWallBehind =
    rectangle("<scale value=\"9\"/><rotate y=\"1\" angle=\"180\"/><translate z=\"5\"/>",
              diffuse("0.5,0.25,0.8"));
const std::string kWallInFront =
    rectangle("<scale value=\"9\"/><translate z=\"-2\"/>", diffuse("0.5,0.25,0.8"));
const std::string kMirror =
    "<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/><rgb "
    "name=\"specular_reflectance\" value=\"0.5,1,0.5\"/></bsdf>";

TEST(Aov, MirrorsShowWhatTheyReflectInTheirColour) {
    const auto v = middle(build(kEye + kWallBehind + rectangle("", kMirror)),
                          {"denoise_albedo", "denoise_normal", "albedo", "normal", "depth"});
    expect_near(v[0], {0.25f, 0.25f, 0.4f});
    expect_near(v[1], {0, 0, -1});
    // Those of the mirror itself.
    expect_near(v[2], {0.5f, 1, 0.5f});
    expect_near(v[3], {0, 0, 1});
    expect_near(v[4], Rgb(3), 1e-3f);
}

TEST(Aov, GlassShowsWhatIsBehindIt) {
    // A pane of a quarter of a unit, so that paths cross two surfaces. What it reflects is black.
    const std::string glass =
        "<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"2\" "
        "y=\"2\" z=\"0.125\"/></transform><bsdf type=\"dielectric\"/></shape>";
    const std::vector<std::string> names{"denoise_albedo", "denoise_normal"};
    const auto v = middle(build(kEye + kWallInFront + glass), names);
    const float share = v[1].b;
    EXPECT_GT(share, 0.7f);
    EXPECT_LE(share, 1);
    expect_near(v[0], Rgb(0.5f, 0.25f, 0.8f) * share, 1e-3f);
    const auto without = middle(build(kEye + kWallInFront), names);
    expect_near(without[0], {0.5f, 0.25f, 0.8f});
    expect_near(without[1], {0, 0, 1});
}

TEST(Aov, MirrorsOfNothingAreBlack) {
    for (const std::string light : {"", "<emitter type=\"constant\"/>"})
        for (const Rgb value : middle(build(kEye + light + rectangle("", kMirror)),
                                      {"denoise_albedo", "denoise_normal"}))
            EXPECT_TRUE(value.is_zero());
}

/// Whatever the signs of the filter's weights, and at the edges of the image as well.
TEST(Aov, UniformSurfacesHaveNoNoise) {
    for (const char* filter : {"box", "gaussian", "mitchell", "catmullrom", "lanczos"}) {
        const Scene scene = build(with_filter(kEye, filter) + kWallInFront);
        for (const AovImage& a :
             render_aovs(scene, {"albedo", "denoise_albedo", "normal"}, 16, 0, 1))
            for (const Rgb c : a.pixels) {
                SCOPED_TRACE(std::string(filter) + " " + a.name);
                expect_near(c, a.name == "normal" ? Rgb(0, 0, 1) : Rgb(0.5f, 0.25f, 0.8f));
            }
    }
}

/// A coat leaves the colour below it visible.
TEST(Aov, PlasticShowsItself) {
    const std::string plastic = "<bsdf type=\"plastic\"><rgb name=\"diffuse_reflectance\" "
                                "value=\"0.5,0.25,0.8\"/></bsdf>";
    const auto v = middle(build(kEye + kWallBehind + rectangle("", plastic)),
                          {"denoise_albedo", "albedo", "denoise_normal"});
    expect_near(v[0], v[1]);
    expect_near(v[2], {0, 0, 1});
}

}  // namespace
}  // namespace etendue::test
