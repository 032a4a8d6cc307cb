// make_plain_mitsuba(): what it returns has only plug-ins and parameters of Mitsuba 3, and means the same where it can.

#include "scene/plain_mitsuba.h"

#include <filesystem>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "bsdf/material.h"
#include "emitter/emitter.h"
#include "math/frame.h"
#include "math/warp.h"
#include "random.h"
#include "readers/mitsuba_writer.h"
#include "readers/mitsuba_xml.h"
#include "readers/scene_file.h"
#include "scene/builder.h"
#include "scene/mitsuba_manual.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

SceneDescription parsed(const std::string& body) {
    return parse_mitsuba_xml("<scene version=\"3.0.0\">" + body + "</scene>", "scene.xml");
}

const SceneObject& only(const SceneDescription& scene, const char* category) {
    const SceneObject* found = nullptr;
    for (const SceneObject& o : scene.objects)
        if (o.category == category) found = &o;
    EXPECT_TRUE(found) << category;
    static const SceneObject none;
    return found ? *found : none;
}

double number(const SceneObject& o, const char* name) {
    const Param* p = o.find(name);
    EXPECT_TRUE(p) << name;
    return p ? std::get<double>(p->value) : 0;
}
Rgb colour(const SceneObject& o, const char* name) {
    const Param* p = o.find(name);
    EXPECT_TRUE(p) << name;
    return p ? std::get<Rgb>(p->value) : Rgb();
}

/// Every scene of a format.
class PlainScenes : public ::testing::TestWithParam<const char*> {};
TEST_P(PlainScenes, HaveOnlyWhatMitsuba3Has) {
    for (const auto& file : fs::directory_iterator(fs::path(ETENDUE_SOURCE_DIR) /
                                                   "tests/scenes/formats" / GetParam())) {
        SCOPED_TRACE(file.path());
        SceneDescription scene = read_scene_file(file.path());
        make_plain_mitsuba(scene);
        std::vector<int> open = scene.roots;
        int environments = 0;
        for (const int root : scene.roots) {
            const SceneObject& o = scene.objects[size_t(root)];
            environments += o.category == "emitter" &&
                            (o.type == "constant" || o.type == "envmap" || o.type == "sunsky");
        }
        EXPECT_LE(environments, 1);
        while (!open.empty()) {
            const SceneObject& o = scene.objects[size_t(open.back())];
            open.pop_back();
            for (const auto& c : o.children) open.push_back(c.object);
            // The writer makes files of meshes, and a thin surface is made of a plug-in that cannot be read.
            if (o.category == "shape" || o.type == "principledthin") continue;
            const ManualEntry* entry = find_manual_entry(o.category, o.type);
            ASSERT_TRUE(entry && (entry->manuals & kMitsuba3)) << o.category << " " << o.type;
            const std::string all = fmt::format(" {} {} image ", entry->params, entry->params_3);
            for (const Param& p : o.params)
                EXPECT_NE(all.find(" " + p.name + " "), all.npos)
                    << p.name << " of " << o.category << " " << o.type;
        }
    }
}
INSTANTIATE_TEST_SUITE_P(Formats, PlainScenes,
                         ::testing::Values("mitsuba06", "mitsuba3", "pbrt3", "pbrt4", "gltf"),
                         [](const auto& format) { return std::string(format.param); });

/// The message with which a scene cannot be converted, as plain Mitsuba or with its own plug-ins.
std::string refusal(const std::string& body, bool plain) {
    try {
        SceneDescription scene = parsed(body);
        if (plain) make_plain_mitsuba(scene);
        write_mitsuba_xml(scene, "out.xml", "files", [](const SceneFile&) {});
    } catch (const SceneError& e) {
        return e.message();
    }
    return "";
}

