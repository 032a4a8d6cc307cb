// The files that a written scene names: its own stay as they are, and those that are made get names of their own.

#include "readers/mitsuba_writer.h"

#include <filesystem>
#include <fstream>
#include <map>

#include <gtest/gtest.h>

#include "description/resolve_file.h"
#include "expect_scene_error.h"
#include "readers/mitsuba_xml.h"
#include "readers/ply.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

/// A triangle whose first vertex is (0, 0, z).
std::string ply(float z) {
    MeshData mesh;
    mesh.positions = {{0, 0, z}, {1, 0, 0}, {0, 1, 0}};
    mesh.colors = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.triangles = {{0, 1, 2}};
    return write_ply(mesh);
}

void write(const fs::path& file, const std::string& bytes) {
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << bytes;
}

/// Reads the scene `from` and writes it as `to`, with the files that it makes. Returns z of the first vertex of the meshes
/// that the new scene names, in the order of its objects.
std::vector<float> convert(const fs::path& from, const fs::path& to) {
    const SceneDescription scene = read_mitsuba_xml(from.string());
    const std::string xml = write_mitsuba_xml(
        scene, to.string(), to.stem().string() + "_files",
        [&](const SceneFile& file) { write(to.parent_path() / file.name, file.bytes); });
    write(to, xml);
    const SceneDescription again = read_mitsuba_xml(to.string());
    std::vector<float> heights;
    for (size_t i = 0; i < again.objects.size(); ++i)
        if (again.objects[i].find("filename"))
            heights.push_back(read_ply(resolve_file({again, int(i)})).positions[0].z);
    return heights;
}

std::string shape(const std::string& file, const std::string& more = "") {
    return "<shape type=\"ply\"><string name=\"filename\" value=\"" + file + "\"/>" + more +
           "</shape>\n";
}

// Vertex colours are shown, so that all meshes are written again. The second one has the index of the first one's file.
TEST(MitsubaWriter, DoesNotOverwriteMeshesOfTheScene) {
    const TemporaryFolder folder;
    const fs::path at = folder.path();
    for (int i = 0; i < 6; ++i)
        write(at / ("scene_files/mesh" + std::to_string(i) + ".ply"), ply(float(i)));
    write(at / "other.xml",
          "<scene version=\"3.0.0\">" + shape("scene_files/mesh5.ply") +
              shape("scene_files/mesh1.ply") + shape("scene_files/mesh0.ply") +
              "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"mesh_attribute\" "
              "name=\"reflectance\"><string name=\"name\" value=\"vertex_color\"/></texture>"
              "</bsdf></shape></scene>");
    EXPECT_EQ(convert(at / "other.xml", at / "scene.xml"), (std::vector<float>{5, 1, 0}));
    for (const int i : {0, 1, 5})
        EXPECT_EQ(read_text(at / ("scene_files/mesh" + std::to_string(i) + ".ply")), ply(float(i)));
}

TEST(MitsubaWriter, NamesOfAnEarlierConversionAreFilesOfTheScene) {
    const TemporaryFolder folder;
    const fs::path at = folder.path();
    write(at / "a/scene_files/mesh5.ply", ply(5));
    write(at / "a/scene.xml",
          "<scene version=\"3.0.0\">" + shape("scene_files/mesh5.ply") + "</scene>");
    EXPECT_EQ(convert(at / "a/scene.xml", at / "b/scene.xml"), std::vector<float>{5});
}

TEST(MitsubaWriter, MakesNoFileWhereOneOfTheSceneIsMissing) {
    const TemporaryFolder folder;
    const fs::path at = folder.path();
    write(at / "mesh.ply", ply(1));
    const std::string flipped = "<boolean name=\"compute_normals\" value=\"false\"/>";
    write(at / "a.xml", "<scene version=\"3.0.0\">" + shape("mesh.ply", flipped) + "\n" +
                            shape("missing.ply") + "</scene>");
    int made = 0;
    expect_scene_error(3, "there is no file \"missing.ply\"", [&] {
        write_mitsuba_xml(read_mitsuba_xml((at / "a.xml").string()), (at / "b.xml").string(),
                          "b_files", [&](const SceneFile&) { ++made; });
    });
    EXPECT_EQ(made, 0);
}

}  // namespace
}  // namespace etendue::test
