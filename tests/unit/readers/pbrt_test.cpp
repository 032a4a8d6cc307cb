#include "readers/pbrt.h"

#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "expect_scene_error.h"
#include "files_in_memory.h"
#include "readers/pbrt_tokenizer.h"
#include "shared_scenes.h"

namespace etendue {
namespace {

/// A scene of pbrt-v4 with `world` from line 2 on, one of v3 with WorldEnd behind it.
SceneDescription parse4(const std::string& world, const ReadOptions& options = {}) {
    return parse_pbrt("WorldBegin\n" + world, "s.pbrt", options);
}
SceneDescription parse_pbrt3(const std::string& world, const ReadOptions& options = {}) {
    return parse_pbrt("WorldBegin\n" + world + "\nWorldEnd\n", "s.pbrt", options);
}
SceneDescription parse_options(const std::string& options) {
    return parse_pbrt(options + "\nWorldBegin\n", "s.pbrt");
}

const SceneObject& find(const SceneDescription& scene, std::string_view category, int skip = 0) {
    for (const int root : scene.roots)
        if (scene.objects[root].category == category && skip-- == 0) return scene.objects[root];
    throw std::runtime_error(fmt::format("no {} in the scene", category));
}
template <class T>
T value(const SceneObject& object, const char* name) {
    const Param* p = object.find(name);
    if (!p) throw std::runtime_error(fmt::format("{} has no parameter {}", object.type, name));
    const T* v = p->as<T>();
    if (!v) throw std::runtime_error(std::string(name) + " has another type");
    return *v;
}
const SceneObject& child(const SceneDescription& scene, const SceneObject& object,
                         std::string_view category, std::string_view name = "") {
    for (const auto& c : object.children)
        if (c.name == name && scene.objects[c.object].category == category)
            return scene.objects[c.object];
    throw std::runtime_error(fmt::format("{} has no {} \"{}\"", object.type, category, name));
}
/// The material of a scene's first shape, inside a twosided if there is one.
const SceneObject& material(const SceneDescription& scene) {
    const SceneObject& outer = child(scene, find(scene, "shape"), "bsdf");
    return outer.type == "twosided" ? child(scene, outer, "bsdf") : outer;
}
Vec3 transformed(const Transform& t, Vec3 p) {
    return t.point(p);
}
void expect_near(Vec3 a, Vec3 b) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], 1e-5) << i;
}
void expect_near(Rgb a, Rgb b, double tolerance = 1e-5) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << i;
}

constexpr const char* kSphere = "Shape \"sphere\"\n";

// ---- Tokens

TEST(PbrtTokenizer, TellsWordsStringsNumbersAndBracketsApart) {
    const FileName file = "f";
    PbrtTokenizer in("  Word# comment \" [\n\"a \\\"b\\\" c\"[-1.5e2 +3]7", file);
    EXPECT_EQ(in.word(), "Word");
    EXPECT_EQ(unescape(in.string()), "a \"b\" c");
    EXPECT_EQ(in.where().line, 2);
    EXPECT_TRUE(in.skip('['));
    EXPECT_EQ(in.number<float>("a number"), -150);
    EXPECT_EQ(in.number<int>("an integer"), 3);
    EXPECT_FALSE(in.skip('['));
    EXPECT_TRUE(in.skip(']'));
    EXPECT_EQ(in.number<int>("an integer"), 7);
    EXPECT_EQ(in.peek(), '\0');
}

TEST(PbrtTokenizer, LinesEndWithCarriageReturnsAsWell) {
    const FileName file = "f";
    for (const std::string end : {"\n", "\r\n", "\r"}) {
        const std::string text =
            "# comment" + end + end + "A # comment" + end + "\"b" + end + "\" C";
        PbrtTokenizer in(text, file);
        EXPECT_EQ(in.word(), "A");
        EXPECT_EQ(in.where().line, 3);
        EXPECT_EQ(in.string(), "b" + end);
        EXPECT_EQ(in.where().line, 5);
        EXPECT_EQ(in.word(), "C");
        EXPECT_TRUE(ends_with_world_end("a" + end + "WorldEnd # b" + end + "# c" + end));
    }
}

TEST(PbrtTokenizer, NamesWhatIsNoNumber) {
    const FileName file = "f";
    const auto number = [&](const char* text) {
        PbrtTokenizer in(text, file);
        in.number<float>("a number");
    };
    expect_scene_error(2, "expected a number, found \"1.2.3\"", [&] { number("\n1.2.3"); });
    expect_scene_error(1, "expected a number, found the string \"x\"", [&] { number("\"x\""); });
    expect_scene_error(1, "expected a number, found \"]\"", [&] { number("]"); });
    expect_scene_error(1, "found \"inf\"", [&] { number("inf"); });
    expect_scene_error(1, "1e39 is out of range", [&] { number("1e39"); });
    expect_scene_error(1, "-1e400 is out of range", [&] { number("-1e400"); });
    expect_scene_error(1, "99999999999 is out of range",
                       [&] { PbrtTokenizer("99999999999", file).number<int>("an integer"); });
    expect_scene_error(1, "expected a number, but the file ends", [&] { number(" "); });
    expect_scene_error(1, "no closing quote", [&] { PbrtTokenizer("\"x\n\n", file).string(); });
}

TEST(PbrtTokenizer, NumbersThatAreTooSmallAreZero) {
    const FileName file = "f";
    const std::string long_one = "0." + std::string(400, '0') + "1";
    for (const std::string& text : {std::string("1e-46"), std::string("-1e-400"), long_one}) {
        EXPECT_EQ(PbrtTokenizer(text, file).number<float>("a number"), 0) << text;
        EXPECT_NEAR(PbrtTokenizer(text, file).number<double>("a number"), 0, 1e-45) << text;
    }
    EXPECT_EQ(PbrtTokenizer("1e-42", file).number<float>("a number"), 1e-42f);
    const std::string huge = "1" + std::string(400, '0') + "e-400";
    EXPECT_EQ(PbrtTokenizer(huge, file).number<float>("a number"), 1);
}

TEST(Pbrt, VersionIsThatOfTheEndOrOfTheFilm) {
    EXPECT_TRUE(ends_with_world_end("WorldBegin WorldEnd # the end\n# more\n\n"));
    EXPECT_FALSE(ends_with_world_end("WorldBegin\n# WorldEnd\n"));
    // Defaults of the two versions.
    EXPECT_EQ(
        value<int64_t>(child(parse_pbrt3(""), find(parse_pbrt3(""), "sensor"), "film"), "width"),
        640);
    EXPECT_EQ(value<int64_t>(child(parse4(""), find(parse4(""), "sensor"), "film"), "width"), 1280);
    EXPECT_EQ(value<int64_t>(child(parse_options("Film \"image\""),
                                   find(parse_options("Film \"image\""), "sensor"), "film"),
                             "width"),
              640);
}

TEST(Pbrt, FilmsAreSampledBeyondTheirBorder) {
    for (const SceneDescription& scene : {parse_pbrt3(""), parse4("")})
        EXPECT_TRUE(value<bool>(child(scene, find(scene, "sensor"), "film"), "sample_border"));
}

