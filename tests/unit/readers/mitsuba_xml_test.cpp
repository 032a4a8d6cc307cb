#include "readers/mitsuba_xml.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "color/spectrum.h"
#include "color/srgb.h"
#include "error_of.h"
#include "files_in_memory.h"
#include "shared_scenes.h"

namespace etendue {
namespace {

using Files = std::map<std::string, std::string>;

SceneDescription parse_xml(const std::string& text, const ReadOptions& options = {}) {
    return parse_mitsuba_xml(text, "s.xml", options);
}

/// A scene of version 3.0.0 on one line each.
SceneDescription parse_xml3(const std::string& body, const ReadOptions& options = {}) {
    return parse_xml("<scene version=\"3.0.0\">\n" + body + "\n</scene>", options);
}
SceneDescription parse06(const std::string& body, const ReadOptions& options = {}) {
    return parse_xml("<scene version=\"0.6.0\">\n" + body + "\n</scene>", options);
}

std::string error3(const std::string& body, const ReadOptions& options = {}) {
    return test::error_of([&] { parse_xml3(body, options); });
}

template <class T>
T value_in(const SceneDescription& scene, const char* name, int object = 0) {
    const Param* p = scene.objects.at(object).find(name);
    if (!p) throw std::runtime_error(std::string("no parameter ") + name);
    const T* v = p->as<T>();
    if (!v) throw std::runtime_error(std::string(name) + " has another type");
    return *v;
}

void expect_near_rgb(Rgb a, Rgb b) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], 1e-5 * (1 + std::fabs(b[i])));
}

// ---- Both dialects

constexpr const char* kOld = R"(<?xml version="1.0"?>
<scene version="0.6.0">
    <default name="depth" value="8"/>
    <integrator type="path"><integer name="maxDepth" value="$depth"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <string name="fovAxis" value="smaller"/>
        <transform name="toWorld"><lookAt origin="0,0,5" target="0 0 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="64"/></film>
    </sensor>
    <texture type="bitmap" id="wood">
        <string name="filename" value="wood.png"/>
        <float name="uscale" value="4"/>
        <float name="voffset" value="0.5"/>
        <string name="filterType" value="trilinear"/>
        <float name="gamma" value="1"/>
    </texture>
    <bsdf type="diffuse" id="floor"><ref name="diffuseReflectance" id="wood"/></bsdf>
    <bsdf type="roughdielectric" id="glass">
        <float name="intIOR" value="1.5"/>
        <float name="alphaU" value="0.1"/>
    </bsdf>
    <shape type="obj">
        <boolean name="faceNormals" value="true"/>
        <ref id="floor"/>
        <emitter type="area"><spectrum name="radiance" value="3"/></emitter>
    </shape>
</scene>)";

constexpr const char* kNew = R"(<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="8"/></integrator>
    <sensor type="perspective">
        <film type="hdrfilm"><integer name="width" value="64"/></film>
        <string name="fov_axis" value="smaller"/>
        <float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0,0,5" target="0 0 0" up="0, 1, 0"/></transform>
    </sensor>
    <texture type="bitmap" id="wood">
        <transform name="to_uv"><scale x="4"/><translate y="0.5"/></transform>
        <string name="filename" value="wood.png"/>
        <string name="filter_type" value="bilinear"/>
        <boolean name="raw" value="true"/>
    </texture>
    <bsdf type="diffuse" id="floor"><ref id="wood" name="reflectance"/></bsdf>
    <bsdf type="roughdielectric" id="glass">
        <float name="int_ior" value="1.5"/>
        <float name="alpha_u" value="0.1"/>
    </bsdf>
    <shape type="obj">
        <boolean name="face_normals" value="true"/>
        <ref id="floor"/>
        <emitter type="area"><rgb name="radiance" value="3 3 3"/></emitter>
    </shape>
</scene>)";

constexpr const char* kDump = R"(integrator path
  max_depth: integer 8
sensor perspective
  fov: float 40
  fov_axis: string "smaller"
  to_world: transform -1 0 0 0 0 1 0 0 0 0 -1 5 0 0 0 1
  film hdrfilm
    width: integer 64
texture bitmap id "wood" #1
  filename: string "wood.png"
  filter_type: string "bilinear"
  raw: boolean true
  to_uv: transform 4 0 0 0 0 1 0 0.5 0 0 1 0 0 0 0 1
bsdf diffuse id "floor" #2
  reflectance: texture #1
bsdf roughdielectric id "glass"
  alpha_u: float 0.1
  int_ior: float 1.5
shape obj
  face_normals: boolean true
  bsdf #2
  emitter area
    radiance: rgb 3 3 3
)";

TEST(MitsubaXml, BothDialectsGiveTheSameDescription) {
    EXPECT_EQ(dump(parse_xml(kOld)), kDump);
    EXPECT_EQ(dump(parse_xml(kNew)), kDump);
}

