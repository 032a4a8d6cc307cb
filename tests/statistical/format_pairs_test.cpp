// The same scene in two formats gives the same image. The Mitsuba XML beside each scene of pbrt or glTF is written from
// the documents of the formats, so a convention that a reader gets wrong makes the images differ. Both are rendered with
// the same random numbers and differ by rounding alone.

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "readers/gltf.h"
#include "readers/mitsuba_writer.h"
#include "readers/mitsuba_xml.h"
#include "readers/pbrt.h"
#include "readers/scene_file.h"
#include "render/renderer.h"
#include "render_tiles.h"
#include "run_program.h"
#include "scene/builder.h"
#include "shared_scenes.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 24, kHeight = 16;

/// A file beside the scenes of tests/scenes/formats, from where "../data" is what they share.
std::string file_in_formats(const char* name) {
    return (fs::path(ETENDUE_SOURCE_DIR) / "tests/scenes/formats/mitsuba3" / name).string();
}

std::vector<Rgb> image_of(const SceneDescription& description, const std::string& integrator,
                          const BuildOptions& options) {
    const Scene scene = build_scene(description, options);
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.threads = 1;
    settings.spp = 16;
    settings.seed = 5;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    EXPECT_EQ(renderer.stats().rejected, 0u);
    return renderer.film().image();
}

/// Rounding may send a path elsewhere: one pixel in fifty may differ by more than 0.1 %.
void expect_same_images(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    ASSERT_EQ(a.size(), b.size());
    size_t different = 0;
    double sum_a[3] = {}, sum_b[3] = {};
    for (size_t i = 0; i < a.size(); ++i) {
        bool differs = false;
        for (int c = 0; c < 3; ++c) {
            const float size = std::fabs(a[i][c]) + std::fabs(b[i][c]);
            differs |= std::fabs(a[i][c] - b[i][c]) > 5e-4f * size + 1e-5f;
            sum_a[c] += double(a[i][c]);
            sum_b[c] += double(b[i][c]);
        }
        different += differs;
    }
    EXPECT_LE(different, a.size() / 50) << "of " << a.size() << " pixels";
    for (int c = 0; c < 3; ++c) {
        EXPECT_GT(sum_a[c], 0) << "channel " << c;
        EXPECT_NEAR(sum_b[c], sum_a[c], 2e-3 * sum_a[c]) << "channel " << c;
    }
}

void expect_same_images(const SceneDescription& a, const SceneDescription& b,
                        const std::string& integrator, const BuildOptions& options = {}) {
    expect_same_images(image_of(a, integrator, options), image_of(b, integrator, options));
}

SceneDescription mitsuba(const std::string& body) {
    return parse_mitsuba_xml("<scene version=\"3.0.0\">" + body + "</scene>",
                             file_in_formats("pair.xml"));
}

/// A film of the size that all pairs have.
std::string mitsuba_film(const std::string& extra = "<rfilter type=\"box\"/>") {
    return fmt::format("<film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/><integer "
                       "name=\"height\" value=\"{}\"/>{}</film>",
                       kWidth, kHeight, extra);
}

// ---- pbrt

/// A part of a scene in both languages; the other parts have the same defaults.
struct Pair {
    const char* name;
    int version;  ///< Of pbrt.
    const char *pbrt, *mitsuba;
};

/// Prints its name alone.
void PrintTo(const Pair& pair, std::ostream* out) {
    *out << pair.name;
}

const char* const kPbrtCamera = "Camera \"perspective\" \"float fov\" 40\n";
// The world of pbrt is left-handed: its x axis points to the left of a camera that looks along -z.
const char* const kMitsubaLookAt =
    "<scale x=\"-1\"/><lookat origin=\"1,2,6\" target=\"0,0,0\" up=\"0,1,0\"/>";
const std::string kMitsubaCamera =
    std::string("<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/>"
                "<string name=\"fov_axis\" value=\"smaller\"/><transform name=\"to_world\">") +
    kMitsubaLookAt + "</transform>";

const char* const kPbrtLights = R"(
LightSource "infinite" "rgb L" [.4 .5 .6]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [12 10 8]
  Translate -2 3 2
  Shape "sphere" "float radius" .4
AttributeEnd
)";
const char* const kMitsubaLights = R"(
<emitter type="constant"><rgb name="radiance" value=".4 .5 .6"/></emitter>
<shape type="sphere"><point name="center" value="-2 3 2"/><float name="radius" value=".4"/>
  <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf></bsdf>
  <emitter type="area"><rgb name="radiance" value="12 10 8"/></emitter></shape>
)";

/// A grey floor.
const char* const kPbrtFloor = R"(
AttributeBegin
  Translate 0 -1 0  Rotate -90 1 0 0  Scale 4 4 4
  Shape "plymesh" "string filename" "../data/patch.ply"
AttributeEnd
)";
const char* const kMitsubaFloor = R"(
<shape type="ply"><string name="filename" value="../data/patch.ply"/>
  <transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/><translate y="-1"/></transform>
  <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf></bsdf></shape>
)";

SceneDescription pbrt(int version, const std::string& options, const std::string& world) {
    const std::string text =
        fmt::format("LookAt 1 2 6  0 0 0  0 1 0\nFilm \"{}\" \"integer xresolution\" {} "
                    "\"integer yresolution\" {}\nPixelFilter \"box\"\nIntegrator \"path\"\n{}\n"
                    "WorldBegin\n{}\n{}",
                    version == 3 ? "image" : "rgb", kWidth, kHeight, options, world,
                    version == 3 ? "WorldEnd\n" : "");
    SceneDescription scene = parse_pbrt(text, file_in_formats("pair.pbrt"));
    EXPECT_TRUE(scene.warnings.empty()) << scene.warnings[0];
    return scene;
}

class PairsOf : public ::testing::TestWithParam<Pair> {};
std::string name_of(const ::testing::TestParamInfo<Pair>& info) {
    return info.param.name;
}

/// A ball and an upright square with the material.
class PbrtMaterials : public PairsOf {};
TEST_P(PbrtMaterials, HaveTheImageOfTheirTranslation) {
    const SceneDescription a = pbrt(GetParam().version, kPbrtCamera,
                                    std::string(kPbrtLights) + kPbrtFloor + GetParam().pbrt + R"(
AttributeBegin
  Translate -1.2 0 0
  Shape "sphere" "float radius" .9
AttributeEnd
AttributeBegin
  Translate 1.2 0 .5
  Shape "plymesh" "string filename" "../data/patch.ply"
AttributeEnd)");
    const SceneDescription b =
        mitsuba(kMitsubaCamera + mitsuba_film() + "</sensor>" + kMitsubaLights + kMitsubaFloor +
                std::string("<bsdf id=\"m\" ") + GetParam().mitsuba + "</bsdf>" + R"(
<shape type="sphere"><point name="center" value="-1.2 0 0"/><float name="radius" value=".9"/><ref id="m"/></shape>
<shape type="ply"><string name="filename" value="../data/patch.ply"/>
  <transform name="to_world"><translate x="1.2" z=".5"/></transform><ref id="m"/></shape>)");
    expect_same_images(a, b, "bdpt");
}