// ---- Transforms and attributes

Transform to_world(const SceneDescription& scene) {
    const Param* p = find(scene, "shape").find("to_world");
    return p ? *p->as<Transform>() : Transform();
}

TEST(Pbrt, TransformsMultiplyFromTheRight) {
    const auto at = [](const std::string& directives) {
        return transformed(to_world(parse4(directives + " " + kSphere)), {1, 2, 3});
    };
    expect_near(at("Translate 1 0 0 Scale 2 2 2"), {3, 4, 6});
    expect_near(at("Rotate 90 0 0 1"), {-2, 1, 3});
    expect_near(at("Transform [1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1]"), {6, 8, 10});
    expect_near(at("Translate 1 0 0 ConcatTransform [2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1]"), {3, 4, 6});
    expect_near(at("Translate 1 0 0 Identity"), {1, 2, 3});
    expect_near(at("Translate 1 0 0 CoordinateSystem \"a\" Identity CoordSysTransform \"a\""),
                {2, 2, 3});
    expect_near(at("AttributeBegin Translate 1 0 0 AttributeEnd"), {1, 2, 3});
    expect_near(at("TransformBegin Translate 1 0 0 TransformEnd"), {1, 2, 3});
}

TEST(Pbrt, CameraLooksWhereLookAtSays) {
    const auto scene = parse_options("LookAt 1 2 3  1 2 0  0 1 0 Camera \"perspective\"");
    const Transform t = value<Transform>(find(scene, "sensor"), "to_world");
    expect_near(t.point({0, 0, 0}), {1, 2, 3});
    expect_near(t.vector({0, 0, 1}), {0, 0, -1});
    // pbrt is left-handed: looking along -z with y up, x points to -x. etendue's camera has x to the left.
    expect_near(t.vector({1, 0, 0}), {1, 0, 0});
    expect_near(t.vector({0, 1, 0}), {0, 1, 0});
}

TEST(Pbrt, AttributesAreSavedAndRestored) {
    const auto scene = parse4("AttributeBegin\n"
                              "Material \"diffuse\" \"rgb reflectance\" [.1 .2 .3]\n"
                              "ReverseOrientation AreaLightSource \"diffuse\" AttributeEnd\n" +
                              std::string(kSphere));
    EXPECT_EQ(value<Rgb>(material(scene), "reflectance"), Rgb(0.5f));
    EXPECT_FALSE(find(scene, "shape").find("flip_normals"));
    EXPECT_EQ(find(scene, "shape").children.size(), 1u);
    const auto reversed = parse4("ReverseOrientation " + std::string(kSphere));
    EXPECT_TRUE(value<bool>(find(reversed, "shape"), "flip_normals"));
}

TEST(Pbrt, AttributeGivesDefaults) {
    const auto scene = parse4("Attribute \"shape\" \"float radius\" 3\n" + std::string(kSphere) +
                              "Shape \"sphere\" \"float radius\" 2");
    EXPECT_EQ(value<double>(find(scene, "shape"), "radius"), 3);
    EXPECT_EQ(value<double>(find(scene, "shape", 1), "radius"), 2);
}

// What an object does not have does not concern it.
TEST(Pbrt, DefaultsConcernWhatHasThem) {
    const auto scene = parse4("Attribute \"shape\" \"float radius\" 2 \"string alpha\" \"no\"\n"
                              "Attribute \"material\" \"float roughness\" 0.1\n"
                              "Material \"diffuse\"\n"
                              "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n" +
                              std::string(kSphere));
    EXPECT_EQ(find(scene, "shape").type, "mesh");
    EXPECT_EQ(value<double>(find(scene, "shape", 1), "radius"), 2);
    expect_scene_error(3, "has no parameter \"radius\"", [] {
        parse4("Attribute \"shape\" \"float radius\" 2\n"
               "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"float radius\" 1");
    });
}

TEST(Pbrt, NamesOfV3EndWithTheirAttributes) {
    const std::string text =
        "Texture \"t\" \"color\" \"constant\" \"rgb value\" [.9 .1 .1]\n"
        "MakeNamedMaterial \"m\" \"string type\" \"matte\" \"rgb Kd\" [.9 .1 .1]\n"
        "OPEN\n"
        "Texture \"t\" \"color\" \"constant\" \"rgb value\" [.1 .1 .9]\n"
        "MakeNamedMaterial \"m\" \"string type\" \"matte\" \"rgb Kd\" [.1 .1 .9]\n"
        "CLOSE\n"
        "NamedMaterial \"m\" Shape \"sphere\"\n"
        "Material \"matte\" \"texture Kd\" \"t\" Shape \"sphere\"\n";
    const auto with = [&](const std::string& open, const std::string& close) {
        std::string all = text;
        all.replace(all.find("OPEN"), 4, open);
        all.replace(all.find("CLOSE"), 5, close);
        return all;
    };
    const auto colours = [](const SceneDescription& scene) {
        std::vector<Rgb> found;
        for (int i = 0; i < 2; ++i) {
            const SceneObject& outer = child(scene, find(scene, "shape", i), "bsdf");
            found.push_back(value<Rgb>(
                outer.type == "twosided" ? child(scene, outer, "bsdf") : outer, "reflectance"));
        }
        return found;
    };
    const Rgb outer(0.9f, 0.1f, 0.1f), inner(0.1f, 0.1f, 0.9f);
    EXPECT_EQ(colours(parse_pbrt3(with("AttributeBegin", "AttributeEnd"))),
              (std::vector<Rgb>{outer, outer}));
    EXPECT_EQ(colours(parse_pbrt3(with("ObjectBegin \"o\"", "ObjectEnd"))),
              (std::vector<Rgb>{outer, outer}));
    EXPECT_EQ(colours(parse_pbrt3(with("TransformBegin", "TransformEnd"))),
              (std::vector<Rgb>{inner, inner}));
    // A name that is new within the attributes is unknown behind them.
    expect_scene_error(4, "there is no named material \"m\"", [] {
        parse_pbrt3("AttributeBegin\nMakeNamedMaterial \"m\" \"string type\" \"matte\"\n"
                    "AttributeEnd NamedMaterial \"m\"");
    });
    // A material is that of the name where it is chosen.
    const auto chosen =
        parse_pbrt3("MakeNamedMaterial \"m\" \"string type\" \"matte\" \"rgb Kd\" [.9 .1 .1]\n"
                    "NamedMaterial \"m\"\n"
                    "MakeNamedMaterial \"m\" \"string type\" \"matte\" \"rgb Kd\" [.1 .1 .9]\n" +
                    std::string(kSphere));
    EXPECT_EQ(value<Rgb>(material(chosen), "reflectance"), outer);
    // Names of v4 hold in the whole scene.
    const auto v4 = parse4("AttributeBegin\n"
                           "MakeNamedMaterial \"m\" \"string type\" \"conductor\"\n"
                           "AttributeEnd NamedMaterial \"m\"\n" +
                           std::string(kSphere));
    EXPECT_EQ(material(v4).type, "conductor");
}