TEST(MitsubaXml, TranslatesNamesOfOldScenes) {
    const std::pair<const char*, const char*> names[] = {
        {"maxDepth", "max_depth"},
        {"rrDepth", "rr_depth"},
        {"intIOR", "int_ior"},
        {"extIOR", "ext_ior"},
        {"toWorld", "to_world"},
        {"diffuseReflectance", "diffuse_reflectance"},
        {"alphaU", "alpha_u"},
        {"sigmaT", "sigma_t"},
        {"principalPointOffsetX", "principal_point_offset_x"},
        {"filename", "filename"},
        {"p0", "p0"},
        {"Kd", "Kd"},
        {"hide_emitters", "hide_emitters"},
    };
    for (const auto& [old, expected] : names) {
        const auto scene =
            parse06(fmt::format(R"(<bsdf type="x"><float name="{}" value="1"/></bsdf>)", old));
        EXPECT_EQ(scene.objects[0].params[0].name, expected);
        // The newer dialect keeps names as they are.
        const auto same =
            parse_xml3(fmt::format(R"(<bsdf type="x"><float name="{}" value="1"/></bsdf>)", old));
        EXPECT_EQ(same.objects[0].params[0].name, old);
    }
}

TEST(MitsubaXml, TranslatesValuesOfOldScenes) {
    const auto bitmap = [](const char* params) {
        return parse06(fmt::format(R"(<texture type="bitmap">{}</texture>)", params));
    };
    EXPECT_FALSE(value_in<bool>(bitmap(R"(<float name="gamma" value="-1"/>)"), "raw"));
    const auto wrapped = bitmap(
        R"(<string name="wrapModeU" value="clamp"/><string name="wrapModeV" value="clamp"/>)");
    EXPECT_EQ(value_in<std::string>(wrapped, "wrap_mode"), "clamp");
    EXPECT_EQ(wrapped.objects[0].params.size(), 1u);
    EXPECT_EQ(parse06(R"(<bsdf type="bump"/>)").objects[0].type, "bumpmap");
    // Copper is the conductors' material in Mitsuba 0.6 where the file names none.
    EXPECT_EQ(value_in<std::string>(parse06(R"(<bsdf type="conductor"/>)"), "material"), "Cu");
    EXPECT_TRUE(parse06(R"(<bsdf type="conductor"><rgb name="eta" value="1"/></bsdf>)")
                    .objects[0]
                    .find("eta"));
    EXPECT_FALSE(parse06(R"(<bsdf type="conductor"><rgb name="eta" value="1"/></bsdf>)")
                     .objects[0]
                     .find("material"));
    EXPECT_FALSE(parse_xml3(R"(<bsdf type="conductor"/>)").objects[0].find("material"));
    // Scale applies before offset, as in Mitsuba 0.6.
    const auto uv = value_in<Transform>(
        bitmap(R"(<float name="uscale" value="2"/><float name="uoffset" value="0.3"/>)"), "to_uv");
    EXPECT_NEAR(uv.point({1, 0, 0}).x, 2.3f, 1e-6f);
}

// Words of Mitsuba before 0.4, and before 0.3.

constexpr const char* kBefore04 = R"(<scene version="0.3.0">
    <default name="gain" value="2"/>
    <integrator type="direct"><integer name="luminaireSamples" value="4"/></integrator>
    <camera type="perspective">
        <float name="fov" value="40"/>
        <boolean name="mapSmallerSide" value="false"/>
        <float name="focusDepth" value="3"/>
        <transform name="toWorld"><lookAt origin="1,2,5" target="0 0 0" up="0, 1, 0"/></transform>
        <film type="exrfilm"><integer name="width" value="64"/><boolean name="alpha" value="false"/></film>
        <sampler type="ldsampler"><integer name="depth" value="6"/></sampler>
    </camera>
    <camera type="thinlens"/>
    <luminaire type="constant"><spectrum name="intensity" value="3"/></luminaire>
    <luminaire type="envmap"><float name="intensityScale" value="$gain"/></luminaire>
    <luminaire type="directional"><rgb name="intensity" value="1 2 3"/></luminaire>
    <luminaire type="point"><rgb name="intensity" value="1 2 3"/></luminaire>
    <shape type="sphere">
        <bsdf type="bump"><texture type="checkerboard"/><bsdf type="diffuse"/></bsdf>
        <luminaire type="area"><blackbody name="intensity" temperature="5000K" multiplier="2"/></luminaire>
    </shape>
    <medium type="homogeneous" name="m"><float name="densityMultiplier" value="4"/></medium>
</scene>)";