TEST(PlainMitsuba, ParametersOfOtherTypesAreRefused) {
    for (const auto& [body, message] : std::vector<std::pair<std::string, std::string>>{
             {"<emitter type=\"spot\"><string name=\"to_world\" value=\"x\"/></emitter>",
              "\"to_world\" of emitter \"spot\" must be a transform, but is a string"},
             {"<shape type=\"sphere\"><emitter type=\"area\"><string name=\"two_sided\" "
              "value=\"x\"/></emitter></shape>",
              "must be a boolean"},
             {"<bsdf type=\"mixturebsdf\"><float name=\"weights\" value=\"1\"/></bsdf>",
              "must be a string"},
             {"<bsdf type=\"roughconductor\"><float name=\"material\" value=\"1\"/></bsdf>",
              "must be a string"},
             {"<emitter type=\"envmap\"><integer name=\"projection\" value=\"1\"/></emitter>",
              "must be a string"}})
        EXPECT_NE(refusal(body, true).find(message), std::string::npos)
            << refusal(body, true) << "\nexpected: " << message;
}

TEST(PlainMitsuba, MeshesAndImagesThatTheFileDoesNotHoldAreNotWritten) {
    for (const bool plain : {false, true}) {
        EXPECT_NE(refusal("<shape type=\"mesh\"/>", plain).find("needs a mesh"), std::string::npos);
        EXPECT_NE(
            refusal("<shape type=\"mesh\"><integer name=\"mesh\" value=\"3\"/></shape>", plain)
                .find("needs a mesh"),
            std::string::npos);
        for (const char* type : {"integer", "string"}) {
            // Without effect, since the scene has no images of its own; a string is of the wrong type.
            const std::string text = refusal(
                std::string(
                    "<bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\"><") +
                    type + " name=\"image\" value=\"7\"/></texture></bsdf>",
                plain);
            EXPECT_EQ(text.find("must be an integer") != std::string::npos,
                      plain && type == std::string("string"))
                << text;
        }
    }
}

TEST(PlainMitsuba, CoefficientsBecomeExtinctionAndAlbedo) {
    SceneDescription scene =
        parsed(R"(<shape type="sphere"><medium type="homogeneous" name="interior">
        <rgb name="sigma_a" value="1 2 4"/><rgb name="sigma_s" value="0 0 0"/><float name="scale" value="0.5"/>
        </medium></shape>)");
    EXPECT_TRUE(make_plain_mitsuba(scene).empty());
    const SceneObject& medium = only(scene, "medium");
    const double scale = number(medium, "scale");
    const Rgb sigma_t = colour(medium, "sigma_t");
    EXPECT_LE(sigma_t.max(), 1);  // Mitsuba 3 refuses colours above 1
    EXPECT_FLOAT_EQ(sigma_t.r * float(scale), 0.5f);
    EXPECT_FLOAT_EQ(sigma_t.b * float(scale), 2);
    EXPECT_EQ(colour(medium, "albedo"), Rgb(0));
    EXPECT_FALSE(medium.find("sigma_a"));
    EXPECT_FALSE(medium.find("sigma_s"));
}

TEST(PlainMitsuba, FilmsAndIntegrators) {
    SceneDescription scene = parsed(R"(<integrator type="bdpt"><integer name="max_depth" value="7"/>
        </integrator><sensor type="perspective"><film type="ldrfilm"><integer name="width" value="20"/>
        <string name="file_format" value="jpeg"/><boolean name="high_quality_edges" value="true"/>
        <float name="exposure" value="1"/></film></sensor>)");
    EXPECT_TRUE(make_plain_mitsuba(scene).empty());
    const SceneObject& film = only(scene, "film");
    EXPECT_EQ(film.type, "hdrfilm");
    EXPECT_EQ(film.params.size(), 2u);
    EXPECT_TRUE(film.find("width"));
    EXPECT_TRUE(film.find("sample_border"));
    const SceneObject& integrator = only(scene, "integrator");
    EXPECT_EQ(integrator.type, "path");
    ASSERT_TRUE(integrator.find("max_depth"));
    EXPECT_EQ(std::get<int64_t>(integrator.find("max_depth")->value), 7);
}

/// Mitsuba 3 has neither the other methods nor their parameters.
TEST(PlainMitsuba, EveryIntegratorBecomesOneOfMitsuba) {
    for (const char* type :
         {"vcm", "upg+bdpt", "mmlt", "light", "ptracer", "sppm", "no_such", "aov"}) {
        SceneDescription scene = parsed(
            "<integrator type=\"" + std::string(type) +
            "\"><integer name=\"max_depth\" value=\"7\"/><float name=\"radius\" value=\"1\"/>"
            "<boolean name=\"merges\" value=\"false\"/></integrator>");
        make_plain_mitsuba(scene);
        const SceneObject& integrator = only(scene, "integrator");
        EXPECT_EQ(integrator.type, "path") << type;
        EXPECT_EQ(integrator.params.size(), 1u) << type;
        EXPECT_TRUE(integrator.find("max_depth")) << type;
    }
}