// Names of v4 may be used before they are defined, with the graphics state of where they are used.
TEST(Pbrt, NamesOfV4MayBeDefinedLater) {
    const std::string red = "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [1 0 0]\n";
    const auto named =
        parse4("NamedMaterial \"a\"\nAttributeBegin Translate 0 0 5 " + std::string(kSphere) +
               "AttributeEnd\nMakeNamedMaterial \"a\" \"string type\" \"conductor\"");
    EXPECT_EQ(material(named).type, "conductor");
    expect_near(transformed(to_world(named), {0, 0, 0}), {0, 0, 5});
    const auto textured = parse4("Material \"diffuse\" \"texture reflectance\" \"t\"\n" +
                                 std::string(kSphere) + red + kSphere);
    ASSERT_EQ(std::count_if(textured.roots.begin(), textured.roots.end(),
                            [&](int r) { return textured.objects[r].category == "shape"; }),
              2);
    EXPECT_EQ(value<Rgb>(material(textured), "reflectance"), Rgb(1, 0, 0));
    EXPECT_EQ(find(textured, "shape").children[0].object,
              find(textured, "shape", 1).children[0].object);
    // A chain: a mixture of a material with a texture that is scaled by another one.
    const auto chain =
        parse4("Material \"mix\" \"string materials\" [\"a\" \"b\"]\n" + std::string(kSphere) +
               "MakeNamedMaterial \"b\" \"string type\" \"diffuse\" \"texture reflectance\" \"p\"\n"
               "MakeNamedMaterial \"a\" \"string type\" \"conductor\"\n"
               "Texture \"p\" \"spectrum\" \"scale\" \"texture tex\" \"t\" \"float scale\" 0.5\n" +
               red);
    EXPECT_EQ(material(chain).type, "blendbsdf");
    // In an object; an instance of an empty one is left out.
    const auto object = parse4("ObjectBegin \"o\" NamedMaterial \"a\" " + std::string(kSphere) +
                               "ObjectEnd ObjectInstance \"o\"\n"
                               "ObjectBegin \"none\" ObjectEnd ObjectInstance \"none\"\n"
                               "MakeNamedMaterial \"a\" \"string type\" \"interface\"");
    const SceneObject& instance = find(object, "shape");
    EXPECT_EQ(child(object, child(object, instance, "shape"), "shape").type, "sphere");
    EXPECT_THROW(find(object, "shape", 1), std::runtime_error);
    // What nobody defines is reported where it is first needed.
    expect_scene_error(2, "there is no spectrum texture \"t\"", [] {
        parse4("Material \"diffuse\" \"texture reflectance\" \"t\"\n" + std::string(kSphere) +
               "Shape \"sphere\" \"texture alpha\" \"u\"");
    });
    expect_scene_error(2, "mixes \"a\", which is no named material", [] {
        parse4("Material \"mix\" \"string materials\" [\"a\" \"b\"]\n" + std::string(kSphere));
    });
    expect_scene_error(2, "there is no spectrum texture \"t\"", [&] {
        parse_pbrt3("Material \"matte\" \"texture Kd\" \"t\"\n"
                    "Texture \"t\" \"color\" \"constant\"");
    });
}

TEST(Pbrt, ObjectsBecomeGroupsAndInstances) {
    const auto scene = parse4("ObjectBegin \"o\" Translate 1 0 0\n" + std::string(kSphere) +
                              "ObjectEnd\nTranslate 0 1 0 ObjectInstance \"o\"");
    const SceneObject& instance = find(scene, "shape");
    EXPECT_EQ(instance.type, "instance");
    expect_near(value<Transform>(instance, "to_world").point({0, 0, 0}), {0, 1, 0});
    const SceneObject& group = child(scene, instance, "shape");
    EXPECT_EQ(group.type, "shapegroup");
    const SceneObject& member = child(scene, group, "shape");
    expect_near(value<Transform>(member, "to_world").point({0, 0, 0}), {1, 0, 0});
}

TEST(Pbrt, IncludesFilesInPlace) {
    const auto options = with_files({{"dir/b.pbrt", "Translate 1 0 0\n"}});
    const auto scene =
        parse_pbrt("WorldBegin Include \"b.pbrt\"\n" + std::string(kSphere), "dir/a.pbrt", options);
    expect_near(transformed(to_world(scene), {0, 0, 0}), {1, 0, 0});
    expect_scene_error(2, "unknown directive \"Bad\"", [] {
        parse_pbrt("WorldBegin Include \"b.pbrt\"\n", "a.pbrt", with_files({{"b.pbrt", "\nBad"}}));
    });
}

// What is imported is complete, and leaves the graphics state as it was.
TEST(Pbrt, ImportsKeepTheirStateToThemselves) {
    const auto import = [](const std::string& text, const std::string& before = "") {
        return parse_pbrt("WorldBegin\n" + before + "Import \"b.pbrt\"\n" + kSphere, "a.pbrt",
                          with_files({{"b.pbrt", text}}));
    };
    const auto scene = import("Material \"conductor\" Translate 100 0 0 ReverseOrientation\n"
                              "MakeNamedMaterial \"m\" \"string type\" \"diffuse\"\n"
                              "AttributeBegin Shape \"disk\" AttributeEnd");
    EXPECT_EQ(find(scene, "shape").type, "disk");
    EXPECT_EQ(find(scene, "shape", 1).type, "sphere");
    EXPECT_EQ(child(scene, find(scene, "shape", 1), "bsdf").type, "twosided");
    EXPECT_FALSE(find(scene, "shape", 1).find("to_world"));
    EXPECT_FALSE(find(scene, "shape", 1).find("flip_normals"));
    expect_scene_error(1, "AttributeBegin is never closed", [&] { import("AttributeBegin"); });
    expect_scene_error(1, "AttributeEnd without AttributeBegin",
                       [&] { import("AttributeEnd AttributeBegin", "AttributeBegin\n"); });
}

// ---- Shapes

TEST(Pbrt, TriangleMeshesAreHeldByTheDescription) {
    const auto scene = parse4("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]\n"
                              "\"integer indices\" [0 1 2 2 1 3] \"point2 uv\" [0 0 1 0 0 1 1 1]");
    ASSERT_EQ(scene.meshes.size(), 1u);
    EXPECT_EQ(scene.meshes[0]->triangles.size(), 2u);
    EXPECT_EQ(scene.meshes[0]->positions[3], (Vec3{1, 1, 0}));
    EXPECT_EQ(scene.meshes[0]->uvs[2], (Vec2{0, 1}));
    EXPECT_TRUE(scene.meshes[0]->normals.empty());
    EXPECT_FALSE(value<bool>(find(scene, "shape"), "compute_normals"));
}

TEST(Pbrt, CutQuadricsBecomeMeshes) {
    const auto whole = parse4("Shape \"sphere\" \"float radius\" 2");
    EXPECT_EQ(find(whole, "shape").type, "sphere");
    for (const char* text :
         {"Shape \"sphere\" \"float zmax\" 0.5", "Scale 1 2 1 Shape \"sphere\"",
          "Shape \"disk\" \"float innerradius\" 0.5", "Shape \"cylinder\" \"float phimax\" 90"}) {
        const auto scene = parse4(text);
        EXPECT_EQ(find(scene, "shape").type, "mesh") << text;
        EXPECT_EQ(scene.warnings.size(), 1u) << text;
    }
}

