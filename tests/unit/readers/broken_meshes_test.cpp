// Broken meshes: every file of tests/scenes/broken/meshes with the error that it must give.

#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "expect_scene_error.h"
#include "readers/obj.h"
#include "readers/ply.h"

namespace etendue {
namespace {

struct Case {
    const char* file;
    int line;  ///< 0 where the format has no lines or the error is of the whole file.
    const char* message;
};

constexpr Case kCases[] = {
    {"count_huge.ply", 8,
     "the header declares 99999999999 elements \"vertex\", more than the file can contain"},
    {"count_huge_binary.ply", 0,
     "the header declares 4000000000 elements \"vertex\", more than the file can contain"},
    {"count_negative.ply", 3, "negative number of elements"},
    {"count_word.ply", 3, "number of elements expected, found \"many\""},
    {"empty.obj", 0, "the mesh has no triangles"},
    {"empty.ply", 1, "not a PLY file: it does not begin with \"ply\""},
    {"face_of_two.obj", 3, "a face needs at least three corners, found 2"},
    {"face_slash_without_index.obj", 4, "index expected"},
    {"face_word.obj", 4, "index expected, found \"c\""},
    {"float_indices.ply", 12, "vertex_indices must be integers"},
    {"format_missing.ply", 8, "the header has no \"format\" line"},
    {"format_unknown.ply", 2, "unknown format \"binary_middle_endian\" (known: ascii"},
    {"header_unfinished.ply", 5, "the header has no \"end_header\""},
    {"header_word.ply", 3, "unknown header line \"elephant\""},
    {"index_huge.obj", 4, "index 99999999999 is out of range"},
    {"index_negative.ply", 13, "vertex index -1 must lie in [0, 2]"},
    {"index_negative_too_far.obj", 4, "index -4 is out of range"},
    {"index_too_large.obj", 2, "a face refers to vertex 4, but there are only 3"},
    {"index_too_large.ply", 13, "vertex index 3 must lie in [0, 2]"},
    {"index_with_fraction.obj", 4, "index expected, found \"2.5\""},
    {"index_zero.obj", 4, "index 0 is out of range"},
    {"list_length_float.ply", 4, "the length of a list must be an integer"},
    {"list_length_huge_binary.ply", 0, "the file ends early"},
    {"list_length_negative.ply", 13, "negative length of a list"},
    {"magic.ply", 1, "not a PLY file: it does not begin with \"ply\""},
    {"no_faces.obj", 0, "the mesh has no triangles"},
    {"no_faces.ply", 0, "the mesh has no triangles"},
    {"no_indices.ply", 12, "the faces have no list vertex_indices"},
    {"no_z.ply", 9, "the vertices have no x, y and z"},
    {"normal_index_too_large.obj", 5, "a face refers to normal 7, but there are only 1"},
    {"number_with_letters.obj", 3, "coordinate expected, found \"1abc\""},
    {"only_degenerate.obj", 0, "all triangles of the mesh have zero area"},
    {"only_degenerate.ply", 0, "all triangles of the mesh have zero area"},
    {"position_infinite.obj", 2, "coordinate is not finite"},
    {"position_nan.obj", 2, "coordinate is not finite"},
    {"position_nan.ply", 12, "position of vertex 2 is not finite"},
    {"position_nan_binary.ply", 0, "position of vertex 0 is not finite"},
    {"position_short.obj", 2, "coordinate expected"},
    {"position_word.obj", 2, "coordinate expected, found \"zero\""},
    {"position_word.ply", 12, "number expected, found \"one\""},
    {"property_first.ply", 3, "property before any element"},
    {"truncated.ply", 14, "the file ends early"},
    {"truncated_binary.ply", 0, "the file ends early"},
    {"type_unknown.ply", 4, "unknown type \"quad\""},
    {"uv_index_too_large.obj", 5, "a face refers to texture coordinate 2, but there are only 1"},
    {"version_unknown.ply", 2, "unknown version of the format (known: 1.0)"},
};

std::filesystem::path folder() {
    return std::filesystem::path(ETENDUE_SOURCE_DIR) / "tests/scenes/broken/meshes";
}

class BrokenMesh : public ::testing::TestWithParam<Case> {};

TEST_P(BrokenMesh, GivesItsError) {
    const Case& c = GetParam();
    const std::string path = (folder() / c.file).string();
    expect_scene_error(c.line, c.message,
                       [&] { path.ends_with(".obj") ? read_obj(path) : read_ply(path); });
}

INSTANTIATE_TEST_SUITE_P(Files, BrokenMesh, ::testing::ValuesIn(kCases), [](const auto& c) {
    std::string name = c.param.file;
    for (char& ch : name)
        if (ch == '.') ch = '_';
    return name;
});

TEST(BrokenMeshes, TheTableNamesEveryFile) {
    std::set<std::string> table, found;
    for (const Case& c : kCases) table.insert(c.file);
    for (const auto& entry : std::filesystem::directory_iterator(folder()))
        found.insert(entry.path().filename().string());
    EXPECT_EQ(table, found);
}

}  // namespace
}  // namespace etendue