/// Of Mitsuba's integrators, `path` and `direct` ignore media, and count passing through a surface without an effect.
TEST(PlainMitsuba, IntegratorsSeeMediaAndPassThroughMasks) {
    const std::string ink = R"(<shape type="sphere"><bsdf type="null"/>
        <medium type="homogeneous" name="interior"><float name="albedo" value="0"/></medium></shape>)";
    const std::string mask = R"(<shape type="sphere"><bsdf type="mask"/></shape>)";
    const auto converted = [](const std::string& integrator, const std::string& shape) {
        SceneDescription scene = parsed(integrator + shape);
        make_plain_mitsuba(scene);
        const SceneObject& o = only(scene, "integrator");
        const Param* depth = o.find("max_depth");
        return fmt::format("{} {}", o.type, depth ? std::get<int64_t>(depth->value) : -1);
    };
    const std::string path =
        R"(<integrator type="path"><integer name="max_depth" value="5"/></integrator>)";
    const std::string direct = R"(<integrator type="direct"/>)";
    EXPECT_EQ(converted(path, ""), "path 5");
    EXPECT_EQ(converted(direct, ""), "direct -1");
    for (const std::string& shape : {ink, mask}) {
        EXPECT_EQ(converted(path, shape), "volpath 5") << shape;
        EXPECT_EQ(converted(direct, shape), "volpath 2") << shape;
    }
}

TEST(PlainMitsuba, SkyIsSunAndSkyWithoutSun) {
    SceneDescription scene = parsed(R"(<emitter type="sky"><float name="scale" value="3"/>
        <integer name="resolution" value="64"/></emitter>)");
    const std::vector<std::string> warnings = make_plain_mitsuba(scene);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("no parameter \"resolution\" of emitter \"sky\""), std::string::npos)
        << warnings[0];
    const SceneObject& sky = only(scene, "emitter");
    EXPECT_EQ(sky.type, "sunsky");
    EXPECT_EQ(number(sky, "sky_scale"), 3);
    EXPECT_EQ(number(sky, "sun_scale"), 0);
    EXPECT_EQ(sky.params.size(), 2u);
}

TEST(PlainMitsuba, MixturesAreBlendsWithTheSameShares) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="mixturebsdf">
        <string name="weights" value="0.2, 0.3"/><bsdf type="diffuse"/><bsdf type="plastic"/></bsdf></shape>)");
    EXPECT_TRUE(make_plain_mitsuba(scene).empty());
    const SceneObject& shape = only(scene, "shape");
    const SceneObject& outer = scene.objects[size_t(shape.children[0].object)];
    EXPECT_EQ(outer.type, "blendbsdf");
    EXPECT_NEAR(number(outer, "weight"), 0.8, 1e-12);
    ASSERT_EQ(outer.children.size(), 2u);
    const SceneObject& inner = scene.objects[size_t(outer.children[1].object)];
    EXPECT_EQ(inner.type, "blendbsdf");
    EXPECT_NEAR(number(inner, "weight"), 0.5 / 0.8, 1e-12);  // of black
}

TEST(PlainMitsuba, StandInsAreReported) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="orennayar">
        <rgb name="reflectance" value="0.1 0.2 0.3"/><float name="sigma" value="30"/></bsdf></shape>)");
    const std::vector<std::string> warnings = make_plain_mitsuba(scene);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("Mitsuba 3 has no bsdf \"orennayar\": bsdf \"diffuse\" stands in"),
              std::string::npos)
        << warnings[0];
    EXPECT_EQ(colour(only(scene, "bsdf"), "reflectance"), Rgb(0.1f, 0.2f, 0.3f));
}

TEST(PlainMitsuba, CoatsHaveAnInterface) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="fresnelblend">
        <rgb name="specular_reflectance" value="0"/></bsdf></shape>)");
    make_plain_mitsuba(scene);
    EXPECT_EQ(only(scene, "bsdf").type, "roughplastic");
    EXPECT_GT(number(only(scene, "bsdf"), "int_ior"), number(only(scene, "bsdf"), "ext_ior"));
}

