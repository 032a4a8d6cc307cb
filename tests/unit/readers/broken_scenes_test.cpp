// Every file of tests/scenes/broken has one mistake, described by its name; the reader must refuse it with the message
// in this table; those of pbrt and glTF are in folders of these names. The reader accepts the files in
// tests/scenes/broken/builder, and the scene builder must refuse them.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include <gtest/gtest.h>

#include "expect_scene_error.h"
#include "readers/mitsuba_xml.h"
#include "readers/scene_file.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

struct BrokenScene {
    const char* file;
    int line;
    const char* message;           ///< Part of it.
    const char* faulty = nullptr;  ///< The file that the message names, where it is another one.
};

constexpr BrokenScene kBrokenScenes[] = {
    {"mismatched_tag.xml", 3,
     "malformed XML: <shape>, which begins in line 2, must be closed before </bsdf>"},
    {"unclosed_element.xml", 3,
     "malformed XML: <shape>, which begins in line 2, is never closed: </scene> follows"},
    {"unclosed_at_end.xml", 4,
     "malformed XML: <shape>, which begins in line 3, is never closed: the file ends"},
    {"end_of_nothing.xml", 3, "malformed XML: </scene> closes nothing: no element is open"},
    {"unclosed_comment.xml", 3, "malformed XML: Error parsing comment"},
    {"unquoted_attribute.xml", 2, "malformed XML: Error parsing element attribute"},
    {"empty_file.xml", 1, "expected a <scene>"},
    {"zero_byte.xml", 2, "zero byte"},
    {"wrong_root.xml", 1, "the root element must be <scene>, not <bsdf>"},
    {"second_root.xml", 2, "a second root element, <scene>"},
    {"text_after_root.xml", 4, "unexpected text \"more"},
    {"text_in_object.xml", 3, "unexpected text \"radius 3"},
    {"missing_version.xml", 1, "<scene> needs the attribute \"version\""},
    {"version_without_numbers.xml", 1, "expected a version such as \"3.0.0\", found \"three\""},
    {"version_of_the_future.xml", 1, "unknown version \"12.0.0\""},
    {"unknown_element.xml", 2, "unknown element <shap> (did you mean \"shape\"?)"},
    {"unknown_attribute.xml", 2, "<shape> has no attribute \"idd\" (did you mean \"id\"?)"},
    {"missing_value.xml", 3, "<float> needs the attribute \"value\""},
    {"missing_type.xml", 2, "<shape> needs the attribute \"type\""},
    {"attribute_twice.xml", 3, "<float> has the attribute \"value\" twice"},
    {"empty_name.xml", 3, "the attribute \"name\" of <float> must have 1 to 1024 characters"},
    {"element_in_float.xml", 4, "a <float> cannot contain a <float>"},
    {"parameter_of_the_scene.xml", 2, "parameter \"radius\" cannot stand in the <scene>"},
    {"float_with_suffix.xml", 3, "expected a number, found \"1.0abc\""},
    {"float_nan.xml", 3, "expected a finite number, found \"nan\""},
    {"float_infinite.xml", 3, "expected a finite number, found \"-inf\""},
    {"float_overflow.xml", 3, "\"1e999\" is out of range for a number"},
    {"float_empty.xml", 3, "expected a number, found \"\""},
    {"integer_with_fraction.xml", 3, "expected an integer, found \"1.5\""},
    {"integer_overflow.xml", 3, "is out of range for an integer"},
    {"boolean_yes.xml", 3, "expected \"true\" or \"false\", found \"yes\""},
    {"vector_of_two.xml", 3, "expected one or three numbers, found 2"},
    {"vector_without_z.xml", 3, "<point> needs the attribute \"z\""},
    {"vector_in_both_forms.xml", 3, "either \"value\" or \"x\", \"y\", \"z\", not both"},
    {"vector_overflow.xml", 3, "out of range for single precision"},
    {"rgb_of_four.xml", 3, "expected one or three numbers, found 4"},
    {"hex_colour.xml", 3, "expected a colour of the form \"#rrggbb\""},
    {"srgb_above_one.xml", 3, "sRGB components must lie in [0, 1]"},
    {"unknown_intent.xml", 3, "the intent must be \"reflectance\" or \"illuminant\""},
    {"spectrum_without_value.xml", 3,
     "needs one of the attributes \"value\", \"filename\" and \"type\""},
    {"spectrum_of_two_kinds.xml", 3,
     "needs one of the attributes \"value\", \"filename\" and \"type\""},
    {"spectrum_not_pairs.xml", 3, "expected a list of wavelength:value, found \"500\""},
    {"spectrum_three_numbers.xml", 3, "expected one number or a list of wavelength:value"},
    {"spectrum_of_one_sample.xml", 3, "at least two wavelengths"},
    {"spectrum_in_micrometres.xml", 3, "in nanometres, but the longest is 0.7 (micrometres?)"},
    {"spectrum_not_increasing.xml", 3, "wavelengths must increase, but 400 follows 500"},
    {"spectrum_file_missing.xml", 3, "cannot read the file \"no_such.spd\""},
    {"spectrum_file_three_columns.xml", 3, "expected a wavelength and a value, found 3 numbers",
     "parts/three_columns.spd"},
    {"spectrum_file_not_increasing.xml", 2, "wavelengths must increase, but 400 follows 400",
     "parts/not_increasing.spd"},
    {"spectrum_type_unknown.xml", 3,
     "unknown spectrum type \"blackbodi\" (did you mean \"blackbody\"?)"},
    {"spectrum_parameter_unknown.xml", 5,
     "spectrum \"blackbody\" has no parameter \"scales\" (did you mean \"scale\"?)"},
    {"spectrum_parameter_missing.xml", 3,
     "spectrum \"blackbody\" needs the parameter \"temperature\""},
    {"spectrum_lengths_differ.xml", 3, "3 wavelengths but 2 values"},
    {"spectrum_with_texture.xml", 4, "a <texture> cannot stand in a <spectrum>"},
    {"blackbody_cold.xml", 3, "the temperature must be above 0 K"},
    {"id_twice.xml", 3, "the id \"a\" is taken by the <bsdf> at"},
    {"unresolved_ref.xml", 4, "no object has the id \"flor\" (did you mean \"floor\"?)"},
    {"unresolved_alias.xml", 2, "no object has the id \"a\""},
    {"alias_taken.xml", 4, "the id \"b\" is taken"},
    {"self_reference.xml", 2, "an object contains itself: a > a"},
    {"reference_cycle.xml", 2, "an object contains itself: a > b > a"},
    {"film_in_shape.xml", 3, "a <film> cannot stand in a <shape>, which takes: bsdf emitter"},
    {"shape_ref_in_bsdf.xml", 4, "a <shape> cannot stand in a <bsdf>, which takes: bsdf texture"},
    {"ref_in_spectrum.xml", 4, "a <ref> cannot stand in a <spectrum>"},
    {"sampler_with_film.xml", 4, "a <film> cannot stand in a <sampler>"},
    {"nested_too_deep.xml", 2, "elements are nested more than 64 levels deep"},
    {"parameter_twice.xml", 4, "parameter \"radius\" is given twice"},
    {"child_twice.xml", 4, "parameter \"reflectance\" is given twice"},
    {"parameter_twice_in_two_dialects.xml", 4, "parameter \"to_world\" is given twice"},
    {"rotate_outside_transform.xml", 3, "a <rotate> can only stand in a <transform>"},
    {"transform_with_shear.xml", 4, "a <transform> cannot contain a <shear>"},
    {"lookat_at_itself.xml", 4, "target and origin are the same point, \"1 1 1\""},
    {"lookat_along_up.xml", 4, "up, \"0 1 0\", is parallel to the viewing direction"},
    {"lookat_without_target.xml", 4, "<lookat> needs the attribute \"target\""},
    {"rotate_without_axis.xml", 4, "<rotate> needs \"x\", \"y\", \"z\" or \"value\""},
    {"rotate_zero_axis.xml", 4, "the axis has length zero"},
    {"rotate_degrees.xml", 4, "expected a number, found \"90deg\""},
    {"scale_without_factor.xml", 4, "<scale> needs \"x\", \"y\", \"z\" or \"value\""},
    {"matrix_of_twelve.xml", 4, "<matrix> needs 16 or 9 numbers, row by row, found 12"},
    {"undefined_parameter.xml", 4, "undefined parameter $radios (did you mean \"radius\"?)"},
    {"default_after_use.xml", 2, "undefined parameter $kind"},
    {"lone_dollar.xml", 2, "undefined parameter $"},
    {"default_with_dash.xml", 2, "must have only letters, digits and '_'"},
    {"include_missing.xml", 2, "cannot read the file \"no_such.xml\""},
    {"include_of_itself.xml", 2, "includes itself"},
    {"include_cycle.xml", 3, "includes itself", "parts/includes_back.xml"},
    {"include_of_broken.xml", 3, "<shape> needs the attribute \"type\"", "parts/broken.xml"},
    {"include_of_text.xml", 1, "unexpected text", "parts/three_columns.spd"},
    {"path_in_object.xml", 3, "a <path> can only stand in the <scene>"},
    {"gamma.xml", 3, "gamma 2.2 is not supported"},
    {"pbrt/named_material_used.pbrt", 4,
     "there is no named material \"gild\" (did you mean \"gold\"?)"},
    {"pbrt/named_material_unused.pbrt", 4,
     "there is no named material \"gild\" (did you mean \"gold\"?)"},
    {"gltf/string_for_number.gltf", 0,
     "/cameras/0/perspective/yfov: must be a number, but is the string \"0.8\""},
    {"gltf/string_for_number_in_array.gltf", 0,
     "/nodes/0/translation/1: must be a number, but is the string \"one\""},
    {"gltf/string_for_index.gltf", 0,
     "/nodes/0/camera: must be an integer, but is the string \"front\""},
};