// α of pbrt-v4 is the root of the roughness, of v3 a polynomial in its logarithm.
const Pair kPbrtMaterials[] = {
    {"Diffuse4", 4, R"(Material "diffuse" "rgb reflectance" [.6 .3 .2])",
     R"(type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".6 .3 .2"/></bsdf>)"},
    {"DiffuseIsHalfGrey4", 4, R"(Material "diffuse")",
     R"(type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf>)"},
    {"CoatedDiffuse4", 4,
     R"(Material "coateddiffuse" "rgb reflectance" [.1 .3 .6] "float eta" 1.4 "float thickness" 0)",
     R"(type="twosided"><bsdf type="plastic"><rgb name="diffuse_reflectance" value=".1 .3 .6"/>
        <float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/>
        <boolean name="nonlinear" value="true"/></bsdf>)"},
    {"RoughCoatedDiffuse4", 4,
     R"(Material "coateddiffuse" "rgb reflectance" [.1 .3 .6] "float roughness" .04 "float thickness" 0)",
     R"(type="twosided"><bsdf type="roughplastic"><rgb name="diffuse_reflectance" value=".1 .3 .6"/>
        <float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/><float name="alpha" value=".2"/>
        <string name="distribution" value="ggx"/><boolean name="nonlinear" value="true"/></bsdf>)"},
    {"NamedConductor4", 4,
     R"(Material "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k")",
     R"(type="twosided"><bsdf type="conductor"><string name="material" value="Au"/></bsdf>)"},
    {"RoughConductor4", 4,
     R"(Material "conductor" "spectrum eta" "metal-Ag-eta" "spectrum k" "metal-Ag-k"
        "float uroughness" .01 "float vroughness" .09)",
     R"(type="twosided"><bsdf type="roughconductor"><string name="material" value="Ag"/>
        <string name="distribution" value="ggx"/><float name="alpha_u" value=".1"/>
        <float name="alpha_v" value=".3"/></bsdf>)"},
    {"ConductorOfIndices4", 4,
     R"(Material "conductor" "rgb eta" [1.6 .9 .5] "rgb k" [8.5 6.9 5.2] "float roughness" .3
        "bool remaproughness" false)",
     R"(type="twosided"><bsdf type="roughconductor"><rgb name="eta" value="1.6 .9 .5"/>
        <rgb name="k" value="8.5 6.9 5.2"/><string name="distribution" value="ggx"/>
        <float name="alpha" value=".3"/></bsdf>)"},
    // With η = 1, k²/(4 + k²) is the reflectance at normal incidence: k = 4 for 0.8, and so on.
    {"ConductorOfAReflectance4", 4, R"(Material "conductor" "rgb reflectance" [.8 .5 .2])",
     R"(type="twosided"><bsdf type="conductor"><rgb name="eta" value="1 1 1"/>
        <rgb name="k" value="4 2 1"/></bsdf>)"},
    {"Dielectric4", 4, R"(Material "dielectric" "float eta" 1.4)",
     R"(type="dielectric"><float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/>)"},
    {"RoughDielectric4", 4, R"(Material "dielectric" "float roughness" .09)",
     R"(type="roughdielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>
        <string name="distribution" value="ggx"/><float name="alpha" value=".3"/>)"},
    {"ThinDielectric4", 4, R"(Material "thindielectric" "float eta" 1.4)",
     R"(type="thindielectric"><float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/>)"},
    {"Interface4", 4, R"(Material "interface")", R"(type="null">)"},
    {"Mix4", 4,
     R"(MakeNamedMaterial "red" "string type" "diffuse" "rgb reflectance" [.7 .1 .1]
        MakeNamedMaterial "mirror" "string type" "conductor" "rgb reflectance" [.5 .5 .5]
        Material "mix" "string materials" ["red" "mirror"] "float amount" .3)",
     R"(type="blendbsdf"><float name="weight" value=".3"/>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".7 .1 .1"/></bsdf></bsdf>
        <bsdf type="twosided"><bsdf type="conductor"><rgb name="eta" value="1 1 1"/>
          <rgb name="k" value="2 2 2"/></bsdf></bsdf>)"},
    // The lower left corner of the image is (0, 0), and the squares of the checkerboard are units of (u, v).
    {"ImageTexture4", 4,
     R"(Texture "t" "spectrum" "imagemap" "string filename" "../data/image.ppm" "string filter" "point"
        Material "diffuse" "texture reflectance" "t")",
     R"(type="twosided"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">
        <string name="filename" value="../data/image.ppm"/><string name="filter_type" value="nearest"/>
        <transform name="to_uv"><scale y="-1"/><translate y="1"/></transform></texture></bsdf>)"},
    {"Checkerboard4", 4,
     R"(Texture "t" "spectrum" "checkerboard" "rgb tex1" [.8 .8 .2] "rgb tex2" [.1 .1 .1]
        "float uscale" 4 "float vscale" 6
        Material "diffuse" "texture reflectance" "t")",
     R"(type="twosided"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
        <rgb name="color0" value=".8 .8 .2"/><rgb name="color1" value=".1 .1 .1"/>
        <transform name="to_uv"><scale x="2" y="3"/></transform></texture></bsdf>)"},
    {"DiffuseTransmission4", 4,
     R"(Material "diffusetransmission" "rgb reflectance" [.4 .3 .2] "rgb transmittance" [.1 .5 .6] "float scale" .8)",
     R"(type="diffusetransmission"><rgb name="reflectance" value=".32 .24 .16"/>
        <rgb name="transmittance" value=".08 .4 .48"/>)"},
    // The colours of the lobes are products.
    {"Translucent3", 3,
     R"(Material "translucent" "rgb Kd" [.6 .3 .2] "rgb Ks" [.2 .4 .3] "rgb reflect" [.5 .4 .3]
        "rgb transmit" [.4 .5 .6] "float roughness" .2 "bool remaproughness" false)",
     R"(type="lobesum"><rgb name="diffuse_reflectance" value=".3 .12 .06"/>
        <rgb name="diffuse_transmittance" value=".24 .15 .12"/><rgb name="glossy_reflectance" value=".1 .16 .09"/>
        <rgb name="glossy_transmittance" value=".08 .2 .18"/><float name="eta" value="1.5"/>
        <string name="distribution" value="ggx"/><float name="alpha" value=".2"/>)"},
    {"Matte3", 3, R"(Material "matte" "rgb Kd" [.6 .3 .2])",
     R"(type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".6 .3 .2"/></bsdf>)"},
    {"RoughMatte3", 3, R"(Material "matte" "rgb Kd" [.6 .3 .2] "float sigma" 30)",
     R"(type="twosided"><bsdf type="orennayar"><rgb name="reflectance" value=".6 .3 .2"/>
        <float name="sigma" value="30"/></bsdf>)"},
    {"Mirror3", 3, R"(Material "mirror" "rgb Kr" [.9 .8 .7])",
     R"(type="twosided"><bsdf type="conductor"><string name="material" value="none"/>
        <rgb name="specular_reflectance" value=".9 .8 .7"/></bsdf>)"},
    {"Glass3", 3, R"(Material "glass" "rgb Kr" [.9 .8 .7] "rgb Kt" [.7 .8 .9] "float index" 1.4)",
     R"(type="dielectric"><float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/>
        <rgb name="specular_reflectance" value=".9 .8 .7"/>
        <rgb name="specular_transmittance" value=".7 .8 .9"/>)"},
    {"Metal3", 3,
     R"(Material "metal" "rgb eta" [1.6 .9 .5] "rgb k" [8.5 6.9 5.2] "float roughness" .3
        "bool remaproughness" false)",
     R"(type="twosided"><bsdf type="roughconductor"><rgb name="eta" value="1.6 .9 .5"/>
        <rgb name="k" value="8.5 6.9 5.2"/><string name="distribution" value="ggx"/>
        <float name="alpha" value=".3"/></bsdf>)"},
    // ln 0.2 in 1.62142 + 0.819955 x + 0.1734 x² + 0.0171201 x³ + 0.000640711 x⁴.
    {"RemappedRoughness3", 3,
     R"(Material "metal" "rgb eta" [1.6 .9 .5] "rgb k" [8.5 6.9 5.2] "float roughness" .2)",
     R"(type="twosided"><bsdf type="roughconductor"><rgb name="eta" value="1.6 .9 .5"/>
        <rgb name="k" value="8.5 6.9 5.2"/><string name="distribution" value="ggx"/>
        <float name="alpha" value="0.6838364"/></bsdf>)"},
    {"Substrate3", 3,
     R"(Material "substrate" "rgb Kd" [.4 .2 .1] "rgb Ks" [.1 .2 .3] "float uroughness" .1
        "float vroughness" .2 "bool remaproughness" false)",
     R"(type="twosided"><bsdf type="fresnelblend"><rgb name="diffuse_reflectance" value=".4 .2 .1"/>
        <rgb name="specular_reflectance" value=".1 .2 .3"/><string name="distribution" value="ggx"/>
        <float name="alpha_u" value=".1"/><float name="alpha_v" value=".2"/></bsdf>)"},
    {"Uber3", 3,
     R"(Material "uber" "rgb Kd" [.3 .2 .1] "rgb Ks" [.2 .2 .2] "rgb Kr" [.1 .1 .1] "float eta" 1.4
        "rgb opacity" [.7 .7 .7] "float roughness" .2 "bool remaproughness" false)",
     R"(type="mask"><float name="opacity" value=".7"/><bsdf type="lobesum">
        <rgb name="diffuse_reflectance" value=".3 .2 .1"/><rgb name="glossy_reflectance" value=".2 .2 .2"/>
        <rgb name="specular_reflectance" value=".1 .1 .1"/><float name="eta" value="1.4"/>
        <string name="distribution" value="ggx"/><float name="alpha" value=".2"/></bsdf>)"},
    {"Disney3", 3,
     R"(Material "disney" "rgb color" [.6 .3 .2] "float metallic" .3 "float roughness" .4 "float sheen" .5
        "float clearcoat" .5 "float clearcoatgloss" .8 "float eta" 1.4)",
     R"(type="twosided"><bsdf type="principled"><rgb name="base_color" value=".6 .3 .2"/>
        <float name="metallic" value=".3"/><float name="roughness" value=".4"/><float name="sheen" value=".5"/>
        <float name="sheen_tint" value=".5"/><float name="clearcoat" value=".5"/>
        <float name="clearcoat_gloss" value=".8"/><float name="eta" value="1.4"/></bsdf>)"},
    {"Mix3", 3,
     R"(MakeNamedMaterial "red" "string type" "matte" "rgb Kd" [.7 .1 .1]
        MakeNamedMaterial "mirror" "string type" "mirror"
        Material "mix" "string namedmaterial1" "red" "string namedmaterial2" "mirror" "rgb amount" [.7 .7 .7])",
     R"(type="blendbsdf"><float name="weight" value=".7"/>
        <bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/>
          <float name="specular_reflectance" value=".9"/></bsdf></bsdf>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".7 .1 .1"/></bsdf></bsdf>)"},
};
INSTANTIATE_TEST_SUITE_P(FormatPairs, PbrtMaterials, ::testing::ValuesIn(kPbrtMaterials), name_of);