TEST(PlainMitsuba, TexturesOfUvBecomeImages) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="diffuse">
        <texture type="gridtexture" name="reflectance"/></bsdf></shape>)");
    make_plain_mitsuba(scene);
    const SceneObject& bsdf = only(scene, "bsdf");
    ASSERT_EQ(bsdf.children.size(), 1u);
    const SceneObject& texture = scene.objects[size_t(bsdf.children[0].object)];
    EXPECT_EQ(texture.type, "bitmap");
    ASSERT_EQ(scene.images.size(), 1u);
    EXPECT_TRUE(scene.images[0]->bytes.starts_with("PF\n"));
}

// The pixels of a square image have one colour each, so the other image is much finer.
TEST(PlainMitsuba, SquareEnvironmentsAreFine) {
    SceneDescription scene = read_scene_file(std::string(ETENDUE_SOURCE_DIR) +
                                             "/tests/scenes/formats/pbrt4/environment.pbrt");
    make_plain_mitsuba(scene);
    ASSERT_EQ(scene.images.size(), 1u);
    EXPECT_TRUE(scene.images[0]->bytes.starts_with("PF\n1024 512\n"));
}

/// The intensity of the only emitter at an angle to its beam, which is turned by half a radian about +x from +z; `around`
/// says in which plane.
float intensity_at(const Scene& scene, float degrees, float around) {
    const Frame frame = Frame::from_normal({0, -std::sin(0.5f), std::cos(0.5f)});
    const float radians = degrees * kPi / 180;
    const Vec3 d = frame.to_world({std::sin(radians) * std::cos(around),
                                   std::sin(radians) * std::sin(around), std::cos(radians)});
    return scene.emitters().front()->eval_emission({}, {}, 0, d).Le_cos.g;
}

// Mitsuba's spots fall off linearly in the angle alone.
TEST(PlainMitsuba, FalloffOfSpotsBecomesAnImage) {
    const auto spot = [](const std::string& falloff, int cutoff, const char* scale) {
        return parsed(fmt::format(
            R"(<sensor type="perspective"/><shape type="rectangle"/><emitter type="spot">
            <rgb name="intensity" value="3"/><float name="cutoff_angle" value="{}"/>
            <float name="beam_width" value="15"/><string name="falloff" value="{}"/>
            <transform name="to_world"><scale value="{}"/><rotate x="1" angle="28.647890"/>
            </transform></emitter>)",
            cutoff, falloff, scale));
    };
    for (const char* falloff : {"smooth", "quartic", "quadratic"})
        for (const int cutoff : {20, 40, 70}) {
            SCOPED_TRACE(fmt::format("{} {}", falloff, cutoff));
            SceneDescription plain = spot(falloff, cutoff, "1");
            const Scene original = build_scene(plain);
            const std::vector<std::string> warnings = make_plain_mitsuba(plain);
            ASSERT_EQ(warnings.size(), 1u);
            EXPECT_NE(warnings[0].find(fmt::format("no falloff \"{}\"", falloff)),
                      std::string::npos)
                << warnings[0];
            EXPECT_FALSE(only(plain, "emitter").find("falloff"));
            const Scene scene = build_scene(plain);
            for (const float share : {0.0f, 0.3f, 0.5f, 0.7f, 0.9f, 1.1f})
                for (const float around : {0.0f, 0.8f, 2.0f})
                    EXPECT_NEAR(intensity_at(scene, share * float(cutoff), around),
                                intensity_at(original, share * float(cutoff), around), 0.012)
                        << share << " " << around;
        }

    // Lights with an image cannot be distorted.
    SceneDescription distorted = spot("smooth", 30, "1 2 1");
    make_plain_mitsuba(distorted);
    EXPECT_NO_THROW(build_scene(distorted));

    SceneDescription linear = spot("angle", 30, "1");
    EXPECT_TRUE(make_plain_mitsuba(linear).empty());
    EXPECT_FALSE(only(linear, "emitter").find("falloff"));

    SceneDescription wide = spot("smooth", 88, "1");
    const std::vector<std::string> left_out = make_plain_mitsuba(wide);
    ASSERT_EQ(left_out.size(), 1u);
    EXPECT_NE(left_out[0].find("no parameter \"falloff\""), std::string::npos) << left_out[0];
}