fs::path scenes_folder() {
    return fs::path(ETENDUE_SOURCE_DIR) / "tests" / "scenes" / "broken";
}

TEST(BrokenScenes, AreRefusedWithFileAndLine) {
    for (const BrokenScene& broken : kBrokenScenes) {
        SCOPED_TRACE(broken.file);
        const std::string file = (scenes_folder() / broken.file).string();
        const std::string faulty =
            (scenes_folder() / (broken.faulty ? broken.faulty : broken.file)).string();
        expect_scene_error(broken.line, broken.message, [&] {
            try {
                read_scene_file(file);
            } catch (const SceneError& e) {
                EXPECT_EQ(fs::path(e.where().file.str()).lexically_normal(),
                          fs::path(faulty).lexically_normal());
                throw;
            }
        });
    }
}

TEST(BrokenScenes, TheTableListsEveryFile) {
    std::set<std::string> listed, found;
    for (const BrokenScene& broken : kBrokenScenes) listed.insert(broken.file);
    for (const char* format : {"", "pbrt", "gltf"})
        for (const auto& entry : fs::directory_iterator(scenes_folder() / format))
            if (entry.is_regular_file())
                found.insert((fs::path(format) / entry.path().filename()).generic_string());
    EXPECT_EQ(listed, found);
    EXPECT_GE(found.size(), 40u);
}

TEST(BrokenScenes, AMissingSceneFileIsNamed) {
    expect_scene_error(0, "cannot read the scene file",
                       [] { read_mitsuba_xml("no_such_scene.xml"); });
    expect_scene_error(0, "cannot read the scene file",
                       [] { read_mitsuba_xml(scenes_folder().string()); });
}

TEST(BrokenScenes, ThoseOfTheBuilderReadWellAndTellWhatToExpect) {
    int count = 0;
    for (const auto& entry : fs::directory_iterator(scenes_folder() / "builder")) {
        if (entry.path().extension() != ".xml") continue;
        SCOPED_TRACE(entry.path().string());
        EXPECT_NO_THROW(read_mitsuba_xml(entry.path().string()));
        std::ifstream in(entry.path());
        const std::string text((std::istreambuf_iterator<char>(in)),
                               std::istreambuf_iterator<char>());
        EXPECT_NE(text.find("<!-- expect: "), std::string::npos);
        ++count;
    }
    EXPECT_GE(count, 20);
}

}  // namespace
}  // namespace etendue