/// A floor and a ball under the light. The path tracer alone: light paths would start in the frame of the light, of which
/// the formats fix the axis alone.
class PbrtLights : public PairsOf {};
TEST_P(PbrtLights, HaveTheImageOfTheirTranslation) {
    const SceneDescription a =
        pbrt(GetParam().version, kPbrtCamera,
             std::string("AttributeBegin\n") + GetParam().pbrt + "\nAttributeEnd\n" + kPbrtFloor +
                 "Shape \"sphere\" \"float radius\" .9");
    const SceneDescription b =
        mitsuba(kMitsubaCamera + mitsuba_film() + "</sensor>" + GetParam().mitsuba + kMitsubaFloor +
                R"(<shape type="sphere"><float name="radius" value=".9"/><bsdf type="diffuse">
           <rgb name="reflectance" value=".5 .5 .5"/></bsdf></shape>)");
    expect_same_images(a, b, "path");
}

// In pbrt-v4 `power` is in lumen and a light without a colour is white: I = power / 4π, L = power / π A.
const Pair kPbrtLightPairs[] = {
    {"Point4", 4,
     R"(LightSource "point" "rgb I" [30 30 20] "float scale" .5 "point3 from" [-2 3 2])",
     R"(<emitter type="point"><point name="position" value="-2 3 2"/>
        <rgb name="intensity" value="15 15 10"/></emitter>)"},
    {"PointIsTransformed4", 4,
     R"(Translate 1 2 0 LightSource "point" "rgb I" [9 9 9] "point3 from" [-2 1 2])",
     R"(<emitter type="point"><point name="position" value="-1 3 2"/>
        <rgb name="intensity" value="9 9 9"/></emitter>)"},
    {"PointOfAPower4", 4, R"(Translate -2 3 2 LightSource "point" "float power" 200)",
     R"(<emitter type="point"><point name="position" value="-2 3 2"/>
        <rgb name="intensity" value="15.915494 15.915494 15.915494"/></emitter>)"},
    {"Spot4", 4,
     R"(LightSource "spot" "rgb I" [90 80 70] "point3 from" [2 4 2] "point3 to" [0 0 0] "float coneangle" 25
        "float conedeltaangle" 10)",
     R"(<emitter type="spot"><transform name="to_world"><lookat origin="2 4 2" target="0 0 0" up="0 1 0"/>
        </transform><float name="cutoff_angle" value="25"/><float name="beam_width" value="15"/>
        <string name="falloff" value="smooth"/><rgb name="intensity" value="90 80 70"/></emitter>)"},
    {"Spot3", 3,
     R"(LightSource "spot" "rgb I" [90 80 70] "point from" [2 4 2] "point to" [0 0 0] "float coneangle" 25
        "float conedeltaangle" 10)",
     R"(<emitter type="spot"><transform name="to_world"><lookat origin="2 4 2" target="0 0 0" up="0 1 0"/>
        </transform><float name="cutoff_angle" value="25"/><float name="beam_width" value="15"/>
        <string name="falloff" value="quartic"/><rgb name="intensity" value="90 80 70"/></emitter>)"},
    {"Distant4", 4,
     R"(LightSource "distant" "rgb L" [2 3 4] "point3 from" [1 3 2] "point3 to" [0 0 0])",
     R"(<emitter type="directional"><vector name="direction" value="-1 -3 -2"/>
        <rgb name="irradiance" value="2 3 4"/></emitter>)"},
    {"DistantOfAnIlluminance4", 4,
     R"(LightSource "distant" "float illuminance" 5 "point3 from" [1 3 2] "point3 to" [0 0 0])",
     R"(<emitter type="directional"><vector name="direction" value="-1 -3 -2"/>
        <rgb name="irradiance" value="5 5 5"/></emitter>)"},
    {"DistantIsTurned3", 3,
     R"(Rotate 90 0 0 1 LightSource "distant" "rgb L" [2 3 4] "point from" [3 -1 2] "point to" [0 0 0])",
     R"(<emitter type="directional"><vector name="direction" value="-1 -3 -2"/>
        <rgb name="irradiance" value="2 3 4"/></emitter>)"},
    {"Infinite4", 4, R"(LightSource "infinite" "rgb L" [.4 .5 .6] "float scale" 2)",
     R"(<emitter type="constant"><rgb name="radiance" value=".8 1 1.2"/></emitter>)"},
    {"InfiniteOfAnIlluminance4", 4, R"(LightSource "infinite" "float illuminance" 2)",
     R"(<emitter type="constant"><rgb name="radiance" value="0.63661977 0.63661977 0.63661977"/></emitter>)"},
    // From (-cos φ … ) of Mitsuba, with +y up and u from -z to x, to +z up and u from x to y.
    {"InfiniteImage3", 3,
     R"(Rotate 30 0 1 0 LightSource "infinite" "string mapname" "../data/image.ppm" "rgb L" [1 2 3])",
     R"(<emitter type="envmap"><string name="filename" value="../data/image.ppm"/>
        <transform name="to_world"><matrix value="0 0 -1 0  1 0 0 0  0 1 0 0  0 0 0 1"/>
        <rotate y="1" angle="30"/></transform><rgb name="tint" value="1 2 3"/></emitter>)"},
    // An image in the equal-area projection has its zenith at +z in both.
    {"InfiniteImage4", 4,
     R"(Rotate 30 0 1 0 LightSource "infinite" "string filename" "../data/image.ppm" "float scale" 2)",
     R"(<emitter type="envmap"><string name="filename" value="../data/image.ppm"/>
        <string name="projection" value="equalarea"/><float name="scale" value="2"/>
        <transform name="to_world"><rotate y="1" angle="30"/></transform></emitter>)"},
    // The zenith of an image of intensities is +y: y and z are exchanged.
    {"Goniometric4", 4,
     R"(Translate -2 3 2 Rotate 40 0 0 1 LightSource "goniometric" "rgb I" [30 40 50]
        "string filename" "../data/image.ppm")",
     R"(<emitter type="goniometric"><string name="filename" value="../data/image.ppm"/>
        <string name="projection" value="equalarea"/><rgb name="intensity" value="30 40 50"/>
        <transform name="to_world"><matrix value="1 0 0 0  0 0 1 0  0 1 0 0  0 0 0 1"/>
        <rotate z="1" angle="40"/><translate x="-2" y="3" z="2"/></transform></emitter>)"},
    {"Projection4", 4,
     R"(Translate 0 4 0 Rotate 90 1 0 0 LightSource "projection" "float scale" 40 "float fov" 70
        "string filename" "../data/image.ppm")",
     R"(<emitter type="projection"><string name="filename" value="../data/image.ppm"/>
        <float name="fov" value="70"/><rgb name="intensity" value="40 40 40"/><transform name="to_world">
        <rotate x="1" angle="90"/><translate y="4"/></transform></emitter>)"},
    // The upper edge of the image is that of -y, and the angle 45 by default.
    {"Projection3", 3,
     R"(Translate 0 4 0 Rotate 90 1 0 0 LightSource "projection" "rgb I" [40 30 20]
        "string mapname" "../data/image.ppm")",
     R"(<emitter type="projection"><string name="filename" value="../data/image.ppm"/>
        <float name="fov" value="45"/><rgb name="intensity" value="40 30 20"/><transform name="to_world">
        <scale y="-1"/><rotate x="1" angle="90"/><translate y="4"/></transform></emitter>)"},
    {"AreaOfAnImage4", 4,
     R"(AreaLightSource "diffuse" "string filename" "../data/image.ppm" "float scale" 12 Translate 0 4 0
        Rotate 90 1 0 0 Shape "plymesh" "string filename" "../data/patch.ply")",
     R"(<shape type="ply"><string name="filename" value="../data/patch.ply"/><transform name="to_world">
        <rotate x="1" angle="90"/><translate y="4"/></transform>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf></bsdf>
        <emitter type="area"><texture type="scale" name="radiance"><texture type="bitmap" name="value">
        <string name="filename" value="../data/image.ppm"/>
        <transform name="to_uv"><scale y="-1"/><translate y="1"/></transform></texture>
        <rgb name="scale" value="12 12 12"/></texture></emitter></shape>)"},
    {"AreaOfASphere4", 4,
     R"(AreaLightSource "diffuse" "rgb L" [12 9 6] "float scale" 2 Translate -2 3 2 Shape "sphere" "float radius" .5)",
     R"(<shape type="sphere"><point name="center" value="-2 3 2"/><float name="radius" value=".5"/>
        <bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="24 18 12"/></emitter></shape>)"},
    {"AreaOfAPower4", 4,
     R"(AreaLightSource "diffuse" "float power" 200 Translate -2 3 2 Shape "sphere" "float radius" .5)",
     R"(<shape type="sphere"><point name="center" value="-2 3 2"/><float name="radius" value=".5"/>
        <bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="20.264237 20.264237 20.264237"/></emitter></shape>)"},
    {"AreaOfAMesh3", 3,
     R"(AreaLightSource "diffuse" "rgb L" [12 9 6] Translate 0 4 0 Rotate 90 1 0 0
        Shape "plymesh" "string filename" "../data/patch.ply")",
     R"(<shape type="ply"><string name="filename" value="../data/patch.ply"/><transform name="to_world">
        <rotate x="1" angle="90"/><translate y="4"/></transform>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf></bsdf>
        <emitter type="area"><rgb name="radiance" value="12 9 6"/></emitter></shape>)"},
    {"AreaOfTheBack4", 4,
     R"(AreaLightSource "diffuse" "rgb L" [12 9 6] Translate 0 4 0 Rotate -90 1 0 0 ReverseOrientation
        Shape "plymesh" "string filename" "../data/patch.ply")",
     R"(<shape type="ply"><string name="filename" value="../data/patch.ply"/><transform name="to_world">
        <rotate x="1" angle="-90"/><translate y="4"/></transform><boolean name="flip_normals" value="true"/>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf></bsdf>
        <emitter type="area"><rgb name="radiance" value="12 9 6"/></emitter></shape>)"},
    // Twice a square's one side has the area 8.
    {"AreaOfBothSidesAndAPower4", 4,
     R"(AreaLightSource "diffuse" "float power" 200 "bool twosided" true Translate 0 4 0 Rotate -90 1 0 0
        Shape "plymesh" "string filename" "../data/patch.ply")",
     R"(<shape type="ply"><string name="filename" value="../data/patch.ply"/><transform name="to_world">
        <rotate x="1" angle="-90"/><translate y="4"/></transform>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".5 .5 .5"/></bsdf></bsdf>
        <emitter type="area"><boolean name="two_sided" value="true"/>
        <rgb name="radiance" value="7.9577472 7.9577472 7.9577472"/></emitter></shape>)"},
};
INSTANTIATE_TEST_SUITE_P(FormatPairs, PbrtLights, ::testing::ValuesIn(kPbrtLightPairs), name_of);

