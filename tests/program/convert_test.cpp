// `convert`: the written scene gives the image of the original one, and nothing good is overwritten.

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "image/image_io.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

class ConvertTest : public ::testing::Test {
protected:
    std::string write(const std::string& name, const std::string& contents) const {
        const std::string path = folder.path() / name;
        std::ofstream(path, std::ios::binary) << contents;
        return path;
    }
    ProgramResult run(const std::vector<std::string>& arguments) const {
        return Program(ETENDUE_PROGRAM, arguments, folder.path()).wait();
    }
    std::vector<Rgb> render(const std::string& scene) const {
        const std::string image = folder.path() / "image.pfm";
        const ProgramResult r = run({"render", scene, "-o", image, "--quiet", "--spp", "8",
                                     "--resolution", "24x16", "-i", "bdpt"});
        EXPECT_EQ(r.status, 0) << r.errors;
        return read_rgb(image).pixels;
    }
    /// Differences come from rounding alone: of matrices in the text, and of meshes.
    void expect_round_trip(const std::string& scene) const {
        const std::string converted = folder.path() / "out/converted.xml";
        const ProgramResult r = run({"convert", "--keep-plugins", scene, converted});
        ASSERT_EQ(r.status, 0) << r.errors;
        const std::vector<Rgb> a = render(scene), b = render(converted);
        ASSERT_EQ(a.size(), b.size());
        size_t different = 0;
        double sum_a = 0, sum_b = 0;
        for (size_t i = 0; i < a.size(); ++i) {
            different += std::fabs(a[i].g - b[i].g) > 1e-3f * (a[i].g + b[i].g) + 1e-4f;
            sum_a += a[i].g;
            sum_b += b[i].g;
        }
        EXPECT_GT(sum_a, 0);
        EXPECT_NEAR(sum_b, sum_a, 1e-3 * sum_a);
        EXPECT_LE(different, a.size() / 50);
    }

    TemporaryFolder folder;
};

TEST_F(ConvertTest, MitsubaScenes) {
    expect_round_trip(fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml");
}

TEST_F(ConvertTest, PbrtScenes) {
    expect_round_trip(write("scene.pbrt", R"(
LookAt 0 1 4  0 0.6 0  0 1 0
Camera "perspective" "float fov" 50
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
WorldBegin
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [9 8 7]
  Translate 0 3 0
  Shape "trianglemesh" "point3 P" [-1 0 -1  1 0 -1  1 0 1  -1 0 1] "integer indices" [0 1 2 0 2 3]
AttributeEnd
Material "diffuse" "rgb reflectance" [0.6 0.5 0.4]
Shape "trianglemesh" "point3 P" [-3 0 -3  3 0 -3  3 0 3  -3 0 3] "integer indices" [0 2 1 0 3 2]
AttributeBegin
  Scale -1 1 1
  Translate 0.7 0.5 0
  Material "conductor" "float roughness" 0.2
  Shape "sphere" "float radius" 0.5
  Material "diffuse" "rgb reflectance" [0.1 0.5 0.2]
  Shape "trianglemesh" "point3 P" [-2 -0.5 0  -1 -0.5 0  -1.5 0.8 0.3] "integer indices" [0 1 2]
AttributeEnd
ObjectBegin "ball"
  Material "coateddiffuse" "rgb reflectance" [0.2 0.2 0.7]
  Shape "sphere" "float radius" 0.3
ObjectEnd
AttributeBegin
  Translate 0 0.3 1
  ObjectInstance "ball"
  Translate 1 0.2 -0.6
  ObjectInstance "ball"
AttributeEnd
)"));
}

TEST_F(ConvertTest, GltfScenes) {
    std::string bytes;
    const auto add = [&](std::initializer_list<float> values) {
        for (const float v : values) bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
    };
    add({-1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1});                // a square
    add({1, 0.2f, 0.2f, 0.2f, 1, 0.2f, 0.2f, 0.2f, 1, 1, 1, 1});  // its colours
    write("b.bin", bytes);
    expect_round_trip(write("scene.gltf", R"({"asset":{"version":"2.0"},
        "buffers":[{"uri":"b.bin","byteLength":96}],"bufferViews":[{"buffer":0,"byteLength":48},
        {"buffer":0,"byteOffset":48,"byteLength":48}],"accessors":[
        {"bufferView":0,"componentType":5126,"type":"VEC3","count":4},
        {"bufferView":1,"componentType":5126,"type":"VEC3","count":4}],
        "meshes":[{"primitives":[{"mode":6,"attributes":{"POSITION":0,"COLOR_0":1},"material":0}]},
        {"primitives":[{"mode":6,"attributes":{"POSITION":0},"material":1}]}],
        "materials":[{"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.4}},
        {"emissiveFactor":[1,1,1],"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":5}}}],
        "nodes":[{"mesh":0,"scale":[3,1,3]},{"mesh":0,"translation":[0,0.5,-1],"rotation":[0.5,0,0,0.8660254]},
        {"mesh":1,"translation":[0,3,0],"rotation":[1,0,0,0]},
        {"camera":0,"translation":[0,1,5]}],
        "cameras":[{"type":"perspective","perspective":{"yfov":0.7,"aspectRatio":1.5}}]})"));
}

TEST_F(ConvertTest, ScenesForMitsuba3) {
    const std::string converted = folder.path() / "plain.xml";
    const ProgramResult r =
        run({"convert", fs::path(ETENDUE_SOURCE_DIR) / "tests/scenes/formats/mitsuba06/media.xml",
             converted});
    ASSERT_EQ(r.status, 0) << r.errors;
    const std::string xml = read_text(converted);
    EXPECT_EQ(xml.find("sigma_a"), xml.npos);
    EXPECT_NE(xml.find("sigma_t"), xml.npos);
    EXPECT_NE(xml.find("<integrator type=\"volpath\""), xml.npos);
}

TEST_F(ConvertTest, SaysHowStagesOfUsdAreRead) {
    const ProgramResult r = run({"convert", write("stage.usda", "#usda 1.0\n"), "scene.xml"});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("python -m etendue.usd"), std::string::npos) << r.errors;
}

TEST_F(ConvertTest, RefusesOutputsThatWouldDoHarm) {
    const std::string scene =
        write("scene.xml", R"(<scene version="3.0.0"><emitter type="constant"/>
        <sensor type="perspective"/></scene>)");
    EXPECT_EQ(run({"convert", scene, scene}).status, 1);
    EXPECT_NE(read_text(scene).find("constant"), std::string::npos);
    const ProgramResult r = run({"convert", scene, folder.path() / "out.pbrt"});
    EXPECT_EQ(r.status, 1);
    EXPECT_NE(r.errors.find("the output must be an .xml file"), std::string::npos) << r.errors;
}

}  // namespace
}  // namespace etendue::test