// Mitsuba has no point light whose intensity in all directions is an image.
TEST(PlainMitsuba, GoniometricLightsBecomeProjectors) {
    for (const char* projection : {"latlong", "equalarea"})
        for (const char* amount : {"<rgb name=\"intensity\" value=\"1 2 3\"/>",
                                   "<float name=\"power\" value=\"20\"/>"}) {
            SCOPED_TRACE(fmt::format("{} {}", projection, amount));
            SceneDescription plain = parsed(fmt::format(
                R"(<sensor type="perspective"/><shape type="rectangle"/>
                <emitter type="goniometric"><string name="filename" value="{}"/>
                <string name="projection" value="{}"/>{}<transform name="to_world">
                <rotate x="1" y="2" angle="40"/><translate x="1" y="2" z="3"/></transform>
                </emitter>)",
                ETENDUE_SOURCE_DIR "/tests/scenes/formats/data/image.ppm", projection, amount));
            const Scene original = build_scene(plain);
            const std::vector<std::string> warnings = make_plain_mitsuba(plain);
            ASSERT_EQ(warnings.size(), 1u);
            EXPECT_NE(warnings[0].find("six of \"projector\""), std::string::npos) << warnings[0];
            const Scene scene = build_scene(plain);
            ASSERT_EQ(scene.emitters().size(), 6u);

            constexpr int kDirections = 2000;
            testing::Random random(1);
            int edges = 0;
            for (int i = 0; i < kDirections; ++i) {
                const Vec3 d = sample_uniform_sphere(random.next_2d());
                DirectSample from_original, s;
                const Vec3 at = Vec3{1, 2, 3} + d;
                ASSERT_TRUE(original.emitters().front()->sample_direct(at, {}, from_original));
                Rgb sum;
                for (const auto& face : scene.emitters())
                    if (face->sample_direct(at, {}, s)) sum += s.Le;
                for (int c = 0; c < 3; ++c)
                    if (!(std::fabs(sum[c] - from_original.Le[c]) <
                          0.03f * from_original.Le[c] + 0.01f)) {
                        ++edges;
                        break;
                    }
            }
            // Of the few pixels of the image.
            EXPECT_LT(edges, kDirections / 20);
        }
}

// Mitsuba 3 renders no bump map of another texture: it has no gradient of it.
TEST(PlainMitsuba, BumpMapsAreOfImages) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="bumpmap">
        <texture type="checkerboard" name="arbitrary"/><bsdf type="diffuse">
        <texture type="checkerboard" name="reflectance"/></bsdf></bsdf></shape>)");
    make_plain_mitsuba(scene);
    for (const SceneObject& o : scene.objects)
        for (const SceneObject::Child& c : o.children) {
            const SceneObject& texture = scene.objects[size_t(c.object)];
            if (texture.category == "texture") {
                EXPECT_EQ(texture.type, o.type == "bumpmap" ? "bitmap" : "checkerboard");
            }
        }
    EXPECT_EQ(scene.images.size(), 1u);
}

// A bump map whose texture Mitsuba 3 lacks is no bump map: it refuses one without texture.
TEST(PlainMitsuba, ReliefWithoutTextureIsLeftOut) {
    SceneDescription scene = parsed(R"(<bsdf type="bumpmap" id="rough"><texture type="scale">
        <texture type="fbm" name="value"/><float name="scale" value="0.1"/></texture>
        <bsdf type="diffuse"/></bsdf><shape type="sphere"><ref id="rough"/></shape>
        <shape type="cube"><bsdf type="twosided"><bsdf type="bumpmap"><texture type="fbm"/>
        <bsdf type="plastic"/></bsdf></bsdf></shape>)");
    const std::vector<std::string> warnings = make_plain_mitsuba(scene);
    ASSERT_EQ(warnings.size(), 2u);
    for (const std::string& w : warnings)
        EXPECT_NE(w.find("Mitsuba 3 has no such texture for bsdf \"bumpmap\": the relief is left "
                         "out"),
                  std::string::npos)
            << w;
    const std::string xml = write_mitsuba_xml(scene, "out.xml", "files", [](const SceneFile&) {});
    EXPECT_EQ(xml.find("bumpmap"), std::string::npos) << xml;
    EXPECT_NE(xml.find("plastic"), std::string::npos) << xml;
    EXPECT_NE(xml.find("<ref id="), std::string::npos) << xml;
}