/// The view of the two lights, a floor and a ball.
class PbrtCameras : public PairsOf {};
TEST_P(PbrtCameras, HaveTheImageOfTheirTranslation) {
    const SceneDescription a = pbrt(GetParam().version, GetParam().pbrt,
                                    std::string(kPbrtLights) + kPbrtFloor +
                                        "Translate -.5 0 1 Shape \"sphere\" \"float radius\" .9");
    const std::string world = std::string(kMitsubaLights) + kMitsubaFloor +
                              R"(<shape type="sphere"><point name="center" value="-.5 0 1"/>
        <float name="radius" value=".9"/><bsdf type="diffuse">
        <rgb name="reflectance" value=".5 .5 .5"/></bsdf></shape>)";
    expect_same_images(a, mitsuba(GetParam().mitsuba + world), "bdpt");
}

std::string mitsuba_camera(const std::string& type, const std::string& params,
                           const std::string& film = mitsuba_film(), const std::string& step = "") {
    return fmt::format("<sensor type=\"{}\">{}<transform name=\"to_world\">{}{}</transform>{}"
                       "</sensor>",
                       type, params, step, kMitsubaLookAt, film);
}
const std::string kSmaller = "<string name=\"fov_axis\" value=\"smaller\"/>";
const std::string kNarrow =
    mitsuba_camera("perspective", kSmaller + R"(<float name="fov" value="30"/>)");
