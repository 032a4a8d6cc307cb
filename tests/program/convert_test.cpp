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

/// A Python that is a shell script: `python3` of a virtual environment, with the arguments of the command in "$@".
class StageTest : public ConvertTest {
protected:
    void SetUp() override {
        write("stage.usda", "#usda 1.0\n");
        setenv("VIRTUAL_ENV", (folder.path() / "venv").c_str(), 1);
        setenv("TMPDIR", (folder.path() / "tmp").c_str(), 1);
        setenv("PATH", (folder.path() / "none").c_str(), 1);
        fs::create_directories(folder.path() / "tmp");
    }
    void TearDown() override {
        unsetenv("VIRTUAL_ENV");
        unsetenv("TMPDIR");
        setenv("PATH", path.c_str(), 1);
    }
    void python(const std::string& script) const {
        fs::create_directories(folder.path() / "venv/bin");
        const std::string file =
            write("venv/bin/python3", "#!/bin/sh\nPATH=" + path + "\n" + script);
        fs::permissions(file, fs::perms::owner_all);
    }
    /// Without what a test leaves behind.
    void expect_no_temporary_files() const { EXPECT_TRUE(fs::is_empty(folder.path() / "tmp")); }
    /// Of a script that writes a scene with a mesh and an image of its own, and another image of the stage.
    std::string writes_scene() const {
        write("wood.pfm", "Pf\n1 1\n-1\n" + std::string(4, '\0'));
        const std::string picture =
            write("picture.pfm", "Pf\n1 1\n-1\n" + std::string("\0\0\0?", 4));
        return R"(
for out; do :; done
mkdir "$(dirname "$out")/scene_files"
cp ")" + picture +
               R"(" "$(dirname "$out")/scene_files/image0.pfm"
cat >"$(dirname "$out")/scene_files/mesh0.ply" <<END
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
-1 -1 0
1 -1 0
0 1 0
3 0 1 2
END
cat >"$out" <<END
<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/>
<sensor type="perspective" id="/Camera"><transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/>
</transform></sensor>
<shape type="ply" id="/A"><string name="filename" value="scene_files/mesh0.ply"/><bsdf type="diffuse">
<texture name="reflectance" type="bitmap"><string name="filename" value="scene_files/image0.pfm"/></texture></bsdf></shape>
<shape type="rectangle" id="/B"><bsdf type="diffuse">
<texture name="reflectance" type="bitmap"><string name="filename" value=")" +
               (folder.path() / "wood.pfm").string() + R"("/></texture></bsdf></shape></scene>
END
echo "warning: stage.usda: /C: has no effect" >&2
)";
    }

private:
    std::string path = std::getenv("PATH");
};

TEST_F(StageTest, AreConvertedAndRenderedByThePythonPackage) {
    python(writes_scene());
    const std::string out = folder.path() / "out/scene.xml";
    const ProgramResult r = run({"convert", folder.path() / "stage.usda", out});
    ASSERT_EQ(r.status, 0) << r.errors;
    EXPECT_EQ(r.errors, "warning: stage.usda: /C: has no effect\n");
    expect_no_temporary_files();
    const std::string xml = read_text(out);
    EXPECT_NE(xml.find("value=\"../wood.pfm\""), xml.npos) << xml;
    EXPECT_NE(xml.find("scene_files/image0.pfm"), xml.npos) << xml;
    EXPECT_EQ(xml.find(folder.path() / "tmp"), xml.npos) << xml;
    const std::vector<Rgb> a = render(folder.path() / "stage.usda"), b = render(out);
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].g, b[i].g);
    expect_no_temporary_files();
}

TEST_F(StageTest, NeedNoCommandAndMayHaveAnyName) {
    python(writes_scene());
    const std::string name = write("-a b'\"$HOME;&.usda", "#usda 1.0\n");
    const std::string image = folder.path() / "image.pfm";
    const ProgramResult r =
        run({name, "-o", image, "--quiet", "--spp", "1", "--resolution", "4x4"});
    EXPECT_EQ(r.status, 0) << r.errors;
    EXPECT_TRUE(fs::exists(image));
}