TEST(PlainMitsuba, ReliefOfAConstantIsLeftOutInSilence) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="bumpmap"><texture
        type="constant"/><bsdf type="diffuse"/></bsdf></shape>)");
    EXPECT_TRUE(make_plain_mitsuba(scene).empty());
    EXPECT_EQ(scene.objects[size_t(only(scene, "shape").children[0].object)].type, "diffuse");
}

/// The only warning of a scene with this shape.
std::string warning_of(const std::string& inside) {
    SceneDescription scene = parsed("<shape type=\"sphere\">" + inside + "</shape>");
    const std::vector<std::string> warnings = make_plain_mitsuba(scene);
    EXPECT_EQ(warnings.size(), 1u) << fmt::format("{}", fmt::join(warnings, "\n"));
    return warnings.empty() ? "" : warnings[0];
}

TEST(PlainMitsuba, EveryApproximationIsReported) {
    const std::string image = std::string("<string name=\"filename\" value=\"") +
                              ETENDUE_SOURCE_DIR + "/tests/scenes/formats/data/image.ppm\"/>";
    const auto bitmap = [&](const std::string& modes) {
        return "<bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\">" + image +
               modes + "</texture></bsdf>";
    };
    const std::pair<std::string, const char*> cases[] = {
        {bitmap(R"(<string name="wrap_mode_v" value="mirror"/>)"),
         "wraps images in the same way along u and v"},
        {bitmap(R"(<string name="wrap_mode" value="zero"/>)"), "no wrap mode \"zero\""},
        {R"(<bsdf type="roughplastic"><float name="alpha_u" value="0.1"/>
            <float name="alpha_v" value="0.4"/></bsdf>)",
         "their geometric mean stands in"},
        {R"(<bsdf type="principled"><rgb name="specular_color" value="1 0.5 0.2"/></bsdf>)",
         "\"specular_weight\" and \"specular_color\""},
        {R"(<bsdf type="openpbr"><float name="coat_weight" value="0.5"/></bsdf>)",
         "\"principled\" stands in for it; white surfaces reflect 0.70 to 1.05"},
        {R"(<bsdf type="openpbr"><float name="coat_weight" value="0.5"/></bsdf>)",
         "as if \"coat_affect_ior\" and \"coat_affect_roughness\" were 0"},
        {R"(<bsdf type="openpbr"><float name="coat_weight" value="0.5"/>
            <float name="coat_affect_ior" value="0"/></bsdf>)",
         "\"coat_affect_roughness\" were 0"},
        {R"(<bsdf type="mixturebsdf"><string name="weights" value="0.9 0.4"/>
            <boolean name="ensure_energy_conservation" value="false"/><bsdf type="diffuse"/>
            <bsdf type="diffuse"/></bsdf>)",
         "no weights with a sum above one"},
        {R"(<bsdf type="mask"><bsdf type="diffuse"/></bsdf><emitter type="area"/>)",
         "through its mask"},
        {R"(<bsdf type="mask"><texture type="mesh_attribute" name="opacity"><string name="name"
            value="vertex_alpha"/></texture><bsdf type="diffuse"/></bsdf>)",
         "its mean stands in"},
    };
    for (const auto& [inside, expected] : cases)
        EXPECT_NE(warning_of(inside).find(expected), std::string::npos) << expected << "\n"
                                                                        << warning_of(inside);
}

// Of a coat that changes nothing below it, nothing is lost; nor without a coat.
TEST(PlainMitsuba, CoatsThatAffectNothingAreNotReported) {
    for (const char* inside : {R"(<bsdf type="openpbr"><float name="coat_weight" value="0.5"/>
             <float name="coat_affect_ior" value="0"/>
             <float name="coat_affect_roughness" value="0"/></bsdf>)",
                               R"(<bsdf type="openpbr"/>)"})
        EXPECT_EQ(warning_of(inside).find("coat_affect"), std::string::npos) << inside;
}