constexpr const char* kAfter04 = R"(<scene version="0.6.0">
    <integrator type="direct"><integer name="emitterSamples" value="4"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <string name="fovAxis" value="larger"/>
        <float name="focusDistance" value="3"/>
        <transform name="toWorld"><scale x="-1"/><lookAt origin="1,2,5" target="0 0 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="64"/><string name="pixelFormat" value="rgb"/></film>
        <sampler type="ldsampler"><integer name="dimension" value="6"/></sampler>
    </sensor>
    <sensor type="thinlens"/>
    <emitter type="constant"><spectrum name="radiance" value="3"/></emitter>
    <emitter type="envmap"><float name="scale" value="2"/></emitter>
    <emitter type="directional"><rgb name="irradiance" value="1 2 3"/></emitter>
    <emitter type="point"><rgb name="intensity" value="1 2 3"/></emitter>
    <shape type="sphere">
        <bsdf type="bumpmap"><texture type="checkerboard"/><bsdf type="diffuse"/></bsdf>
        <emitter type="area"><blackbody name="radiance" temperature="5000K" scale="2"/></emitter>
    </shape>
    <medium type="homogeneous" name="m"><float name="scale" value="4"/></medium>
</scene>)";

constexpr const char* kBefore03 = R"(<scene version="0.2.1">
    <camera type="orthographic">
        <transform name="toWorld"><lookAt ox="1" oy="2" oz="5" tx="0" ty="0" tz="0" ux="0" uy="1" uz="0"/></transform>
    </camera>
    <bsdf type="lambertian" id="grey"><spectrum name="reflectance" value="0.5"/></bsdf>
    <bsdf type="mirror"/>
    <bsdf type="roughmetal"><float name="alphaB" value="0.2"/><spectrum name="ior" value="2"/></bsdf>
    <bsdf type="roughglass"><float name="alphaB" value="0.2"/></bsdf>
    <bsdf type="microfacet"><float name="alphaB" value="0.2"/><float name="diffuseAmount" value="0.8"/>
        <texture type="ldrtexture" name="diffuseReflectance"><string name="filename" value="a.png"/></texture></bsdf>
    <bsdf type="phong"><float name="specularAmount" value="0.5"/></bsdf>
    <bsdf type="composite"><string name="weights" value="0.3 0.7"/><ref id="grey"/><ref id="grey"/></bsdf>
    <shape type="sphere"><boolean name="inverted" value="true"/><ref id="grey"/></shape>
    <shape type="cylinder"><point name="p1" x="1" y="2" z="3"/><point name="p2" x="4" y="5" z="6"/></shape>
    <texture type="gridtexture"><rgb name="brightColor" value="1"/><spectrum name="darkColor" value="0"/></texture>
    <texture type="exrtexture"><string name="filename" value="a.exr"/></texture>
    <medium type="homogeneous"><float name="sizeMultiplier" value="4"/></medium>
</scene>)";

constexpr const char* kAfter03 = R"(<scene version="0.6.0">
    <sensor type="orthographic">
        <transform name="toWorld"><lookAt origin="1,2,5" target="0 0 0" up="0, 1, 0"/></transform>
    </sensor>
    <bsdf type="diffuse" id="grey"><spectrum name="reflectance" value="0.5"/></bsdf>
    <bsdf type="conductor"><string name="material" value="Cr"/></bsdf>
    <bsdf type="roughconductor"><float name="alpha" value="0.2"/><spectrum name="eta" value="2"/></bsdf>
    <bsdf type="roughdielectric"><float name="alpha" value="0.2"/></bsdf>
    <bsdf type="roughplastic"><float name="alpha" value="0.2"/>
        <spectrum name="specularReflectance" value="1"/>
        <texture type="scale" name="diffuseReflectance"><texture type="bitmap" name="value">
            <string name="filename" value="a.png"/></texture><float name="scale" value="0.8"/></texture></bsdf>
    <bsdf type="phong"><spectrum name="diffuseReflectance" value="0.5"/>
        <texture type="scale" name="specularReflectance">
            <spectrum name="value" value="0.2"/><float name="scale" value="0.5"/></texture></bsdf>
    <bsdf type="mixturebsdf"><string name="weights" value="0.3 0.7"/><ref id="grey"/><ref id="grey"/></bsdf>
    <shape type="sphere"><boolean name="flipNormals" value="true"/><ref id="grey"/></shape>
    <shape type="cylinder"><point name="p0" x="1" y="2" z="3"/><point name="p1" x="4" y="5" z="6"/></shape>
    <texture type="gridtexture"><rgb name="color0" value="1"/><spectrum name="color1" value="0"/></texture>
    <texture type="bitmap"><string name="filename" value="a.exr"/></texture>
    <medium type="homogeneous"><float name="scale" value="4"/></medium>
</scene>)";

TEST(MitsubaXml, OldestDialectsGiveTheSameDescription) {
    EXPECT_EQ(dump(parse_xml(kBefore04)), dump(parse_xml(kAfter04)));
    EXPECT_EQ(dump(parse_xml(kBefore03)), dump(parse_xml(kAfter03)));
    // These words are those of their versions alone.
    EXPECT_NE(error3(R"(<luminaire type="point"/>)").find("unknown element <luminaire>"),
              std::string::npos);
    EXPECT_EQ(parse06(R"(<bsdf type="mirror"/>)").objects[0].type, "mirror");
}

