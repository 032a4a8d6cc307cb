#include <gtest/gtest.h>

#include "description/scene_description.h"

namespace etendue {
namespace {

SceneObject object(const char* category, const char* type, const char* id = "") {
    return {.category = category,
            .type = type,
            .id = id,
            .where = {"f", 1},
            .params = {},
            .children = {}};
}

TEST(Dump, SortsParametersAndPrintsEveryType) {
    SceneDescription scene;
    SceneObject o = object("shape", "sphere", "ball");
    o.params = {{"z", true, {}},
                {"d", 0.1, {}},
                {"i", int64_t(-3), {}},
                {"s", std::string("a \"b\" \\ \n"), {}},
                {"v", Vec3{1, 2.5f, -3}, {}},
                {"c", Rgb(0.25f, 0, 1e-5f), {}},
                {"t", Transform::rotate({0, 0, 1}, 90), {}}};
    scene.objects = {o};
    scene.roots = {0};
    EXPECT_EQ(dump(scene), "shape sphere id \"ball\"\n"
                           "  c: rgb 0.25 0 1e-05\n"
                           "  d: float 0.1\n"
                           "  i: integer -3\n"
                           "  s: string \"a \\\"b\\\" \\\\ \\x0a\"\n"
                           "  t: transform 0 -1 0 0 1 0 0 0 0 0 1 0 0 0 0 1\n"
                           "  v: vector 1 2.5 -3\n"
                           "  z: boolean true\n");
}

TEST(Dump, PrintsSharedObjectsOnce) {
    SceneDescription scene;
    scene.objects = {object("bsdf", "diffuse", "m"), object("shape", "cube"),
                     object("bsdf", "mask")};
    scene.objects[1].children = {{"", 0, {}}, {"", 2, {}}};
    scene.objects[2].children = {{"nested", 0, {}}};
    scene.roots = {1, 0};
    EXPECT_EQ(dump(scene), "shape cube\n"
                           "  bsdf diffuse id \"m\" #1\n"
                           "  bsdf mask\n"
                           "    nested: bsdf #1\n"
                           "bsdf #1\n");
}

TEST(Dump, IgnoresLocationsAndOrderOfParameters) {
    SceneDescription a, b;
    a.objects = {object("film", "hdrfilm")};
    a.objects[0].params = {{"width", int64_t(1), {"x", 1}}, {"height", int64_t(2), {"x", 2}}};
    a.roots = {0};
    b = a;
    std::swap(b.objects[0].params[0], b.objects[0].params[1]);
    b.objects[0].params[0].where = {"y", 7};
    EXPECT_EQ(dump(a), dump(b));
    b.objects[0].params[0].value = int64_t(3);
    EXPECT_NE(dump(a), dump(b));
}

TEST(SceneError, NamesFileAndLine) {
    EXPECT_STREQ(SceneError({"a.xml", 3}, "no").what(), "a.xml:3: no");
    EXPECT_STREQ(SceneError({"a.xml", 0}, "no").what(), "a.xml: no");
    EXPECT_STREQ(SceneError({}, "no").what(), "no");
}

TEST(NearestName, FindsWhatWasMeant) {
    const std::vector<std::string> names = {"reflectance", "specular_reflectance", "alpha"};
    EXPECT_EQ(nearest_name("reflectanse", names), "reflectance");
    EXPECT_EQ(nearest_name("aplha", names), "alpha");  // a transposition is one step
    EXPECT_EQ(nearest_name("radius", names), "");
    EXPECT_EQ(nearest_name("alpha", {}), "");
}

}  // namespace
}  // namespace etendue