/// Albedo for light from a direction, by the midpoint rule, of the diffuse part of the only shape's material.
Rgb diffuse_albedo(const SceneDescription& description, float cos_o) {
    const Scene scene = build_scene(description);
    const Vec3 wo{std::sqrt(1 - cos_o * cos_o), 0, cos_o}, n{0, 0, 1};
    ComponentArena arena;
    const Bsdf bsdf =
        scene.shapes()[0].material->bsdf({{}, n, n, {1, 0, 0}, {0, 1, 0}, {0.5f, 0.5f}, wo}, arena);
    constexpr int kSteps = 64;
    Rgb sum;
    for (int i = 0; i < kSteps * kSteps; ++i) {
        // Uniform in cos² θ: f cos / (cos / π).
        const float cosine = std::sqrt((float(i % kSteps) + 0.5f) / kSteps),
                    phi = 2 * kPi * (float(i / kSteps) + 0.5f) / kSteps,
                    sine = std::sqrt(1 - cosine * cosine);
        const Vec3 wi{sine * std::cos(phi), sine * std::sin(phi), cosine};
        sum += bsdf.eval(wo, wi, TransportMode::Radiance).f * (kPi / cosine);
    }
    return sum * (1.0f / (kSteps * kSteps));
}

// pbrt's coats absorb, about 2.5 % on the way through and back again.
TEST(PlainMitsuba, CoatsKeepTheirMeanAbsorption) {
    for (const char* nonlinear : {"true", "false"}) {
        const auto scene = [&](const char* thickness) {
            return parsed(fmt::format(
                R"(<sensor type="perspective"/><emitter type="constant"/><shape type="rectangle">
                <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.2 0.5 0.9"/>
                <boolean name="nonlinear" value="{}"/><float name="thickness" value="{}"/></bsdf>
                </shape>)",
                nonlinear, thickness));
        };
        const SceneDescription coated = scene("0.01"), clear = scene("0");
        SceneDescription plain = coated;
        const std::vector<std::string> warnings = make_plain_mitsuba(plain);
        ASSERT_EQ(warnings.size(), 1u);
        EXPECT_NE(warnings[0].find("the mean absorption of the coat"), std::string::npos);
        EXPECT_FALSE(only(plain, "bsdf").find("thickness"));
        for (const float cosine : {0.9f, 0.5f}) {
            const Rgb a = diffuse_albedo(coated, cosine), b = diffuse_albedo(plain, cosine),
                      without = diffuse_albedo(clear, cosine);
            for (int c = 0; c < 3; ++c) {
                EXPECT_NEAR(b[c] / a[c], 1, 0.004) << cosine << " " << c;
                EXPECT_GT(without[c] / a[c], 1.015) << cosine << " " << c;
            }
        }
    }
}

TEST(PlainMitsuba, ReflectanceBecomesAnIndexOfRefraction) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="principled">
        <float name="eta" value="1000"/><rgb name="specular_color" value="0.04"/></bsdf></shape>)");
    make_plain_mitsuba(scene);
    EXPECT_NEAR(number(only(scene, "bsdf"), "eta"), 1.5, 0.01);
    EXPECT_FALSE(only(scene, "bsdf").find("specular_color"));
}

TEST(PlainMitsuba, OpenPbrBecomesPrincipled) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="openpbr">
        <rgb name="base_color" value="0.8 0.4 0.2"/><float name="base_weight" value="0.5"/>
        <float name="base_metalness" value="0.25"/><float name="specular_weight" value="0.25"/>
        <float name="specular_roughness" value="0.6"/>
        <float name="specular_roughness_anisotropy" value="0.45"/>
        <float name="coat_weight" value="0.3"/><float name="coat_roughness" value="0.2"/>
        <rgb name="coat_color" value="0.5"/><float name="fuzz_weight" value="0.7"/></bsdf></shape>)");
    make_plain_mitsuba(scene);
    const SceneObject& o = only(scene, "bsdf");
    EXPECT_EQ(o.type, "principled");
    EXPECT_EQ(*o.find("base_color")->as<Rgb>(), Rgb(0.4f, 0.2f, 0.1f));
    for (const auto& [name, value] : {std::pair("metallic", 0.25),
                                      {"roughness", 0.6},
                                      {"eta", 11.0 / 9},
                                      {"anisotropic", 0.5},
                                      {"clearcoat", 0.3},
                                      {"clearcoat_gloss", 0.06 / 0.099},
                                      {"sheen", 0.7}})
        EXPECT_NEAR(number(o, name), value, 1e-6) << name;
    EXPECT_EQ(o.params.size(), 8u);
}