TEST(MitsubaXml, OldestDialectsOfIncludedFiles) {
    const auto options =
        with_files({{"a.xml", R"(<luminaire type="point"/>)"},
                    {"b.xml", R"(<scene version="0.6.0"><emitter type="sky"/></scene>)"}});
    EXPECT_EQ(
        dump(parse_xml(
            R"(<scene version="0.3.1"><include filename="a.xml"/><include filename="b.xml"/>
                            <luminaire type="spot"/></scene>)",
            options)),
        dump(parse06("<emitter type=\"point\"/><emitter type=\"sky\"/><emitter type=\"spot\"/>")));
}

TEST(MitsubaXml, ErrorsInOldestDialectsHaveTheirLines) {
    const auto error = [](const std::string& text) {
        return test::error_of([&] { parse_xml(text); });
    };
    EXPECT_EQ(
        error("<scene version=\"0.2.0\">\n<bsdf type=\"phong\">\n<float name=\"specularAmount\" "
              "value=\"a\"/></bsdf>\n</scene>"),
        "s.xml:3: expected a number, found \"a\"");
    EXPECT_EQ(
        error("<scene version=\"0.2.0\">\n<bsdf type=\"phong\">\n<rgb name=\"specularReflectance\" "
              "value=\"1\"/>\n<texture type=\"a\" name=\"specularReflectance\"/></bsdf></scene>"),
        "s.xml:4: parameter \"specular_reflectance\" is given twice");
    EXPECT_EQ(
        error("<scene version=\"0.3.0\">\r<camera type=\"a\">\r<float name=\"x\" value=\"b\"/>"
              "</camera></scene>"),
        "s.xml:3: expected a number, found \"b\"");
}

// ---- Values

TEST(MitsubaXml, ReadsNumbersStrictly) {
    const auto scene = parse_xml3(R"(<shape type="s">
        <float name="a" value=" -1.5e-3 "/><float name="b" value="+2"/><float name="c" value="5."/>
        <integer name="i" value="-9223372036854775808"/><boolean name="t" value="TRUE"/>
        <point name="p" x="1" y="2" z="3"/><vector name="v" value="4, 5 6"/><vector name="w" value="7"/>
    </shape>)");
    EXPECT_EQ(value_in<double>(scene, "a"), -1.5e-3);
    EXPECT_EQ(value_in<double>(scene, "b"), 2);
    EXPECT_EQ(value_in<double>(scene, "c"), 5);
    EXPECT_EQ(value_in<int64_t>(scene, "i"), std::numeric_limits<int64_t>::min());
    EXPECT_TRUE(value_in<bool>(scene, "t"));
    EXPECT_EQ(value_in<Vec3>(scene, "p"), (Vec3{1, 2, 3}));
    EXPECT_EQ(value_in<Vec3>(scene, "v"), (Vec3{4, 5, 6}));
    EXPECT_EQ(value_in<Vec3>(scene, "w"), (Vec3{7, 7, 7}));
    for (const char* bad : {"", " ", "1.0abc", "nan", "inf", "-inf", "1e999", "0x10", "1 2", "1,2",
                            "--1", "+-1", "1.f"})
        EXPECT_NE(
            error3(fmt::format(R"(<shape type="s"><float name="a" value="{}"/></shape>)", bad))
                .find("s.xml:2: "),
            std::string::npos)
            << bad;
    for (const char* bad : {"", "1.0", "1e3", "9223372036854775808", "0x10", "one"})
        EXPECT_NE(
            error3(fmt::format(R"(<shape type="s"><integer name="a" value="{}"/></shape>)", bad))
                .find("s.xml:2: "),
            std::string::npos)
            << bad;
}