const std::string kLens = mitsuba_camera("thinlens", kSmaller + R"(<float name="fov" value="40"/>
    <float name="aperture_radius" value=".3"/><float name="focus_distance" value="5"/>)");
// Six units wide, of which the film's shape gives the height.
const std::string kOrthographic =
    mitsuba_camera("orthographic", "", mitsuba_film(), R"(<scale x="3" y="3"/>)");
// On pbrt's screen, [-1, 1] is the view of 40°; this window is 1.2 times as wide as high a half of it.
const std::string kWindow = mitsuba_camera("perspective", R"(<string name="fov_axis" value="x"/>
    <float name="fov" value="47.187974"/><float name="principal_point_offset_x" value="-0.041666667"/>
    <float name="principal_point_offset_y" value="-0.125"/>)");
const std::string kCropped =
    mitsuba_camera("perspective", kSmaller + R"(<float name="fov" value="40"/>)", mitsuba_film(R"(
    <integer name="crop_offset_x" value="6"/><integer name="crop_offset_y" value="4"/>
    <integer name="crop_width" value="12"/><integer name="crop_height" value="10"/><rfilter type="box"/>)"));
const std::string kPlain =
    mitsuba_camera("perspective", kSmaller + R"(<float name="fov" value="40"/>)");

const Pair kPbrtCameraPairs[] = {
    {"Perspective4", 4, R"(Camera "perspective" "float fov" 30)", kNarrow.c_str()},
    {"HalfAngle3", 3, R"(Camera "perspective" "float halffov" 15)", kNarrow.c_str()},
    {"ThinLens4", 4,
     R"(Camera "perspective" "float fov" 40 "float lensradius" .3 "float focaldistance" 5)",
     kLens.c_str()},
    {"Orthographic4", 4, R"(Camera "orthographic" "float screenwindow" [-3 3 -2 2])",
     kOrthographic.c_str()},
    {"ScreenWindow3", 3,
     R"(Camera "perspective" "float fov" 40 "float screenwindow" [-1.3 1.1 -.6 1])",
     kWindow.c_str()},
    {"CropWindow4", 4,
     R"(Camera "perspective" "float fov" 40
        Film "rgb" "integer xresolution" 24 "integer yresolution" 16 "float cropwindow" [.25 .75 .25 .875])",
     kCropped.c_str()},
    {"PixelBounds4", 4,
     R"(Camera "perspective" "float fov" 40
        Film "rgb" "integer xresolution" 24 "integer yresolution" 16 "integer pixelbounds" [6 18 4 14])",
     kCropped.c_str()},
    {"TwiceTheSensitivityForHalfTheTime4", 4,
     R"(Camera "perspective" "float fov" 40 "float shutterclose" .5
        Film "rgb" "integer xresolution" 24 "integer yresolution" 16 "float iso" 200)",
     kPlain.c_str()},
};
INSTANTIATE_TEST_SUITE_P(FormatPairs, PbrtCameras, ::testing::ValuesIn(kPbrtCameraPairs), name_of);

