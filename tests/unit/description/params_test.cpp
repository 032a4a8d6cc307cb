#include "description/params.h"

#include <gtest/gtest.h>

#include "error_of.h"

namespace etendue {
namespace {

using test::error_of;

/// One object with a parameter of each type and a nested texture.
SceneDescription example() {
    SceneDescription scene;
    SceneObject o{
        .category = "bsdf", .type = "x", .id = {}, .where = {"f", 1}, .params = {}, .children = {}};
    o.params = {{"flag", true, {"f", 2}},
                {"count", int64_t(7), {"f", 3}},
                {"size", 0.5, {"f", 4}},
                {"name", std::string("ggx"), {"f", 5}},
                {"axis", Vec3{0, 0, 1}, {"f", 6}},
                {"colour", Rgb(1, 2, 3), {"f", 7}},
                {"flat", Transform::scale({1, 1, 0}), {"f", 8}}};
    o.children = {{"map", 1, {"f", 9}}};
    SceneObject texture = o;
    texture.category = "texture";
    texture.params.clear();
    texture.children.clear();
    scene.objects = {o, texture};
    scene.roots = {0};
    return scene;
}

TEST(Params, GivesValuesAndDefaults) {
    const SceneDescription scene = example();
    const Params p(scene, 0);
    EXPECT_TRUE(p.flag("flag", false));
    EXPECT_TRUE(p.flag("absent", true));
    EXPECT_EQ(p.integer("count", 0, 0, 10), 7);
    EXPECT_EQ(p.number("size", 1), 0.5f);
    EXPECT_EQ(p.number("count", 1), 7.0f);         // an integer is a number
    EXPECT_EQ(p.number("absent", 3, 0, 1), 3.0f);  // defaults are not checked
    EXPECT_EQ(p.text("name", ""), "ggx");
    EXPECT_EQ(p.choice("name", {"beckmann", "ggx"}, 0), 1);
    EXPECT_EQ(p.vector("axis", {}), (Vec3{0, 0, 1}));
    EXPECT_EQ(p.rgb("colour", {}), Rgb(1, 2, 3));
    EXPECT_EQ(p.rgb("size", {}), Rgb(0.5f));  // a float is grey
    EXPECT_TRUE(p.has("map"));
    EXPECT_EQ(p.children("texture").size(), 1u);
}

TEST(Params, RefusesNumbersBeyondSinglePrecision) {
    SceneDescription scene = example();
    scene.objects[0].params.push_back({"radius", 1e39, {"f", 10}});
    EXPECT_EQ(error_of([&] { Params(scene, 0).number("radius", 1, 0); }),
              "f:10: parameter \"radius\" is 1e+39, which is out of range for single precision");
}

TEST(Params, RefusesWrongTypesAndRanges) {
    const SceneDescription scene = example();
    const Params p(scene, 0);
    EXPECT_EQ(error_of([&] { p.flag("count", false); }),
              "f:3: parameter \"count\" of bsdf \"x\" must be a boolean, but is an integer");
    EXPECT_NE(error_of([&] { p.integer("count", 0, 0, 6); }).find("f:3: "), std::string::npos);
    EXPECT_NE(error_of([&] { p.number("size", 0, 1, 2); }).find("must lie in [1, 2]"),
              std::string::npos);
    EXPECT_NE(error_of([&] { p.choice("name", {"beckmann"}, 0); }).find("must be one of: beckmann"),
              std::string::npos);
    EXPECT_NE(error_of([&] { p.rgb("colour", {}, 1.5f); }).find("at least 1.5"), std::string::npos);
    EXPECT_NE(error_of([&] { p.transform("flat"); }).find("singular"), std::string::npos);
}

TEST(Params, ChecksAgainstTheTable) {
    SceneDescription scene = example();
    const PluginInfo info{"bsdf",
                          "x",
                          "",
                          {{"flag", ParamKind::Bool, "", ""},
                           {"count", ParamKind::Float, "", ""},
                           {"size", ParamKind::Int, "", ""},
                           {"name", ParamKind::String, "", ""},
                           {"axis", ParamKind::Vector, "", ""},
                           {"color", ParamKind::Rgb, "", ""},
                           {"flat", ParamKind::Transform, "", ""},
                           {"map", ParamKind::Texture, "", ""}}};
    std::vector<std::string> reports;
    const auto report = [&](const SourceLocation& where, const std::string& message) {
        reports.push_back(SceneError(where, message).what());
    };
    check_params(scene, 0, info, report);
    ASSERT_EQ(reports.size(), 2u);
    EXPECT_EQ(reports[0],
              "f:4: parameter \"size\" of bsdf \"x\" must be an integer, but is a float");
    EXPECT_EQ(reports[1], "f:7: bsdf \"x\" has no parameter \"colour\" (did you mean \"color\"?)");

    // A texture where a number must stand.
    scene.objects[0].params.clear();
    scene.objects[0].children[0].name = "count";
    reports.clear();
    check_params(scene, 0, info, report);
    ASSERT_EQ(reports.size(), 1u);
    EXPECT_EQ(reports[0],
              "f:9: parameter \"count\" of bsdf \"x\" must be a float, but is a texture");
}

}  // namespace
}  // namespace etendue