TEST(MitsubaXml, ReadsColours) {
    const auto scene = parse_xml3(R"(<bsdf type="b">
        <rgb name="grey" value="0.25"/><rgb name="three" value="1, 0.5 0"/><rgb name="hex" value="#ff8000"/>
        <srgb name="s" value="#ff8000"/><srgb name="t" value="1 0.5 0"/><spectrum name="c" value="0.2"/>
    </bsdf>)");
    EXPECT_EQ(value_in<Rgb>(scene, "grey"), Rgb(0.25f));
    EXPECT_EQ(value_in<Rgb>(scene, "three"), Rgb(1, 0.5f, 0));
    EXPECT_EQ(value_in<Rgb>(scene, "hex"), Rgb(1, srgb_to_linear(128 / 255.0f), 0));
    EXPECT_EQ(value_in<Rgb>(scene, "s"), value_in<Rgb>(scene, "hex"));
    EXPECT_EQ(value_in<Rgb>(scene, "t"), Rgb(1, srgb_to_linear(0.5f), 0));
    EXPECT_EQ(value_in<Rgb>(scene, "c"), Rgb(0.2f));
    // In Mitsuba 0.6 a hexadecimal <rgb> is linear.
    EXPECT_EQ(
        value_in<Rgb>(parse06(R"(<bsdf type="b"><rgb name="h" value="#ff8000"/></bsdf>)"), "h"),
        Rgb(1, 128 / 255.0f, 0));
}

TEST(MitsubaXml, SpectraUseTheIlluminantOfTheirRole) {
    const char* flat = R"(<{0}><spectrum name="{1}" value="300:0.5, 900:0.5"/></{2}>)";
    const auto colour = [&](const char* open, const char* name, const char* close) {
        return value_in<Rgb>(parse_xml3(fmt::format(fmt::runtime(flat), open, name, close)), name);
    };
    // Values of Mitsuba 3.9 in RGB mode: 0.5 seen under D65, and 0.5 emitted.
    const Rgb seen = colour("bsdf type=\"b\"", "reflectance", "bsdf");
    const Rgb emitted = colour("emitter type=\"area\"", "radiance", "emitter");
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(seen[i], 0.5f, 2e-3f);
    EXPECT_NEAR(emitted.r, 0.6024f, 2e-3f);
    EXPECT_NEAR(emitted.g, 0.4741f, 2e-3f);
    EXPECT_NEAR(emitted.b, 0.4546f, 2e-3f);
    // A reflectance ends at 1, an index of refraction does not.
    const char* two = R"(<bsdf type="b"><spectrum name="{}" value="300:2 900:2"/></bsdf>)";
    EXPECT_EQ(
        value_in<Rgb>(parse_xml3(fmt::format(fmt::runtime(two), "reflectance")), "reflectance"),
        Rgb(1));
    EXPECT_NEAR(value_in<Rgb>(parse_xml3(fmt::format(fmt::runtime(two), "eta")), "eta").g, 2, 0.01);
    // A nested texture of an emitter emits, too.
    const auto nested =
        parse_xml3(R"(<emitter type="area"><texture type="checkerboard" name="radiance">
        <spectrum name="color0" value="300:0.5, 900:0.5"/></texture></emitter>)");
    EXPECT_EQ(value_in<Rgb>(nested, "color0", 1), emitted);
}

// What a texture is used for may be known only behind it.
TEST(MitsubaXml, SpectraOfSharedTexturesHaveTheRoleOfTheirUse) {
    const std::string texture = R"(<texture type="checkerboard" id="t">
        <spectrum name="color0" value="300:3, 900:3"/></texture>)";
    const auto colour = [&](const std::string& uses) {
        return value_in<Rgb>(parse_xml3(texture + uses), "color0");
    };
    const std::string lamp = R"(<emitter type="area"><ref id="t" name="radiance"/></emitter>)",
                      wall = R"(<bsdf type="diffuse"><ref id="t" name="reflectance"/></bsdf>)",
                      scaled = R"(<emitter type="area"><texture type="scale" name="radiance">
                          <ref id="t"/></texture></emitter>)",
                      absorbing = R"(<bsdf type="coating"><ref id="t" name="sigma_a"/></bsdf>)";
    const Rgb emitted = value_in<Rgb>(
        parse_xml3(
            R"(<emitter type="area"><spectrum name="radiance" value="300:3, 900:3"/></emitter>)"),
        "radiance");
    EXPECT_EQ(colour(lamp), emitted);
    EXPECT_EQ(colour(scaled), emitted);
    EXPECT_EQ(colour(wall), Rgb(1));
    EXPECT_EQ(colour(""), Rgb(1));
    EXPECT_NEAR(colour(absorbing).g, 3, 0.02);
    // A lamp keeps its radiance, though the wall has no more than one.
    EXPECT_NEAR(colour(lamp + wall).g, 3, 0.02);
    // A texture of an emitter that a material shares, and the dialect with other names.
    const std::string both = R"(<emitter type="area">)" +
                             std::string(texture).insert(9, "name=\"radiance\" ") + "</emitter>" +
                             wall;
    EXPECT_NEAR(value_in<Rgb>(parse_xml3(both), "color0", 1).g, 3, 0.02);
    EXPECT_EQ(value_in<Rgb>(parse06(texture + lamp), "color0"), emitted);
}

TEST(MitsubaXml, FactorsAndAbsorptionHaveNoUpperBound) {
    const auto scaled = parse_xml3(R"(<bsdf type="diffuse"><texture type="scale" name="reflectance">
        <spectrum name="scale" value="300:3,900:3"/><texture type="checkerboard"/></texture></bsdf>)");
    EXPECT_NEAR(value_in<Rgb>(scaled, "scale", 1).g, 3, 0.02);
    const auto coated = parse_xml3(
        R"(<bsdf type="coating"><spectrum name="sigma_a" value="300:2, 900:2"/></bsdf>)");
    EXPECT_NEAR(value_in<Rgb>(coated, "sigma_a").g, 2, 0.02);
}