// ---- glTF

/// The square of "../data/patch.ply". In both formats, v = 0 is the upper edge of an image.
std::string square_of_gltf() {
    const float values[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0,  //
                            0,  0,  1, 0, 0,  1, 0, 0, 1, 0,  0, 1,  //
                            0,  0,  1, 0, 1,  1, 0, 1};
    const uint16_t indices[] = {0, 1, 2, 0, 2, 3};
    std::string bytes(reinterpret_cast<const char*>(values), sizeof values);
    return bytes.append(reinterpret_cast<const char*>(indices), sizeof indices);
}

/// A grey floor, a square with the material, and a point light, where `lights` is empty.
SceneDescription gltf(const std::string& material, const std::string& camera,
                      const std::string& light) {
    const std::string text = R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0,1,2,3,4]}],
    "nodes":[{"camera":0,"translation":[0,0,6]},
      {"mesh":0,"translation":[0,-1,0],"rotation":[-0.70710678,0,0,0.70710678],"scale":[4,4,4]},
      {"mesh":1,"translation":[-1.2,0.2,0.5]},
      {"mesh":1,"translation":[1.2,0.1,0],"rotation":[0,0.5,0,0.8660254],"scale":[1.1,1.1,1.1]},
      {"translation":[-1,3,3],"extensions":{"KHR_lights_punctual":{"light":0}}}],
    "cameras":[)" + camera + R"(],
    "extensions":{"KHR_lights_punctual":{"lights":[)" +
                             light + R"(]}},
    "meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2},"indices":3,"material":0}]},
      {"primitives":[{"attributes":{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2},"indices":3,"material":1}]}],
    "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0}},)" +
                             material + R"(],
    "textures":[{"source":0,"sampler":0}],"images":[{"uri":"../data/image.ppm"}],"samplers":[{"magFilter":9728}],
    "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":4},
      {"bufferView":1,"componentType":5126,"type":"VEC3","count":4},
      {"bufferView":2,"componentType":5126,"type":"VEC2","count":4},
      {"bufferView":3,"componentType":5123,"type":"SCALAR","count":6}],
    "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":48},
      {"buffer":0,"byteOffset":96,"byteLength":32},{"buffer":0,"byteOffset":128,"byteLength":12}],
    "buffers":[{"uri":"square.bin","byteLength":140}]})";
    ReadOptions options;
    options.read_file = [](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with("square.bin")) return square_of_gltf();
        return {};
    };
    SceneDescription scene = parse_gltf(text, file_in_formats("pair.gltf"), options);
    EXPECT_TRUE(scene.warnings.empty()) << scene.warnings[0];
    return scene;
}

const std::string kGltfGrey = R"({"pbrMetallicRoughness":{"metallicFactor":0}})";
const std::string kGltfCamera =
    R"({"type":"perspective","perspective":{"yfov":0.7,"aspectRatio":1.5,"znear":0.1}})";
const std::string kGltfPoint = R"({"type":"point","intensity":40,"color":[1,0.9,0.8]})";

const std::string kFromInFront = "<transform name=\"to_world\"><lookat origin=\"0 0 6\" target=\"0 "
                                 "0 0\" up=\"0 1 0\"/></transform>";
const std::string kCameraLikeGltf =
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"40.107046\"/>"
    "<string name=\"fov_axis\" value=\"y\"/>" +
    kFromInFront + mitsuba_film("") + "</sensor>";
const std::string kPointLikeGltf = R"(<emitter type="point"><point name="position" value="-1 3 3"/>
    <rgb name="intensity" value="40 36 32"/></emitter>)";
const std::string kGreyOfGltf =
    R"(<bsdf type="twosided"><bsdf type="openpbr"><rgb name="base_color" value=".5 .5 .5"/>
    <float name="base_metalness" value="0"/><float name="specular_roughness" value="1"/><float name="specular_ior" value="1.5"/></bsdf></bsdf>)";

/// `bsdf` has the id "m".
SceneDescription like_gltf(const std::string& bsdf, const std::string& camera,
                           const std::string& light, const std::string& emitter = "",
                           const std::string& medium = "") {
    const std::string square = "<shape type=\"ply\"><string name=\"filename\" "
                               "value=\"../data/patch.ply\"/><transform name=\"to_world\">";
    const std::string end = "</transform><ref id=\"m\"/>" + emitter + medium + "</shape>";
    return mitsuba(
        camera + bsdf + light + square +
        R"(<scale value="4"/><rotate x="1" angle="-90"/><translate y="-1"/></transform>)" +
        kGreyOfGltf + "</shape>" + square + R"(<translate x="-1.2" y=".2" z=".5"/>)" + end +
        square + R"(<scale value="1.1"/><rotate y="1" angle="60"/><translate x="1.2" y=".1"/>)" +
        end);
}

struct GltfPair {
    const char *name, *gltf, *mitsuba;
    const char* emitter = "";
    const char* medium = "";
};
void PrintTo(const GltfPair& pair, std::ostream* out) {
    *out << pair.name;
}
std::string name_of_gltf(const ::testing::TestParamInfo<GltfPair>& info) {
    return info.param.name;
}

BuildOptions of_small_film() {
    BuildOptions options;
    options.resolution = {kWidth, kHeight};
    return options;
}
const BuildOptions kSmall = of_small_film();

class GltfMaterials : public ::testing::TestWithParam<GltfPair> {};
TEST_P(GltfMaterials, HaveTheImageOfTheirTranslation) {
    const GltfPair& pair = GetParam();
    expect_same_images(gltf(pair.gltf, kGltfCamera, kGltfPoint),
                       like_gltf(std::string("<bsdf id=\"m\" ") + pair.mitsuba + "</bsdf>",
                                 kCameraLikeGltf, kPointLikeGltf, pair.emitter, pair.medium),
                       "bdpt", kSmall);
}

