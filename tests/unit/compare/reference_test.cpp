// Conditions for reusing cached references, and for comparing inner paths with a reference.

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "compare/comparison.h"
#include "run_program.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

TEST(Fingerprint, DependsOnAllBitsOfIncludedFiles) {
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "scene.xml").string();
    const auto fingerprint = [&](const std::string& x) {
        std::ofstream(folder.path() / "part.xml")
            << "<scene version=\"3.0.0\"><shape type=\"sphere\"><transform name=\"to_world\">"
               "<translate x=\""
            << x << "\"/></transform></shape></scene>";
        return scene_fingerprint(read_mitsuba_xml(file, {}));
    };
    std::ofstream(file) << "<scene version=\"3.0.0\"><include filename=\"part.xml\"/></scene>";
    EXPECT_EQ(fingerprint("1"), fingerprint("1"));
    EXPECT_NE(fingerprint("1"), fingerprint("2"));
    EXPECT_NE(fingerprint("1"), fingerprint("1.0000001"));
}

// Learned MIS weights differ between renderings by the same method.
TEST(InnerPaths, RefuseReferencesWithLearnedWeights) {
    const Scene scene = build(mixed_room(front_camera(16)));
    const auto check = [&](const char* method, const char* reference) {
        check_inner_paths(scene, {{method, IntegratorSpec::parse(method)}},
                          IntegratorSpec::parse(reference));
    };
    EXPECT_NO_THROW(check("bdpt", "bdpt"));
    EXPECT_THROW(check("path", "bdpt"), std::runtime_error);
    EXPECT_THROW(check("upg", "bdpt"), std::runtime_error);
    EXPECT_THROW(check("upg", "upg"), std::runtime_error);
}

}  // namespace
}  // namespace etendue::test