TEST_F(StageTest, ArgumentsGoToTheCommand) {
    const std::string words = folder.path() / "words.txt";
    python("shift 2\nprintf '[%s]' \"$@\" >" + words + "\n" + writes_scene());
    const ProgramResult r =
        run({"convert", folder.path() / "stage.usda", "--lenient", "-D", "/A/B:paint=light red",
             "-D", "time=3", "-D", "purpose=a,b", folder.path() / "out.xml"});
    ASSERT_EQ(r.status, 0) << r.errors;
    const std::string text = read_text(words);
    EXPECT_TRUE(text.starts_with("[--variant=/A/B:paint=light red][--purpose=a][--purpose=b]"
                                 "[--time=3][--lenient][--][" +
                                 (folder.path() / "stage.usda").string() + "][" +
                                 (folder.path() / "tmp").string()))
        << text;
    const ProgramResult unknown = run({"info", folder.path() / "stage.usda", "-D", "spp=3"});
    EXPECT_EQ(unknown.status, 1);
    EXPECT_NE(unknown.errors.find("scenes of USD have no parameter \"spp\""), std::string::npos)
        << unknown.errors;
}

TEST_F(StageTest, FailuresSayWhyAndReplaceNothing) {
    const std::string stage = folder.path() / "stage.usda", out = write("out.xml", "kept");
    const auto errors = [&] {
        const ProgramResult r = run({"convert", stage, out});
        EXPECT_EQ(r.status, 1);
        EXPECT_EQ(read_text(out), "kept");
        expect_no_temporary_files();
        return r.errors;
    };
    EXPECT_NE(errors().find("which needs a python3 in PATH"), std::string::npos) << errors();
    python("echo \"$0: No module named etendue.usd\"; exit 1");
    EXPECT_NE(errors().find("cannot be used ("), std::string::npos) << errors();
    EXPECT_NE(errors().find("pip install '.[usd]'"), std::string::npos) << errors();
    python("echo 'Traceback'; echo 'RuntimeError: no stage: pip install usd-core'; exit 1");
    EXPECT_NE(errors().find("python3: no stage: pip install usd-core)"), std::string::npos)
        << errors();
    python("echo 'warning: w'; echo 'etendue.usd: " + stage + ": /A: is wrong'; exit 1");
    EXPECT_EQ(errors(), "etendue: " + stage + ": /A: is wrong\n");
    python("kill -9 $$");
    EXPECT_NE(errors().find("ended with the status 137"), std::string::npos) << errors();
    python("exit 0");
    EXPECT_NE(errors().find("scene.xml"), std::string::npos) << errors();
    write("venv/bin/python3", "#!/none\n");
    EXPECT_NE(errors().find("cannot start"), std::string::npos) << errors();
}

TEST_F(StageTest, SignalsLeaveNothingBehind) {
    const std::string begun = folder.path() / "begun";
    python("touch " + begun + "; exec sleep 60");
    for (const int signal : {SIGINT, SIGTERM}) {
        fs::remove(begun);
        const Program program(ETENDUE_PROGRAM,
                              {"convert", folder.path() / "stage.usda", folder.path() / "out.xml"},
                              folder.path());
        while (!fs::exists(begun)) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        program.send(signal);
        const ProgramResult r = program.wait();
        EXPECT_TRUE(signal == SIGINT ? r.status == 130 : r.signal == SIGTERM) << r.errors;
        expect_no_temporary_files();
    }
}

// Other threads, which do not hold signals, exist after the first comparison.
TEST_F(StageTest, SignalsBetweenComparisonsLeaveNothingBehind) {
    const std::string begun = folder.path() / "begun";
    python("touch " + begun + "; exec sleep 60");
    for (const int signal : {SIGINT, SIGTERM}) {
        fs::remove(begun);
        const Program program(ETENDUE_PROGRAM,
                              {"compare",
                               (fs::path(ETENDUE_SOURCE_DIR) / "scenes/cornell.xml").string(),
                               folder.path() / "stage.usda", "--methods", "path", "--spp", "1",
                               "--reference-spp", "1", "--resolution", "16x16",
                               "--techniques-max-depth", "0", "--report", folder.path() / "report"},
                              folder.path());
        while (!fs::exists(begun)) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        program.send(signal);
        const ProgramResult r = program.wait();
        EXPECT_TRUE(signal == SIGINT ? r.status == 130 : r.signal == SIGTERM) << r.errors;
        expect_no_temporary_files();
    }
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