TEST(MitsubaXml, NumbersThatAreTooSmallAreZero) {
    const auto scene = parse_xml3(R"(<bsdf type="b"><float name="a" value="1e-400"/>
        <float name="b" value="-0.0000e-99999999999999999999"/><rgb name="c" value="1e-400 1e-46 1"/></bsdf>)");
    EXPECT_EQ(value_in<double>(scene, "a"), 0);
    EXPECT_EQ(value_in<double>(scene, "b"), 0);
    EXPECT_EQ(value_in<Rgb>(scene, "c"), Rgb(0, 0, 1));
    EXPECT_NE(error3(R"(<bsdf type="b"><float name="a" value="1e400"/></bsdf>)")
                  .find("\"1e400\" is out of range for a number"),
              std::string::npos);
}

TEST(MitsubaXml, ReadsSpectrumFilesAndPlugins) {
    const auto options =
        with_files({{"spd/a.spd", "# silver\n400 0.1\n\n500\t0.4 # peak\r\n700 0.2"}});
    const auto from_file = parse_xml3(
        R"(<path value="spd"/><bsdf type="b"><spectrum name="eta" filename="a.spd"/></bsdf>)",
        options);
    const auto from_list = parse_xml3(
        R"(<bsdf type="b"><spectrum name="eta" value="400:0.1 500:0.4 700:0.2"/></bsdf>)");
    EXPECT_EQ(value_in<Rgb>(from_file, "eta"), value_in<Rgb>(from_list, "eta"));
    const auto old_lines = with_files({{"a.spd", "# silver\r400 0.1\r\r500 0.4\r700 0.2\r"}});
    EXPECT_EQ(
        value_in<Rgb>(parse_xml3(R"(<bsdf type="b"><spectrum name="eta" filename="a.spd"/></bsdf>)",
                                 old_lines),
                      "eta"),
        value_in<Rgb>(from_list, "eta"));
    const auto plugins = parse_xml3(R"(<bsdf type="b">
        <spectrum name="eta" type="irregular"><string name="wavelengths" value="400 500 700"/>
            <string name="values" value="0.1 0.4 0.2"/></spectrum>
        <spectrum name="k" type="regular"><float name="wavelength_min" value="400"/>
            <integer name="wavelength_max" value="600"/><string name="values" value="0.1 0.4 0.2"/></spectrum>
        <spectrum name="u" type="uniform"><float name="value" value="3"/></spectrum>
        <spectrum name="d" type="d65"><float name="scale" value="2"/></spectrum></bsdf>
        <emitter type="point"><spectrum name="intensity" type="blackbody"><float name="temperature" value="5000"/>
            </spectrum><blackbody name="other" temperature="5000K" scale="2"/></emitter>)");
    EXPECT_EQ(plugins.objects.size(), 2u);
    EXPECT_EQ(value_in<Rgb>(plugins, "eta"), value_in<Rgb>(from_list, "eta"));
    EXPECT_EQ(
        value_in<Rgb>(plugins, "k"),
        value_in<Rgb>(
            parse_xml3(
                R"(<bsdf type="b"><spectrum name="k" value="400:0.1 500:0.4 600:0.2"/></bsdf>)"),
            "k"));
    EXPECT_EQ(value_in<Rgb>(plugins, "u"), Rgb(3));
    EXPECT_EQ(value_in<Rgb>(plugins, "d"), Rgb(2));
    expect_near_rgb(value_in<Rgb>(plugins, "intensity", 1), blackbody_rgb(5000));
    expect_near_rgb(value_in<Rgb>(plugins, "other", 1), blackbody_rgb(5000) * 2.0f);
}

TEST(MitsubaXml, LaterTransformStepsApplyAfterEarlierOnes) {
    const auto t = value_in<Transform>(parse_xml3(R"(<shape type="s"><transform name="to_world">
        <scale value="2"/><rotate z="3" angle="90"/><translate x="1"/>
        <matrix value="1 0 0 0  0 1 0 0  0 0 1 10  0 0 0 1"/><matrix value="0 1 0  1 0 0  0 0 1"/>
    </transform></shape>)"),
                                       "to_world");
    const Vec3 p = t.point({1, 0, 0});  // (2,0,0), (0,2,0), (1,2,0), (1,2,10), (2,1,10)
    EXPECT_NEAR(p.x, 2, 1e-6);
    EXPECT_NEAR(p.y, 1, 1e-6);
    EXPECT_NEAR(p.z, 10, 1e-6);
}

TEST(MitsubaXml, TheCameraLooksAlongItsZAxisWithXToTheLeft) {
    const auto t = value_in<Transform>(parse_xml3(R"(<sensor type="s"><transform name="to_world">
        <lookat origin="0 0 0" target="0 0 -1" up="0 1 0"/></transform></sensor>)"),
                                       "to_world");
    EXPECT_EQ(t.vector({0, 0, 1}), (Vec3{0, 0, -1}));
    EXPECT_EQ(t.vector({1, 0, 0}), (Vec3{-1, 0, 0}));
    // Without "up", any roll.
    const auto free = value_in<Transform>(parse_xml3(R"(<sensor type="s"><transform name="to_world">
        <lookat origin="1 2 3" target="1 2 8"/></transform></sensor>)"),
                                          "to_world");
    EXPECT_EQ(free.vector({0, 0, 1}), (Vec3{0, 0, 1}));
    EXPECT_NEAR(free.determinant3(), 1, 1e-6);
}

