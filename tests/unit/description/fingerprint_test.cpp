// The fingerprint of a scene changes with every part that an image depends on, and with nothing else.

#include "description/fingerprint.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>

#include <gtest/gtest.h>

#include "run_program.h"

namespace etendue {
namespace {

/// A scene with something in every list.
struct Parts {
    SceneDescription scene;
    MeshData mesh;
    EncodedImage image{"embedded", "bytes of a picture"};

    Parts() {
        scene.objects = {{.category = "shape",
                          .type = "mesh",
                          .id = "ball",
                          .where = {"scene.xml", 3},
                          .params = {{"mesh", int64_t(0), {"scene.xml", 4}},
                                     {"flag", true, {}},
                                     {"size", 0.5, {}},
                                     {"text", std::string("word"), {}},
                                     {"at", Vec3{1, 2, 3}, {}},
                                     {"color", Rgb(0.1f, 0.2f, 0.3f), {}},
                                     {"to_world", SharedTransform(Transform()), {}}},
                          .children = {{"bsdf", 1, {"scene.xml", 5}}}},
                         {.category = "bsdf",
                          .type = "diffuse",
                          .id = {},
                          .where = {},
                          .params = {},
                          .children = {}}};
        scene.roots = {0};
        mesh.name = "mesh";
        mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
        mesh.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
        mesh.uvs = {{0, 0}, {1, 0}, {0, 1}};
        mesh.second_uvs = {{0, 1}, {1, 1}, {0, 2}};
        mesh.colors = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        mesh.alphas = {0.5f, 1, 0.25f};
        mesh.triangles = {{0, 1, 2}};
    }
    uint64_t fingerprint() const {
        SceneDescription whole = scene;
        whole.meshes = {mesh};
        whole.images = {image};
        return scene_fingerprint(whole);
    }
};

/// Changes the last bit of the value's memory.
template <class T>
void flip_a_bit(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    bytes[0] ^= 1;
    std::memcpy(&value, bytes, sizeof(T));
}

using Change = std::pair<const char*, std::function<void(Parts&)>>;

template <class T>
Change flip(const char* name, T& (*part)(Parts&)) {
    return {name, [part](Parts& p) { flip_a_bit(part(p)); }};
}

TEST(Fingerprint, CountsEveryBitOfTheContents) {
    const Change changes[] = {
        flip(
            "root", +[](Parts& p) -> int& { return p.scene.roots[0]; }),
        {"category", [](Parts& p) { p.scene.objects[0].category = "shapf"; }},
        {"type", [](Parts& p) { p.scene.objects[0].type = "mesi"; }},
        {"id", [](Parts& p) { p.scene.objects[0].id = "balm"; }},
        {"name of a parameter", [](Parts& p) { p.scene.objects[0].params[0].name = "mesi"; }},
        {"type of a value", [](Parts& p) { p.scene.objects[0].params[0].value = 0.0; }},
        {"int", [](Parts& p) { p.scene.objects[0].params[0].value = int64_t(1); }},
        {"bool", [](Parts& p) { p.scene.objects[0].params[1].value = false; }},
        {"float", [](Parts& p) { p.scene.objects[0].params[2].value = std::nextafter(0.5, 1.0); }},
        {"text", [](Parts& p) { p.scene.objects[0].params[3].value = std::string("worc"); }},
        {"vector",
         [](Parts& p) {
             p.scene.objects[0].params[4].value = Vec3{1, 2, std::nextafter(3.f, 4.f)};
         }},
        {"colour",
         [](Parts& p) {
             p.scene.objects[0].params[5].value = Rgb(0.1f, 0.2f, std::nextafter(0.3f, 1.f));
         }},
        {"transform",
         [](Parts& p) {
             p.scene.objects[0].params[6].value =
                 SharedTransform(Transform::translate({0, 0, 1e-9f}));
         }},
        {"order of parameters",
         [](Parts& p) { std::swap(p.scene.objects[0].params[0], p.scene.objects[0].params[1]); }},
        {"name of a child", [](Parts& p) { p.scene.objects[0].children[0].name = ""; }},
        flip(
            "child", +[](Parts& p) -> int& { return p.scene.objects[0].children[0].object; }),
        flip(
            "position", +[](Parts& p) -> Vec3& { return p.mesh.positions[2]; }),
        flip(
            "normal", +[](Parts& p) -> Vec3& { return p.mesh.normals[2]; }),
        flip(
            "uv", +[](Parts& p) -> Vec2& { return p.mesh.uvs[2]; }),
        flip(
            "second uv", +[](Parts& p) -> Vec2& { return p.mesh.second_uvs[2]; }),
        flip(
            "colour of a vertex", +[](Parts& p) -> Vec3& { return p.mesh.colors[2]; }),
        flip(
            "alpha of a vertex", +[](Parts& p) -> float& { return p.mesh.alphas[1]; }),
        flip(
            "triangle", +[](Parts& p) -> MeshData::Triangle& { return p.mesh.triangles[0]; }),
        flip(
            "face_normals", +[](Parts& p) -> bool& { return p.mesh.face_normals; }),
        flip(
            "image", +[](Parts& p) -> char& { return p.image.bytes.back(); }),
        // Boundaries between lists.
        {"no colours", [](Parts& p) { p.mesh.colors.clear(); }},
        {"normals become colours",
         [](Parts& p) {
             p.mesh.colors = p.mesh.normals;
             p.mesh.normals.clear();
         }},
        {"one more root", [](Parts& p) { p.scene.roots.push_back(0); }},
        {"one object less", [](Parts& p) { p.scene.objects.pop_back(); }},
    };
    const uint64_t original = Parts().fingerprint();
    EXPECT_EQ(Parts().fingerprint(), original);
    std::map<uint64_t, const char*> seen{{original, "nothing"}};
    for (const auto& [name, change] : changes) {
        Parts parts;
        change(parts);
        const auto [at, is_new] = seen.emplace(parts.fingerprint(), name);
        EXPECT_TRUE(is_new) << name << " and " << at->second;
    }
}

TEST(Fingerprint, DoesNotCountWhereTheSceneCameFrom) {
    const uint64_t original = Parts().fingerprint();
    const Change changes[] = {
        {"file", [](Parts& p) { p.scene.file = "other.xml"; }},
        {"folder", [](Parts& p) { p.scene.search_paths = {"/nowhere"}; }},
        {"warnings", [](Parts& p) { p.scene.warnings = {"a warning"}; }},
        {"left out", [](Parts& p) { p.scene.left_out = 1; }},
        {"line", [](Parts& p) { p.scene.objects[0].where.line = 77; }},
        {"line of a parameter", [](Parts& p) { p.scene.objects[0].params[0].where.line = 77; }},
        {"line of a child", [](Parts& p) { p.scene.objects[0].children[0].where.line = 77; }},
        {"name of a mesh", [](Parts& p) { p.mesh.name = "other"; }},
        {"degenerate triangles", [](Parts& p) { p.mesh.dropped_degenerate = 1; }},
        {"replaced normals", [](Parts& p) { p.mesh.replaced_normals = 1; }},
        {"name of an image", [](Parts& p) { p.image.name = "other"; }},
    };
    for (const auto& [name, change] : changes) {
        Parts parts;
        change(parts);
        EXPECT_EQ(parts.fingerprint(), original) << name;
    }
}

TEST(Fingerprint, CountsTheBytesOfNamedFiles) {
    const test::TemporaryFolder folder;
    Parts parts;
    parts.scene.search_paths = {folder.path().string()};
    const uint64_t missing = parts.fingerprint();
    std::ofstream(folder.path() / "word") << "one";
    const uint64_t one = parts.fingerprint();
    std::ofstream(folder.path() / "word") << "two";
    const uint64_t two = parts.fingerprint();
    EXPECT_NE(missing, one);
    EXPECT_NE(one, two);
}

// Such names stand in scenes that were written on Windows; resolve_file() finds the files, too.
TEST(Fingerprint, CountsTheBytesOfFilesNamedWithBackslashes) {
    const test::TemporaryFolder folder;
    std::filesystem::create_directory(folder.path() / "tex");
    Parts parts;
    parts.scene.search_paths = {folder.path().string()};
    parts.scene.objects[0].params[3].value = std::string("tex\\wood.png");
    const uint64_t missing = parts.fingerprint();
    std::ofstream(folder.path() / "tex/wood.png") << "one";
    const uint64_t one = parts.fingerprint();
    std::ofstream(folder.path() / "tex/wood.png") << "two";
    const uint64_t two = parts.fingerprint();
    EXPECT_NE(missing, one);
    EXPECT_NE(one, two);
}

TEST(Fingerprint, OfTheProgramIsThatOfItsFile) {
    EXPECT_EQ(program_fingerprint(), file_fingerprint("/proc/self/exe"));
    EXPECT_NE(program_fingerprint(), file_fingerprint(""));
}

}  // namespace
}  // namespace etendue