TEST(Pbrt, NormalsOfTessellatedSpheresPointOutward) {
    const auto scene = parse4("Shape \"sphere\" \"float zmax\" 0.5");
    const MeshData& mesh = scene.meshes.at(0);
    for (const auto& t : mesh.triangles) {
        const Vec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
        EXPECT_GT(dot(cross(b - a, c - a), a + b + c), 0);
        EXPECT_GT(dot(mesh.normals[t[0]], a), 0.99f);
    }
}

TEST(Pbrt, LoopSubdivisionOfAnOctahedronEndsOnItsLimit) {
    const auto scene =
        parse4("Shape \"loopsubdiv\" \"integer levels\" 3\n"
               "\"point3 P\" [1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1]\n"
               "\"integer indices\" [0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5]");
    const MeshData& mesh = scene.meshes.at(0);
    EXPECT_EQ(mesh.triangles.size(), 8u * 64);
    float least = kInf, most = 0;
    for (const Vec3 p : mesh.positions) {
        least = std::min(least, length(p));
        most = std::max(most, length(p));
    }
    // The limit of an original vertex p of valence 4 is p/2 plus an eighth of its neighbours, whose sum is zero.
    EXPECT_NEAR(most, 0.5f, 1e-5);
    EXPECT_GT(least, 0.4f);
}

TEST(Pbrt, BilinearMeshes) {
    const auto flat = parse4("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]");
    EXPECT_EQ(flat.meshes.at(0)->triangles.size(), 2u);
    EXPECT_GT(flat.meshes[0]->normals[0].z, 0.99f);
    const auto bent = parse4("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]");
    EXPECT_EQ(bent.meshes.at(0)->triangles.size(), 512u);
}

TEST(Pbrt, AlphaBecomesAMask) {
    const auto scene = parse4("Texture \"a\" \"float\" \"imagemap\" \"string filename\" \"a.png\"\n"
                              "Shape \"sphere\" \"texture alpha\" \"a\"");
    const SceneObject& mask = child(scene, find(scene, "shape"), "bsdf");
    EXPECT_EQ(mask.type, "mask");
    EXPECT_EQ(child(scene, mask, "texture", "opacity").type, "bitmap");
}

// ---- Materials and spectra

TEST(Pbrt, ShadowsOfTheirOwnAreReported) {
    const auto warnings = [](const std::string& params) {
        return parse_pbrt3("Texture \"t\" \"float\" \"checkerboard\"\nShape \"sphere\" " + params)
            .warnings;
    };
    EXPECT_TRUE(warnings("\"float alpha\" 0.5 \"float shadowalpha\" 0.5").empty());
    EXPECT_TRUE(warnings("\"texture alpha\" \"t\" \"texture shadowalpha\" \"t\"").empty());
    EXPECT_TRUE(warnings("\"float shadowalpha\" 1").empty());
    for (const char* params :
         {"\"float shadowalpha\" 0", "\"float alpha\" 0.5 \"float shadowalpha\" 1",
          "\"texture shadowalpha\" \"t\""}) {
        ASSERT_EQ(warnings(params).size(), 1u) << params;
        EXPECT_EQ(
            warnings(params)[0],
            "s.pbrt:3: parameter \"shadowalpha\" has no effect: shadows are those of \"alpha\"");
    }
}

TEST(Pbrt, RoughnessIsRemappedByVersion) {
    const auto alpha = [](const SceneDescription& scene) {
        return value<Rgb>(material(scene), "alpha_u").r;
    };
    EXPECT_NEAR(
        alpha(parse4("Material \"conductor\" \"float roughness\" 0.04 " + std::string(kSphere))),
        0.2, 1e-6);
    EXPECT_NEAR(
        alpha(parse_pbrt3("Material \"metal\" \"float roughness\" 0.1 " + std::string(kSphere))),
        0.46176, 1e-4);
    EXPECT_NEAR(
        alpha(parse4(
            "Material \"conductor\" \"float roughness\" 0.04 \"bool remaproughness\" false " +
            std::string(kSphere))),
        0.04, 1e-6);
    EXPECT_EQ(material(parse4("Material \"conductor\" " + std::string(kSphere))).type, "conductor");
}

TEST(Pbrt, MaterialsOfV4) {
    const std::pair<const char*, const char*> kCases[] = {
        {"\"diffuse\"", "diffuse"},
        {"\"coateddiffuse\"", "plastic"},
        {"\"coateddiffuse\" \"float roughness\" 0.1", "roughplastic"},
        {"\"dielectric\"", "dielectric"},
        {"\"dielectric\" \"float roughness\" 0.1", "roughdielectric"},
        {"\"thindielectric\"", "thindielectric"},
        {"\"diffusetransmission\"", "diffusetransmission"},
        {"\"interface\"", "null"},
        {"\"\"", "null"}};
    for (const auto& [text, type] : kCases)
        EXPECT_EQ(material(parse4(std::string("Material ") + text + " " + kSphere)).type, type)
            << text;
}

TEST(Pbrt, CoatsOfV4) {
    EXPECT_NEAR(
        value<double>(material(parse4(std::string("Material \"coateddiffuse\" ") + kSphere)),
                      "thickness"),
        0.01, 1e-6);
    const auto scene = parse4(
        "Material \"coatedconductor\" \"float interface.roughness\" 0.04 \"float thickness\" 2 "
        "\"rgb conductor.eta\" [1 2 3] \"float interface.eta\" 1.25 " +
        std::string(kSphere));
    const SceneObject& coated = material(scene);
    EXPECT_EQ(coated.type, "coatedconductor");
    EXPECT_EQ(value<double>(coated, "alpha"), 0);
    EXPECT_NEAR(value<double>(coated, "coat_alpha"), 0.2, 1e-6);
    EXPECT_EQ(value<double>(coated, "thickness"), 2);
    EXPECT_EQ(value<double>(coated, "int_ior"), 1.25);
    expect_near(value<Rgb>(coated, "eta"), Rgb(1, 2, 3));
}

TEST(Pbrt, MaterialsOfV3) {
    const std::pair<const char*, const char*> kCases[] = {
        {"\"matte\"", "diffuse"},
        {"\"matte\" \"float sigma\" 20", "orennayar"},
        {"\"mirror\"", "conductor"},
        {"\"glass\"", "dielectric"},
        {"\"glass\" \"float uroughness\" 0.1 \"float vroughness\" 0.1", "roughdielectric"},
        {"\"metal\"", "roughconductor"},
        {"\"plastic\"", "lobesum"},
        {"\"substrate\"", "fresnelblend"},
        {"\"uber\"", "lobesum"},
        {"\"uber\" \"rgb opacity\" [.5 .5 .5]", "mask"},
        {"\"translucent\"", "lobesum"},
        {"\"disney\"", "principled"},
        {"\"none\"", "null"}};
    for (const auto& [text, type] : kCases)
        EXPECT_EQ(material(parse_pbrt3(std::string("Material ") + text + " " + kSphere)).type, type)
            << text;
}