// ---- Parameters of the scene

TEST(MitsubaXml, SubstitutesParameters) {
    ReadOptions options;
    options.defines = {{"spp", "9"}, {"free", "y"}};
    const auto scene =
        parse_xml3(R"(<default name="spp" value="1"/><default name="spp_hi" value="4"/>
        <default name="dir" value="a/$spp"/><default name="dir" value="ignored"/>
        <integrator type="$free"><integer name="n" value="$spp"/><integer name="m" value="$spp_hi"/>
        <string name="s" value="$dir/x-$spp.exr costs \$5"/></integrator>)",
                   options);
    EXPECT_EQ(scene.objects[0].type, "y");
    EXPECT_EQ(value_in<int64_t>(scene, "n"), 9);
    EXPECT_EQ(value_in<int64_t>(scene, "m"), 4);
    EXPECT_EQ(value_in<std::string>(scene, "s"), "a/9/x-9.exr costs $5");
}

TEST(MitsubaXml, OverridesMustBeKnown) {
    ReadOptions options;
    options.defines = {{"sp", "9"}};
    EXPECT_EQ(error3(R"(<default name="spp" value="1"/>)", options),
              "s.xml: the scene has no parameter \"sp\" to set to \"9\" (did you mean \"spp\"?)");
    options.defines = {{"width", "9"}};
    EXPECT_NE(error3(R"(<default name="spp" value="1"/><default name="n" value="1"/>)", options)
                  .find("(known: n, spp)"),
              std::string::npos);
    EXPECT_EQ(error3(R"(<default name="width" value="1"/>)", options),
              "");  // declared, though unused
}

// ---- Objects and references

TEST(MitsubaXml, KeepsNestingNamesAndLocations) {
    const auto scene = parse_xml3("<medium type=\"homogeneous\" id=\"fog\"/>\n"
                                  "<shape type=\"sphere\">\n<bsdf type=\"null\"/>\n"
                                  "<ref name=\"interior\" id=\"fog\"/></shape>");
    ASSERT_EQ(scene.roots, (std::vector<int>{0, 1}));
    const SceneObject& shape = scene.objects[1];
    EXPECT_EQ(shape.where, (SourceLocation{"s.xml", 3}));
    ASSERT_EQ(shape.children.size(), 2u);
    EXPECT_EQ(shape.children[1].name, "interior");
    EXPECT_EQ(shape.children[1].object, 0);
    EXPECT_EQ(shape.children[1].where, (SourceLocation{"s.xml", 5}));
    EXPECT_EQ(scene.objects[0].id, "fog");
}

TEST(MitsubaXml, ReferencesMayPointForward) {
    const auto scene = parse_xml3(R"(<shape type="cube"><ref id="late"/></shape>
        <bsdf type="diffuse" id="m"/><alias id="m" as="late"/><ref id="m"/>)");
    EXPECT_EQ(scene.objects[0].children[0].object, 1);
    EXPECT_EQ(scene.roots, (std::vector<int>{0, 1, 1}));
}

TEST(MitsubaXml, IncludesFilesInPlace) {
    auto options = with_files({
        {"dir/main.xml",
         R"(<scene version="3.0.0"><path value="lib"/><include filename="parts/a.xml"/>
            <shape type="cube"><include filename="m.xml" name="bsdf"/><ref id="a"/></shape></scene>)"},
        {"dir/parts/a.xml",
         R"(<scene version="0.6.0"><default name="d" value="2"/><bsdf type="diffuse" id="a"/>
            <include filename="b.xml"/></scene>)"},
        {"dir/parts/b.xml",
         R"(<scene><shape type="sphere"><float name="maxAngle" value="$d"/></shape></scene>)"},
        {"dir/lib/m.xml",
         R"(<bsdf version="3.0.0" type="mask"><float name="opacity" value="$d"/></bsdf>)"},
    });
    const auto scene = read_mitsuba_xml("dir/main.xml", options);
    EXPECT_EQ(dump(scene),
              "bsdf diffuse id \"a\" #1\n"
              "shape sphere\n"
              "  max_angle: float 2\n"  // b.xml has the dialect of the file that includes it
              "shape cube\n"
              "  bsdf #1\n"
              "  bsdf: bsdf mask\n"
              "    opacity: float 2\n");
    EXPECT_EQ(scene.search_paths, (std::vector<std::string>{"dir", "dir/lib"}));
    EXPECT_EQ(scene.file, "dir/main.xml");
    EXPECT_EQ(scene.objects[1].where, (SourceLocation{"dir/parts/b.xml", 1}));
}