const GltfPair kGltfMaterialPairs[] = {
    {"MetalAndRoughness",
     R"({"pbrMetallicRoughness":{"baseColorFactor":[0.9,0.6,0.3,1],"metallicFactor":0.7,"roughnessFactor":0.4}})",
     R"(type="twosided"><bsdf type="openpbr"><rgb name="base_color" value=".9 .6 .3"/>
        <float name="base_metalness" value=".7"/><float name="specular_roughness" value=".4"/><float name="specular_ior" value="1.5"/></bsdf>)"},
    {"DefaultsAreWhiteRoughMetal", R"({})",
     R"(type="twosided"><bsdf type="openpbr"><rgb name="base_color" value="1 1 1"/>
        <float name="base_metalness" value="1"/><float name="specular_roughness" value="1"/><float name="specular_ior" value="1.5"/></bsdf>)"},
    {"BaseColorTexture",
     R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0},"metallicFactor":0,"roughnessFactor":0.5}})",
     R"(type="twosided"><bsdf type="openpbr"><texture type="bitmap" name="base_color">
        <string name="filename" value="../data/image.ppm"/><string name="filter_type" value="nearest"/></texture>
        <float name="base_metalness" value="0"/><float name="specular_roughness" value=".5"/><float name="specular_ior" value="1.5"/></bsdf>)"},
    // The matrix of the extension is translation · rotation · scale, with the rotation from u toward -v.
    {"TextureTransform",
     R"({"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.5,"baseColorTexture":{"index":0,
        "extensions":{"KHR_texture_transform":{"offset":[0.1,0.2],"rotation":0.5235987756,"scale":[2,3]}}}}})",
     R"(type="twosided"><bsdf type="openpbr"><texture type="bitmap" name="base_color">
        <string name="filename" value="../data/image.ppm"/><string name="filter_type" value="nearest"/>
        <transform name="to_uv"><scale x="2" y="3"/><rotate z="1" angle="-30"/><translate x=".1" y=".2"/></transform>
        </texture><float name="base_metalness" value="0"/><float name="specular_roughness" value=".5"/>
        <float name="specular_ior" value="1.5"/></bsdf>)"},
    {"MetalAndRoughnessTexture",
     R"({"pbrMetallicRoughness":{"metallicRoughnessTexture":{"index":0}}})",
     R"(type="twosided"><bsdf type="openpbr"><rgb name="base_color" value="1 1 1"/>
        <texture type="bitmap" name="base_metalness"><string name="filename" value="../data/image.ppm"/>
          <string name="filter_type" value="nearest"/><boolean name="raw" value="true"/>
          <string name="channel" value="b"/></texture>
        <texture type="bitmap" name="specular_roughness"><string name="filename" value="../data/image.ppm"/>
          <string name="filter_type" value="nearest"/><boolean name="raw" value="true"/>
          <string name="channel" value="g"/></texture><float name="specular_ior" value="1.5"/></bsdf>)"},
    {"NormalTexture",
     R"({"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.5},"normalTexture":{"index":0}})",
     R"(type="twosided"><bsdf type="normalmap"><texture type="bitmap" name="normalmap">
        <string name="filename" value="../data/image.ppm"/><string name="filter_type" value="nearest"/>
        <boolean name="raw" value="true"/></texture>
        <bsdf type="openpbr"><rgb name="base_color" value="1 1 1"/><float name="base_metalness" value="0"/>
        <float name="specular_roughness" value=".5"/><float name="specular_ior" value="1.5"/></bsdf></bsdf>)"},
    {"Index",
     R"({"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.3},"extensions":{"KHR_materials_ior":{"ior":1.8}}})",
     R"(type="twosided"><bsdf type="openpbr"><rgb name="base_color" value="1 1 1"/><float name="base_metalness" value="0"/>
        <float name="specular_roughness" value=".3"/><float name="specular_ior" value="1.8"/></bsdf>)"},
    // A quarter of the reflectance of 1.5, 0.04, is that of 11/9.
    {"SpecularFactor",
     R"({"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.3},
        "extensions":{"KHR_materials_specular":{"specularFactor":0.25}}})",
     R"(type="twosided"><bsdf type="openpbr"><rgb name="base_color" value="1 1 1"/><float name="base_metalness" value="0"/>
        <float name="specular_roughness" value=".3"/><float name="specular_ior" value="1.22222222"/></bsdf>)"},
    {"BlendedAlpha",
     R"({"alphaMode":"BLEND","pbrMetallicRoughness":{"baseColorFactor":[0.9,0.6,0.3,0.4],"metallicFactor":0}})",
     R"(type="mask"><float name="opacity" value=".4"/><bsdf type="twosided"><bsdf type="openpbr">
        <rgb name="base_color" value=".9 .6 .3"/><float name="base_metalness" value="0"/><float name="specular_roughness" value="1"/>
        <float name="specular_ior" value="1.5"/></bsdf></bsdf>)"},
    {"AlphaBelowTheCutoff",
     R"({"alphaMode":"MASK","alphaCutoff":0.5,"pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0.4]}})",
     R"(type="null">)"},
    {"Pane",
     R"({"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0,"baseColorFactor":[0.9,0.6,0.3,1]},
        "extensions":{"KHR_materials_transmission":{"transmissionFactor":1},"KHR_materials_ior":{"ior":1.4}}})",
     R"(type="thindielectric"><float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/>
        <rgb name="specular_transmittance" value=".9 .6 .3"/>)"},
    // 0.5 m through the medium leave the colour of the attenuation: σ = -ln c / 0.5.
    {"Volume",
     R"({"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.2},"extensions":{
        "KHR_materials_transmission":{"transmissionFactor":1},
        "KHR_materials_volume":{"thicknessFactor":1,"attenuationDistance":0.5,"attenuationColor":[0.5,0.8,0.9]}}})",
     R"(type="openpbr"><rgb name="base_color" value="1 1 1"/><float name="base_metalness" value="0"/>
        <float name="specular_roughness" value=".2"/><float name="specular_ior" value="1.5"/><float name="transmission_weight" value="1"/>)",
     "",
     R"(<medium type="homogeneous" name="interior"><rgb name="sigma_t" value="1.3862944 0.44628710 0.21072103"/>
        <float name="albedo" value="0"/></medium>)"},
    {"Emission",
     R"({"pbrMetallicRoughness":{"metallicFactor":0},"emissiveFactor":[1,0.5,0.25],
        "extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":4}}})",
     R"(type="twosided"><bsdf type="openpbr"><rgb name="base_color" value="1 1 1"/><float name="base_metalness" value="0"/>
        <float name="specular_roughness" value="1"/><float name="specular_ior" value="1.5"/></bsdf>)",
     R"(<emitter type="area"><rgb name="radiance" value="4 2 1"/></emitter>)"},
};
INSTANTIATE_TEST_SUITE_P(FormatPairs, GltfMaterials, ::testing::ValuesIn(kGltfMaterialPairs),
                         name_of_gltf);