TEST(PlainMitsuba, ThinGlassOfOpenPbrIsABlendWithAPane) {
    SceneDescription scene = parsed(R"(<shape type="sphere"><bsdf type="openpbr">
        <rgb name="transmission_color" value="0.5 1 1"/><float name="transmission_weight" value="0.75"/>
        <float name="specular_ior" value="1.4"/><boolean name="thin_walled" value="true"/></bsdf></shape>)");
    make_plain_mitsuba(scene);
    const auto of = [&](const char* type) {
        for (const SceneObject& o : scene.objects)
            if (o.type == type) return o;
        throw std::runtime_error(type);
    };
    EXPECT_EQ(number(of("blendbsdf"), "weight"), 0.75);
    EXPECT_EQ(number(of("thindielectric"), "int_ior"), 1.4);
    EXPECT_EQ(*of("thindielectric").find("specular_transmittance")->as<Rgb>(), Rgb(0.5f, 1, 1));
    EXPECT_EQ(number(of("principled"), "eta"), 1.4);
    EXPECT_EQ(of("twosided").children.size(), 1u);
    // Solid glass has the colour of the glass.
    SceneDescription solid = parsed(R"(<shape type="sphere"><bsdf type="openpbr">
        <rgb name="transmission_color" value="0.5 1 1"/><float name="transmission_weight" value="1"/></bsdf></shape>)");
    make_plain_mitsuba(solid);
    EXPECT_EQ(number(only(solid, "bsdf"), "spec_trans"), 1);
    EXPECT_EQ(*only(solid, "bsdf").find("base_color")->as<Rgb>(), Rgb(0.5f, 1, 1));
}

// The principled model of Mitsuba 3 is black from behind.
TEST(PlainMitsuba, ThinOpaqueOpenPbrIsSeenFromBothSides) {
    const std::string material =
        R"(<bsdf type="openpbr" id="leaf"><boolean name="thin_walled" value="true"/>
        <rgb name="transmission_color" value="0.5 1 1"/></bsdf>)";
    for (const bool is_nested : {false, true}) {
        SceneDescription scene =
            parsed("<shape type=\"sphere\">" +
                   (is_nested ? "<bsdf type=\"twosided\">" + material + "</bsdf>" : material) +
                   "</shape>");
        make_plain_mitsuba(scene);
        int count = 0;
        for (const SceneObject& o : scene.objects) {
            if (o.type != "twosided") continue;
            ++count;
            ASSERT_EQ(o.children.size(), 1u);
            const SceneObject& inner = scene.objects[size_t(o.children[0].object)];
            EXPECT_EQ(inner.type, "principled");
            EXPECT_FALSE(inner.find("thin_walled") || inner.find("transmission_color"));
            EXPECT_EQ(o.id, is_nested ? "" : "leaf");
        }
        EXPECT_EQ(count, 1);
    }
    // A surface that is not thin stays as it is.
    SceneDescription solid = parsed("<shape type=\"sphere\"><bsdf type=\"openpbr\"/></shape>");
    make_plain_mitsuba(solid);
    EXPECT_EQ(only(solid, "bsdf").type, "principled");
}

TEST(PlainMitsuba, ColoursOfMeshesAreWrittenAsFloats) {
    SceneDescription scene = read_scene_file(std::string(ETENDUE_SOURCE_DIR) +
                                             "/tests/scenes/formats/mitsuba3/textures.xml");
    make_plain_mitsuba(scene);
    int count = 0;
    write_mitsuba_xml(scene, "out.xml", "files", [&](const SceneFile& file) {
        count += file.name.ends_with(".ply") &&
                 file.bytes.find("property float r\n") != std::string::npos;
    });
    EXPECT_GT(count, 0);
}

}  // namespace
}  // namespace etendue::test