TEST(MitsubaXml, TextInMemoryOpensNoFiles) {
    EXPECT_NE(error3(R"(<include filename="/etc/passwd"/>)").find("cannot read the file"),
              std::string::npos);
}

TEST(MitsubaXml, LenientDropsUnknownElements) {
    ReadOptions options;
    options.lenient = true;
    const auto scene = parse_xml3(
        "<shape type=\"cube\" colour=\"red\">\n<animation type=\"dipole\"><x/></animation>\n"
        "<transform name=\"to_world\"><shear x=\"1\"/></transform></shape>",
        options);
    EXPECT_EQ(dump(scene), "shape cube\n  to_world: transform 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
    ASSERT_EQ(scene.warnings.size(), 3u);
    EXPECT_EQ(scene.warnings[0], "s.xml:2: <shape> has no attribute \"colour\"; dropped");
    EXPECT_EQ(scene.warnings[1], "s.xml:3: unknown element <animation>; dropped");
    EXPECT_EQ(scene.warnings[2], "s.xml:4: a <transform> cannot contain a <shear>; dropped");
    // Malformed input remains an error.
    EXPECT_NE(error3(R"(<shape type="cube"><float name="x" value="1a"/></shape>)", options), "");
}

// ---- Hostile files

std::string repeat(const std::string& text, int n) {
    std::string out;
    for (int i = 0; i < n; ++i) out += text;
    return out;
}

TEST(MitsubaXml, LimitsNesting) {
    const int deep = 200'000;
    EXPECT_NE(error3(repeat("<bsdf type=\"mask\">", deep) + repeat("</bsdf>", deep))
                  .find("nested more than"),
              std::string::npos);
    std::string chain = "<bsdf type=\"mask\" id=\"m0\"/>";
    for (int i = 1; i < 1000; ++i)
        chain += fmt::format(R"(<bsdf type="mask" id="m{}"><ref id="m{}"/></bsdf>)", i, i - 1);
    EXPECT_NE(error3(chain).find("levels deep"), std::string::npos);
}

TEST(MitsubaXml, LimitsIncludes) {
    // Each file includes the next one twice: 2^30 files without a limit.
    Files files;
    for (int i = 0; i < 30; ++i)
        files[fmt::format("{}.xml", i)] = fmt::format(
            R"(<scene version="3.0.0"><include filename="{0}.xml"/><include filename="{0}.xml"/></scene>)",
            i + 1);
    files["30.xml"] = R"(<scene version="3.0.0"/>)";
    EXPECT_NE(
        error3(R"(<include filename="0.xml"/>)", with_files(files)).find("includes more than"),
        std::string::npos);
    files.clear();
    for (int i = 0; i < 100; ++i)
        files[fmt::format("{}.xml", i)] =
            fmt::format(R"(<scene version="3.0.0"><include filename="{}.xml"/></scene>)", i + 1);
    EXPECT_NE(error3(R"(<include filename="0.xml"/>)", with_files(files))
                  .find("more than 32 levels deep"),
              std::string::npos);
}

TEST(MitsubaXml, LimitsSubstitution) {
    std::string text = R"(<default name="p0" value="xxxxxxxxxxxxxxxx"/>)";
    for (int i = 1; i < 64; ++i)
        text += fmt::format(R"(<default name="p{0}" value="$p{1}$p{1}"/>)", i, i - 1);
    EXPECT_NE(error3(text).find("expand to more than"), std::string::npos);
}

TEST(MitsubaXml, ShortensQuotedText) {
    const std::string error = error3(fmt::format(
        R"(<shape type="s"><float name="x" value="{}"/></shape>)", std::string(100'000, 'x')));
    EXPECT_LT(error.size(), 200u);
    EXPECT_LT(error3("<" + std::string(100'000, 'x') + "/>").size(), 2000u);
}

// ---- Real scenes

TEST(MitsubaXml, ReadsTheSharedScenes) {
    const std::vector<std::string> files = testing::shared_files(".xml");
    if (files.empty()) GTEST_SKIP() << "no shared scenes";
    int read = 0;
    for (const std::string& file : files) {
        if (file.find("-mts") == file.npos) continue;
        SCOPED_TRACE(file);
        SceneDescription scene;
        ASSERT_NO_THROW(scene = read_mitsuba_xml(file));
        EXPECT_TRUE(scene.warnings.empty());
        // Each has one integrator, one sensor and at least one emitter, and no name in camel case.
        std::map<std::string, int> count;
        for (const SceneObject& o : scene.objects) {
            ++count[o.category];
            for (const Param& p : o.params)
                EXPECT_EQ(p.name.find_first_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ"), p.name.npos)
                    << p.name;
        }
        EXPECT_EQ(count["integrator"], 1);
        EXPECT_EQ(count["sensor"], 1);
        EXPECT_GE(count["emitter"], 1);
        ++read;
    }
    EXPECT_GT(read, 0);
}

}  // namespace
}  // namespace etendue