/// Lights stand at (-1, 3, 3) and shine along -z.
class GltfLights : public ::testing::TestWithParam<GltfPair> {};
TEST_P(GltfLights, HaveTheImageOfTheirTranslation) {
    expect_same_images(gltf(kGltfGrey, kGltfCamera, GetParam().gltf),
                       like_gltf(R"(<bsdf id="m" type="twosided"><bsdf type="openpbr">
        <rgb name="base_color" value="1 1 1"/><float name="base_metalness" value="0"/><float name="specular_roughness" value="1"/>
        <float name="specular_ior" value="1.5"/></bsdf></bsdf>)",
                                 kCameraLikeGltf, GetParam().mitsuba),
                       "path", kSmall);
}
const GltfPair kGltfLightPairs[] = {
    {"Point", R"({"type":"point","intensity":40,"color":[1,0.9,0.8]})",
     R"(<emitter type="point"><point name="position" value="-1 3 3"/>
        <rgb name="intensity" value="40 36 32"/></emitter>)"},
    {"Directional", R"({"type":"directional","intensity":3,"color":[1,0.9,0.8]})",
     R"(<emitter type="directional"><vector name="direction" value="0 0 -1"/>
        <rgb name="irradiance" value="3 2.7 2.4"/></emitter>)"},
    // The square of a ramp in the cosine.
    {"Spot",
     R"({"type":"spot","intensity":60,"color":[1,0.9,0.8],"spot":{"innerConeAngle":0.6,"outerConeAngle":1.2}})",
     R"(<emitter type="spot"><transform name="to_world">
        <lookat origin="-1 3 3" target="-1 3 0" up="0 1 0"/></transform>
        <float name="cutoff_angle" value="68.754935"/><float name="beam_width" value="34.377468"/>
        <string name="falloff" value="quadratic"/><rgb name="intensity" value="60 54 48"/></emitter>)"},
};
INSTANTIATE_TEST_SUITE_P(FormatPairs, GltfLights, ::testing::ValuesIn(kGltfLightPairs),
                         name_of_gltf);

TEST(GltfCameras, HaveTheImageOfTheirTranslation) {
    const std::string bsdf =
        "<bsdf id=\"m\" type=\"twosided\"><bsdf type=\"openpbr\"><rgb name=\"base_color\" "
        "value=\"1 1 1\"/><float name=\"base_metalness\" value=\"0\"/><float "
        "name=\"specular_roughness\" "
        "value=\"1\"/><float name=\"specular_ior\" value=\"1.5\"/></bsdf></bsdf>";
    const std::string orthographic =
        R"(<sensor type="orthographic"><transform name="to_world"><scale x="3" y="3"/>
        <lookat origin="0 0 6" target="0 0 0" up="0 1 0"/></transform>)" +
        mitsuba_film("") + "</sensor>";
    expect_same_images(
        gltf(kGltfGrey,
             R"({"type":"orthographic","orthographic":{"xmag":3,"ymag":2,"znear":0,"zfar":9}})",
             kGltfPoint),
        like_gltf(bsdf, orthographic, kPointLikeGltf), "bdpt", kSmall);
}

// ---- Conversion

/// Every small scene of every format, as read and as written and read again.
class Conversions : public ::testing::TestWithParam<const char*> {};
TEST_P(Conversions, KeepTheImage) {
    const TemporaryFolder folder;
    int count = 0;
    for (const auto& entry : fs::directory_iterator(fs::path(ETENDUE_SOURCE_DIR) /
                                                    "tests/scenes/formats" / GetParam())) {
        SCOPED_TRACE(entry.path());
        const SceneDescription scene = read_scene_file(entry.path());
        const std::string converted = folder.path() / "converted.xml";
        fs::remove_all(fs::path(folder.path()) / "files");
        fs::create_directory(fs::path(folder.path()) / "files");
        const std::string xml =
            write_mitsuba_xml(scene, converted, "files", [&](const SceneFile& file) {
                std::ofstream(fs::path(folder.path()) / file.name, std::ios::binary) << file.bytes;
            });
        expect_same_images(scene, parse_mitsuba_xml(xml, converted), "bdpt", kSmall);
        ++count;
    }
    EXPECT_GT(count, 5);
}
INSTANTIATE_TEST_SUITE_P(FormatPairs, Conversions,
                         ::testing::Values("mitsuba06", "mitsuba3", "pbrt3", "pbrt4", "gltf"),
                         [](const auto& format) { return std::string(format.param); });

// ---- A scene of others that exists in three formats

TEST(ScenesOfThreeFormats, VeachAjarHasTheSameImage) {
    const fs::path root = testing::shared_scenes();
    if (root.empty()) GTEST_SKIP() << "no shared scenes";
    SceneDescription xml = read_scene_file((root / "veach-ajar-mts3/scene.xml").string());
    // The metal of the floor has a checkerboard, which the files of pbrt lack.
    size_t removed = 0;
    for (SceneObject& object : xml.objects)
        if (object.type == "roughconductor")
            removed += std::erase_if(object.children, [](const SceneObject::Child& c) {
                return c.name == "specular_reflectance";
            });
    EXPECT_EQ(removed, 1u);
    BuildOptions options;
    options.resolution = {48, 27};
    options.lenient = true;
    ReadOptions lenient;
    lenient.lenient = true;
    const auto tiles = [&](const SceneDescription& description, uint64_t seed) {
        const Scene scene = build_scene(description, options);
        return render_tiles(scene, "bdpt", {.passes = 256, .tiles = 3, .seed = seed});
    };
    const Tiles mitsuba_tiles = tiles(xml, 1);
    for (const char* file : {"veach-ajar-pbrt3/scene.pbrt", "veach-ajar-pbrt4/scene-v4.pbrt"})
        expect_same_image(tiles(read_scene_file((root / file).string(), lenient), 2), mitsuba_tiles,
                          0.15, file);
}

}  // namespace
}  // namespace etendue::test