TEST(Pbrt, NamedMaterialsMayBeMixed) {
    const std::string two = "MakeNamedMaterial \"a\" \"string type\" \"TYPE\"\n"
                            "MakeNamedMaterial \"b\" \"string type\" \"TYPE\"\n";
    const auto with = [&](std::string type) {
        std::string text = two;
        for (size_t at; (at = text.find("TYPE")) != text.npos;) text.replace(at, 4, type);
        return text;
    };
    const auto v4 = parse4(
        with("diffuse") +
        "Material \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" 0.2\n" + kSphere);
    EXPECT_EQ(value<Rgb>(material(v4), "weight").r, 0.2f);
    EXPECT_LT(material(v4).children[0].object, material(v4).children[1].object);
    // In v3 the amount is that of the first.
    const auto v3 = parse_pbrt3(
        with("matte") +
        "Material \"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"b\"\n" +
        std::string(kSphere));
    EXPECT_GT(material(v3).children[0].object, material(v3).children[1].object);
}

TEST(Pbrt, NamedMetalsAndGlasses) {
    const auto silver = parse4(
        "Material \"conductor\" \"spectrum eta\" \"metal-Ag-eta\" \"spectrum k\" \"metal-Ag-k\" " +
        std::string(kSphere));
    EXPECT_NEAR(value<Rgb>(material(silver), "k").r, 4.8, 0.1);
    const auto glass =
        parse4("Material \"dielectric\" \"spectrum eta\" \"glass-BK7\" " + std::string(kSphere));
    EXPECT_NEAR(value<double>(material(glass), "int_ior"), 1.5168, 1e-6);
    EXPECT_EQ(value<double>(material(glass), "ext_ior"), 1.0);
}

TEST(Pbrt, ConductorsByReflectanceHaveIt) {
    const auto scene =
        parse4("Material \"conductor\" \"rgb reflectance\" [.2 .5 .8] " + std::string(kSphere));
    const Rgb k = value<Rgb>(material(scene), "k");
    for (int i = 0; i < 3; ++i) {  // with η = 1: R = k² / (4 + k²)
        const float R = sqr(k[i]) / (4 + sqr(k[i]));
        EXPECT_NEAR(R, Rgb(0.2f, 0.5f, 0.8f)[i], 1e-5);
    }
}

TEST(Pbrt, SampledSpectraBecomeColours) {
    const auto options = with_files({{"a.spd", "# flat\n300 0.5\n900 0.5\n"}});
    const std::string text =
        "AreaLightSource \"diffuse\" \"spectrum L\" \"a.spd\" " + std::string(kSphere);
    const auto L = [&](const SceneDescription& scene) {
        return value<Rgb>(child(scene, find(scene, "shape"), "emitter"), "radiance");
    };
    // As it is in v3; in v4 with the luminance 1.
    expect_near(L(parse_pbrt3(text, options)), Rgb(0.6025f, 0.474f, 0.4545f), 2e-3);
    EXPECT_NEAR(luminance(L(parse4(text, options))), 1, 1e-4);
    const auto grey = parse4("Material \"diffuse\" \"spectrum reflectance\" [300 .4 900 .4] " +
                             std::string(kSphere));
    expect_near(value<Rgb>(material(grey), "reflectance"), Rgb(0.4f), 1e-3);
}

TEST(Pbrt, BumpMapsLieAroundBothSides) {
    const std::string texture =
        "Texture \"h\" \"float\" \"imagemap\" \"string filename\" \"h.png\"\n";
    const auto v4 =
        parse4(texture + "Material \"diffuse\" \"texture displacement\" \"h\" " + kSphere);
    const SceneObject& bump = child(v4, find(v4, "shape"), "bsdf");
    EXPECT_EQ(bump.type, "bumpmap");
    EXPECT_EQ(child(v4, bump, "bsdf").type, "twosided");
    const auto v3 =
        parse_pbrt3(texture + "Material \"glass\" \"texture bumpmap\" \"h\" " + kSphere);
    EXPECT_EQ(child(v3, child(v3, find(v3, "shape"), "bsdf"), "bsdf").type, "dielectric");
}

// ---- Textures

TEST(Pbrt, ImagesAreTurnedUpsideDown) {
    const auto scene =
        parse4("Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\"\n"
               "\"float vscale\" 2 \"float udelta\" 0.25\n"
               "Material \"diffuse\" \"texture reflectance\" \"t\" " +
               std::string(kSphere));
    const SceneObject& image = child(scene, material(scene), "texture", "reflectance");
    expect_near(value<Transform>(image, "to_uv").point({0.5f, 0.1f, 0}), {0.75f, 0.8f, 0});
}

TEST(Pbrt, ImagesMayEndAndBeInverted) {
    const auto scene =
        parse4("Texture \"a\" \"float\" \"imagemap\" \"string filename\" \"a.png\" \"string wrap\" "
               "\"black\" \"bool invert\" true\nShape \"sphere\" \"texture alpha\" \"a\"\n");
    const SceneObject* image = nullptr;
    const SceneObject* inverted = nullptr;
    for (const SceneObject& o : scene.objects) {
        if (o.type == "bitmap") image = &o;
        if (o.type == "mix") inverted = &o;
    }
    ASSERT_TRUE(image && inverted);
    EXPECT_EQ(*image->find("wrap_mode")->as<std::string>(), "zero");
    EXPECT_EQ(*inverted->find("value0")->as<Rgb>(), Rgb(1));
    EXPECT_EQ(*inverted->find("value1")->as<Rgb>(), Rgb(0));
    ASSERT_EQ(inverted->children.size(), 1u);
    EXPECT_EQ(inverted->children[0].name, "weight");
}

// A light with a constant alpha of zero shines in pbrt; with any other alpha it shines where it is.
TEST(Pbrt, InvisibleLightsAreRefused) {
    const auto lamp = [](const char* alpha) {
        return std::string("AreaLightSource \"diffuse\" \"rgb L\" [1 1 1]\nShape \"sphere\" "
                           "\"float alpha\" ") +
               alpha + "\n";
    };
    EXPECT_EQ(material(parse4(lamp("0.5"))).type, "mask");
    expect_scene_error(3, "an area light that no ray meets (alpha 0) is not supported",
                       [&] { parse4(lamp("0")); });
}

TEST(Pbrt, ConstantsAndProductsOfConstantsAreColours) {
    const auto scene = parse_pbrt3(
        "Texture \"a\" \"color\" \"constant\" \"rgb value\" [.5 .6 .7]\n"
        "Texture \"b\" \"color\" \"scale\" \"texture tex1\" \"a\" \"rgb tex2\" [.5 .5 .5]\n"
        "Material \"matte\" \"texture Kd\" \"b\" " +
        std::string(kSphere));
    expect_near(value<Rgb>(material(scene), "reflectance"), Rgb(0.25f, 0.3f, 0.35f));
}

// The factor of a texture of spectra is a float in v4, a colour in v3 and in what was converted from it.
TEST(Pbrt, FactorsOfV4AreFloats) {
    const std::string textures = "Texture \"f\" \"float\" \"constant\" \"float value\" 0.5\n"
                                 "Texture \"g\" \"float\" \"checkerboard\"\n"
                                 "Texture \"g\" \"spectrum\" \"dots\"\n"
                                 "Texture \"s\" \"spectrum\" \"constant\" \"rgb value\" [1 0 0]\n"
                                 "Texture \"c\" \"spectrum\" \"checkerboard\"\n";
    const auto product = [&](const std::string& factors) {
        return parse4(textures + "Texture \"p\" \"spectrum\" \"scale\" " + factors +
                      "\nMaterial \"diffuse\" \"texture reflectance\" \"p\"\n" + kSphere);
    };
    const auto constant = product("\"texture tex\" \"s\" \"texture scale\" \"f\"");
    EXPECT_EQ(value<Rgb>(material(constant), "reflectance"), Rgb(0.5f, 0, 0));
    const auto scaled = product("\"texture tex\" \"c\" \"texture scale\" \"f\"");
    const SceneObject& half = child(scaled, material(scaled), "texture", "reflectance");
    EXPECT_EQ(half.type, "scale");
    EXPECT_EQ(value<Rgb>(half, "scale"), Rgb(0.5f));
    EXPECT_EQ(child(scaled, half, "texture", "value").type, "checkerboard");
    // A float texture is a number, also of an image of colours.
    const auto varying = product("\"texture tex\" \"s\" \"texture scale\" \"g\"");
    const SceneObject& mix = child(varying, material(varying), "texture", "reflectance");
    EXPECT_EQ(mix.type, "mix");
    EXPECT_EQ(value<Rgb>(mix, "value0"), Rgb(0));
    EXPECT_EQ(value<Rgb>(mix, "value1"), Rgb(1, 0, 0));
    EXPECT_EQ(child(varying, mix, "texture", "weight").type, "checkerboard");
    const auto of_spectra = product("\"texture tex\" \"s\" \"texture scale\" \"c\"");
    EXPECT_EQ(child(of_spectra, material(of_spectra), "texture", "reflectance").type, "scale");
    expect_scene_error(7, "there is no float texture \"none\"",
                       [&] { product("\"texture tex\" \"s\" \"texture scale\" \"none\""); });
}

TEST(Pbrt, CornersOfBilerpAreColours) {
    expect_scene_error(3, "parameter \"v01\" of spectrum Texture \"bilerp\" must be", [] {
        parse4("Texture \"c\" \"spectrum\" \"checkerboard\"\n"
               "Texture \"b\" \"spectrum\" \"bilerp\" \"texture v01\" \"c\"");
    });
    const auto floats = parse4("Texture \"b\" \"float\" \"bilerp\" \"float v01\" 0.25\n"
                               "Shape \"sphere\" \"texture alpha\" \"b\"");
    int count = 0;
    for (const SceneObject& o : floats.objects)
        if (o.type == "bilerp") count += value<Rgb>(o, "v01") == Rgb(0.25f);
    EXPECT_EQ(count, 1);
}

TEST(Pbrt, CheckerboardHasOneSquareToTheUnit) {
    const auto scene =
        parse4("Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 8 \"float vscale\" 4\n"
               "Material \"diffuse\" \"texture reflectance\" \"t\" " +
               std::string(kSphere));
    const SceneObject& t = child(scene, material(scene), "texture", "reflectance");
    expect_near(value<Transform>(t, "to_uv").point({1, 1, 0}), {4, 2, 0});
    EXPECT_EQ(value<Rgb>(t, "color0"), Rgb(1));
}

TEST(Pbrt, TexturesOfSpaceHaveTheCurrentTransform) {
    const std::string world = "Scale 2 2 2\nTexture \"t\" \"spectrum\" \"marble\" \"float scale\" "
                              "3 \"integer octaves\" 4\n"
                              "Identity Material \"diffuse\" \"texture reflectance\" \"t\" " +
                              std::string(kSphere);
    const auto v4 = parse4(world);
    const SceneObject& t = child(v4, material(v4), "texture", "reflectance");
    EXPECT_EQ(t.type, "marble");
    EXPECT_EQ(value<double>(t, "scale"), 3);
    EXPECT_EQ(value<int64_t>(t, "octaves"), 4);
    expect_near(value<Transform>(t, "to_texture").point({2, 4, 6}), {1, 2, 3});
    // pbrt-v3 applies the transform itself to the points of the world.
    const auto v3 = parse_pbrt3(
        "Scale 2 2 2\nTexture \"t\" \"color\" \"checkerboard\" \"integer dimension\" 3\n"
        "Identity Material \"matte\" \"texture Kd\" \"t\" " +
        std::string(kSphere));
    const SceneObject& cubes = child(v3, material(v3), "texture", "reflectance");
    EXPECT_EQ(cubes.type, "checkerboard3d");
    expect_near(value<Transform>(cubes, "to_texture").point({1, 2, 3}), {2, 4, 6});
}

TEST(Pbrt, CoatsHaveTexturesOfRoughness) {
    const std::string texture = "Texture \"r\" \"float\" \"checkerboard\"\n";
    const auto scene =
        parse4(texture + "Material \"coateddiffuse\" \"texture roughness\" \"r\" " + kSphere);
    EXPECT_EQ(child(scene, material(scene), "texture", "alpha").type, "roughness_to_alpha");
}

// ---- Lights and the view

TEST(Pbrt, LightsWithImages) {
    const auto v4 =
        parse4("Translate 1 2 3\nLightSource \"goniometric\" \"string filename\" \"a.exr\" \"float "
               "scale\" 2\n"
               "LightSource \"projection\" \"string filename\" \"b.exr\" \"float power\" 50\n");
    const SceneObject &g = find(v4, "emitter"), &p = find(v4, "emitter", 1);
    EXPECT_EQ(g.type, "goniometric");
    expect_near(value<Rgb>(g, "intensity"), Rgb(2));
    // The middle of the square, its +z, is the light's +y.
    expect_near(value<Transform>(g, "to_world").point({0, 0, 1}), {1, 3, 3});
    EXPECT_EQ(p.type, "projection");
    EXPECT_EQ(value<double>(p, "fov"), 90);
    EXPECT_NEAR(value<double>(p, "power"), 50, 1e-4);
    expect_near(value<Transform>(p, "to_world").vector({0, 1, 0}), {0, 1, 0});
    const auto v3 =
        parse_pbrt3("LightSource \"goniometric\" \"string mapname\" \"a.exr\" \"rgb I\" [1 2 3]\n"
                    "LightSource \"projection\" \"string mapname\" \"b.exr\"\n");
    expect_near(value<Rgb>(find(v3, "emitter"), "intensity"), Rgb(1, 2, 3));
    // The column of azimuth 0 is +x, a quarter on it is +z; the zenith is +y.
    const Transform t = value<Transform>(find(v3, "emitter"), "to_world");
    expect_near(t.vector({0, 1, 0}), {0, 1, 0});
    expect_near(t.vector({0, 0, -1}), {1, 0, 0});
    expect_near(t.vector({1, 0, 0}), {0, 0, 1});
    EXPECT_EQ(value<double>(find(v3, "emitter", 1), "fov"), 45);
    expect_near(value<Transform>(find(v3, "emitter", 1), "to_world").vector({0, 1, 0}), {0, -1, 0});
}

TEST(Pbrt, LightsOfV4AreScaledByPowerAndExposure) {
    const auto scene = parse_pbrt(
        "Film \"rgb\" \"float iso\" 200\nWorldBegin\n"
        "LightSource \"point\" \"rgb I\" [1 2 3] \"float scale\" 2 \"point3 from\" [1 2 3]\n"
        "LightSource \"point\" \"float power\" 100\n",
        "s.pbrt");
    expect_near(value<Rgb>(find(scene, "emitter"), "intensity"), Rgb(4, 8, 12));
    expect_near(value<Vec3>(find(scene, "emitter"), "position"), {1, 2, 3});
    expect_near(value<Rgb>(find(scene, "emitter", 1), "intensity"), Rgb(2 * 100 / (4 * kPi)));
    const auto v3 = parse_pbrt("Film \"image\" \"float scale\" 5\nWorldBegin\nLightSource "
                               "\"infinite\" \"rgb L\" [1 2 3]\nWorldEnd",
                               "s.pbrt");
    expect_near(value<Rgb>(find(v3, "emitter"), "radiance"), Rgb(5, 10, 15));
}

TEST(Pbrt, SpotsFallOffAsInTheirVersion) {
    const std::string spot = "LightSource \"spot\" \"float coneangle\" 40 \"float conedeltaangle\" "
                             "10 \"point from\" [0 1 0] \"point to\" [0 0 0]";
    const auto v3 = parse_pbrt3(spot), v4 = parse4(spot);
    EXPECT_EQ(value<double>(find(v3, "emitter"), "beam_width"), 30);
    EXPECT_EQ(value<std::string>(find(v3, "emitter"), "falloff"), "quartic");
    EXPECT_EQ(value<std::string>(find(v4, "emitter"), "falloff"), "smooth");
    expect_near(value<Transform>(find(v4, "emitter"), "to_world").vector({0, 0, 1}), {0, -1, 0});
}

TEST(Pbrt, EnvironmentsOfV3HaveZUp) {
    const auto scene = parse_pbrt3("LightSource \"infinite\" \"string mapname\" \"sky.exr\"");
    const Transform t = value<Transform>(find(scene, "emitter"), "to_world");
    expect_near(t.vector({0, 1, 0}), {0, 0, 1});   // the image's upper edge
    expect_near(t.vector({0, 0, -1}), {1, 0, 0});  // u = 0: azimuth 0 in pbrt
    expect_near(t.vector({1, 0, 0}), {0, 1, 0});   // u = 1/4: azimuth 90°
}

TEST(Pbrt, ScreenWindowSetsFieldOfViewAndCentre) {
    const auto scene =
        parse_options("Film \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" 100\n"
                      "Camera \"perspective\" \"float fov\" 90 \"float screenwindow\" [0 2 -1 1]");
    const SceneObject& sensor = find(scene, "sensor");
    EXPECT_NEAR(value<double>(sensor, "fov"), 90, 1e-4);
    EXPECT_NEAR(value<double>(sensor, "aspect"), 1, 1e-6);
    EXPECT_NEAR(value<double>(sensor, "principal_point_offset_x"), 0.5, 1e-6);
    EXPECT_NEAR(value<double>(sensor, "principal_point_offset_y"), 0, 1e-6);
}

TEST(Pbrt, LengthsOfTheLensAreThoseOfTheCamera) {
    const auto scene = parse_options("Scale 0.5 0.5 0.5 Camera \"perspective\" \"float "
                                     "lensradius\" 1 \"float focaldistance\" 10");
    EXPECT_EQ(find(scene, "sensor").type, "thinlens");
    EXPECT_NEAR(value<double>(find(scene, "sensor"), "aperture_radius"), 2, 1e-6);
    EXPECT_NEAR(value<double>(find(scene, "sensor"), "focus_distance"), 20, 1e-5);
}

TEST(Pbrt, DepthsCountEdges) {
    const auto scene = parse_options("Integrator \"path\" \"integer maxdepth\" 7");
    EXPECT_EQ(value<int64_t>(find(scene, "integrator"), "max_depth"), 8);
}

// ---- Errors

struct BadScene {
    const char* world;
    int line;
    const char* message;
};

TEST(Pbrt, ErrorsNameTheLineAndWhatIsNear) {
    const BadScene kScenes[] = {
        {"Shap \"sphere\"", 2, "unknown directive \"Shap\" (did you mean \"Shape\"?)"},
        {"\n[", 3, "expected a directive, found \"[\""},
        {"\"x\"", 2, "expected a directive, found the string \"x\""},
        {"Shape \"spheer\"", 2, "unknown Shape \"spheer\" (did you mean \"sphere\"?)"},
        {"Shape \"sphere\"\n\"float radios\" 1", 3,
         "Shape \"sphere\" has no parameter \"radios\" (did you mean \"radius\"?)"},
        {"Shape \"sphere\" \"flot radius\" 1", 2,
         "unknown type of parameter \"flot\" (did you mean \"float\"?)"},
        {"Shape \"sphere\" \"radius\" 1", 2, "expected a parameter such as \"float radius\""},
        {"Shape \"sphere\" \"integer radius\" 1", 2, "must be a float, not of type integer"},
        {"Shape \"sphere\" \"float radius\" [1 2]", 2, "must be one value, but has 2"},
        {"Shape \"sphere\" \"float radius\" []", 2, "has no value"},
        {"Shape \"sphere\" \"float radius\" 1 \"float radius\" 1", 2, "given twice"},
        {"Shape \"sphere\" \"float radius\" [1", 2, "no closing bracket"},
        {"Shape \"sphere\" \"float radius\" -1", 2, "is -1, but must be at least"},
        {"Shape \"sphere\" \"float zmin\" 0.5 \"float zmax\" 0.25", 2,
         "the zmin of a sphere is 0.5, but must be below its zmax, 0.25"},
        {"Shape \"curve\"", 2, "Shape \"curve\": curves are not supported"},
        {"Shape \"cone\"", 2, "unknown Shape \"cone\""},
        {"Shape \"trianglemesh\"", 2, "needs \"point3 P\""},
        {"Shape \"trianglemesh\" \"point3 P\" [0 0 0 1]", 2,
         "has 4 numbers, which is not a multiple of 3"},
        {"Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 3]", 2,
         "index 3 is out of range"},
        {"Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n\"normal N\" [0 0 1]", 3,
         "there are 1 normals, but 3 points"},
        {"NamedMaterial \"a\"\nShape \"sphere\"", 2, "there is no named material \"a\""},
        {"NamedMaterial \"a\"", 2, "there is no named material \"a\""},
        {"MakeNamedMaterial \"a\"", 2, "needs a \"string type\""},
        {"Material \"subsurface\"", 2, "scattering below the surface is not supported"},
        {"Material \"diffuse\" \"texture reflectance\" \"t\"", 2,
         "there is no spectrum texture \"t\""},
        {"Material \"diffuse\" \"rgb reflectance\" [1 2]", 2, "expected three numbers, found 2"},
        {"Material \"conductor\" \"spectrum eta\" \"metal-Ak-eta\"", 2,
         "unknown spectrum \"metal-Ak-eta\" (did you mean \"metal-A"},
        {"Texture \"t\" \"int\" \"imagemap\"", 2, "a texture is of the type float or spectrum"},
        {"Texture \"t\" \"float\" \"directionmix\"", 2, "this one is of the normal"},
        {"Material \"measured\"", 2, "measured BSDFs are not supported"},
        {"Camera \"perspective\"", 2, "Camera must stand before WorldBegin"},
        {"AttributeEnd", 2, "AttributeEnd without AttributeBegin"},
        {"AttributeBegin TransformEnd", 2, "the last thing opened is the AttributeBegin"},
        {"\nAttributeBegin", 3, "AttributeBegin is never closed"},
        {"ObjectInstance \"o\"", 2, "there is no object \"o\""},
        {"CoordSysTransform \"c\"", 2, "there is no coordinate system \"c\""},
        {"Transform [1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1]", 2, "not invertible"},
        {"Scale 1 0 1", 2, "must not be zero, but are 1 0 1"},
        {"LookAt 0 0 0 0 1 0 0 1 0", 2, "up vector 0 1 0"},
        {"LookAt 1 2 3 1 2 3 0 1 0", 2, "both are 1 2 3"},
        {"LightSource \"distant\" \"point3 from\" [0 0 1]", 2, "both are 0 0 1"},
        {"Material \"dielectric\" \"float eta\" -3", 2,
         "parameter \"eta\" is -3, but must be above zero"},
        {"Material \"diffuse\" \"rgb reflectance\" [1 -2 3]", 2, "but is 1 -2 3"},
        {"Include \"none.pbrt\"", 2, "cannot read the file \"none.pbrt\""},
        {"MakeNamedMedium \"m\" \"string type\" \"homogeneous\"", 2,
         "a medium that scatters is not supported"},
        {"ColorSpace \"rec2020\"", 2, "the colour space \"rec2020\" is not supported"},
    };
    for (const BadScene& s : kScenes) {
        SCOPED_TRACE(s.world);
        expect_scene_error(s.line, s.message, [&] { parse4(s.world); });
    }
    expect_scene_error(0, "no WorldBegin", [] { parse_pbrt("", "s.pbrt"); });
    expect_scene_error(1, "Shape must stand after WorldBegin",
                       [] { parse_pbrt("Shape \"sphere\"", "s.pbrt"); });
    expect_scene_error(2, "Attribute is a directive of pbrt-v4",
                       [] { parse_pbrt3("Attribute \"shape\""); });
    expect_scene_error(1, "includes itself", [] {
        parse_pbrt("Include \"s.pbrt\"", "s.pbrt", with_files({{"s.pbrt", "Include \"s.pbrt\""}}));
    });
}

TEST(Pbrt, LenientReplacesWhatIsRefused) {
    ReadOptions lenient;
    lenient.lenient = true;
    const auto scene = parse_pbrt3(
        "Material \"fourier\" \"string bsdffile\" \"a.bsdf\"\n" + std::string(kSphere), lenient);
    EXPECT_EQ(material(scene).type, "diffuse");
    ASSERT_EQ(scene.warnings.size(), 1u);
    EXPECT_EQ(scene.warnings[0], "s.pbrt:2: Material \"fourier\": measured BSDFs are not "
                                 "supported; a grey diffuse one instead");
    const auto curve =
        parse4("Shape \"curve\"\n" + std::string(kSphere) + "Shape \"sphere\" \"float radios\" 2\n",
               lenient);
    EXPECT_EQ(curve.warnings.size(), 2u);
    EXPECT_EQ(find(curve, "shape", 1).type, "sphere");
}

TEST(Pbrt, BrokenTextIsAnErrorAndNothingElse) {
    const std::string whole =
        "LookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 45\n"
        "Film \"rgb\" \"integer xresolution\" 10\nWorldBegin\n"
        "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"a.png\"\n"
        "AttributeBegin Translate 1 2 3 AreaLightSource \"diffuse\" \"rgb L\" [1 2 3]\n"
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2]\n"
        "AttributeEnd ObjectBegin \"o\" Shape \"sphere\" \"texture alpha\" \"t\" ObjectEnd\n"
        "ObjectInstance \"o\" MakeNamedMaterial \"m\" \"string type\" \"conductor\"\n";
    const std::string_view kInsertions[] = {"[",      "]", "\"", " 1e38 ",    " -1 ",
                                            "Shape ", "#", "\n", "ObjectEnd "};
    std::mt19937 random(1);
    int errors = 0;
    constexpr int kTexts = 5000;
    for (int i = 0; i < kTexts; ++i) {
        std::string text = whole;
        for (int edits = 1 + int(random() % 3); edits > 0; --edits) {
            const size_t at = random() % text.size();
            switch (random() % 4) {
            case 0: text.erase(at, 1 + random() % 8); break;
            case 1: text.insert(at, kInsertions[random() % std::size(kInsertions)]); break;
            case 2: text[at] = char(random() % 256); break;
            default: text.insert(at, text.substr(random() % text.size(), random() % 40));
            }
        }
        ReadOptions options;
        options.lenient = i % 2 == 1;
        try {
            dump(parse_pbrt(text, "s.pbrt", options));
        } catch (const SceneError&) {
            ++errors;
        }
    }
    EXPECT_GT(errors, kTexts / 2);
}

// ---- Scenes of others

TEST(Pbrt, SharedScenesAreRead) {
    const auto files = testing::shared_files(".pbrt");
    if (files.empty()) GTEST_SKIP() << "no folder of shared scenes";
    int read = 0;
    for (const std::string& file : files) {
        SCOPED_TRACE(file);
        ReadOptions options;
        options.lenient = file.find("barcelona") != file.npos;
        if (file.ends_with("/geometry.pbrt") || file.ends_with("/materials.pbrt")) continue;
        SceneDescription scene;
        ASSERT_NO_THROW(scene = read_pbrt(file, options));
        EXPECT_EQ(scene.warnings.size(), options.lenient ? 1u : 0u);  // leather, a measured BSDF
        ++read;
    }
    EXPECT_GE(read, 9);
}

TEST(Pbrt, TablesNameEveryParameterOnceForEachVersion) {
    for (const PluginInfo& info : pbrt_plugins()) {
        std::map<std::string, int> count;
        for (const ParamInfo& p : info.params) ++count[p.name];
        for (const auto& [name, n] : count)
            EXPECT_LE(n, 2) << info.category << ' ' << info.name << ' ' << name;
    }
}

}  // namespace
}  // namespace etendue
