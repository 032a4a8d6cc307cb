// Area lights for Mitsuba 3: what has a power or emits from both sides looks the same without these parameters.

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "bsdf/material.h"
#include "emitter/emitter.h"
#include "random.h"
#include "readers/mitsuba_xml.h"
#include "scene/builder.h"
#include "scene/plain_mitsuba.h"

namespace etendue::test {
namespace {

SceneDescription parse(const std::string& body) {
    return parse_mitsuba_xml(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>" + body + "</scene>", "scene.xml");
}

double power_of(const Scene& scene) {
    double sum = 0;
    for (const auto& e : scene.emitters()) sum += e->power();
    return sum;
}

/// Sums of the emission that rays from all around meet: on their way down, and up.
std::array<Rgb, 2> seen(const Scene& scene) {
    testing::Random random(1);
    std::array<Rgb, 2> sums;
    for (int i = 0; i < 20000; ++i) {
        const Vec3 from = random.unit_vector() * 8, d = normalize(random.in_cube() * 2 - from);
        SurfaceHit hit;
        if (!scene.intersect(Ray{from, d}, 0.5f, hit) || !hit.shape->emitter) continue;
        sums[d.z > 0] += hit.shape->emitter
                             ->eval_surface(hit.geometry.ng, {hit.location.u, hit.location.v},
                                            hit.location.prim, -d)
                             .Le;
    }
    return sums;
}

bool has_foreign_parameters(const SceneDescription& scene) {
    return std::any_of(scene.objects.begin(), scene.objects.end(), [](const SceneObject& o) {
        return o.category == "emitter" && (o.find("power") || o.find("two_sided"));
    });
}

constexpr const char* kTurned = R"(<transform name="to_world"><rotate x="1" angle="20"/>
    <rotate y="1" angle="35"/><translate x="0.5" y="-0.2" z="0.3"/></transform>)";
const std::string kFlipped = "<boolean name=\"flip_normals\" value=\"true\"/>";
const std::string kStretched = R"(<transform name="to_world"><scale x="1" y="0.5" z="2"/>
    </transform>)";
const std::string kMesh = R"("obj"><string name="filename" value=")" ETENDUE_SOURCE_DIR
                          R"(/tests/scenes/icosahedron.obj"/>)";
const std::string kShapes[] = {
    "\"rectangle\">" + std::string(kTurned),
    "\"rectangle\">" + kFlipped,
    "\"cube\">" + kStretched,
    "\"disk\">" + std::string(kTurned) + kFlipped,
    "\"sphere\">" + std::string(kTurned),
    "\"sphere\">" + kFlipped,
    "\"sphere\">" + kStretched,
    R"("cylinder"><point name="p1" x="2" y="1" z="0"/><float name="radius" value="0.4"/>)",
    kMesh};

TEST(PlainAreaLights, LookTheSame) {
    const std::string colour = "<rgb name=\"radiance\" value=\"1 2 3\"/>",
                      image = R"(<texture type="bitmap" name="radiance"><string name="filename"
                          value=")" ETENDUE_SOURCE_DIR
                              R"(/tests/scenes/formats/data/image.ppm"/></texture>)",
                      power = "<float name=\"power\" value=\"20\"/>",
                      two_sided = "<boolean name=\"two_sided\" value=\"true\"/>";
    for (const std::string& shape : kShapes)
        for (const std::string& light :
             {colour + power, colour + two_sided, colour + power + two_sided, image + two_sided,
              image + power + two_sided}) {
            const std::string text = fmt::format(
                "<shape type={}<emitter type=\"area\">{}</emitter></shape>", shape, light);
            SCOPED_TRACE(text);
            SceneDescription plain = parse(text);
            const Scene original = build_scene(plain);
            const std::vector<std::string> warnings = make_plain_mitsuba(plain);
            const bool has_two = light.find("two_sided") != light.npos;
            EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(),
                                    [](const std::string& w) {
                                        return w.find("emission from both sides") != w.npos;
                                    }),
                      has_two);
            EXPECT_FALSE(has_foreign_parameters(plain));
            const Scene scene = build_scene(plain);
            EXPECT_EQ(scene.emitters().size(), has_two ? 2u : 1u);
            // That of an image is a sum over some of its points.
            EXPECT_NEAR(power_of(scene) / power_of(original), 1,
                        light.starts_with(image) ? 5e-3 : 1e-3);
            const auto expected = seen(original), found = seen(scene);
            for (const int side : {0, 1})
                for (int c = 0; c < 3; ++c)
                    EXPECT_NEAR(found[side][c], expected[side][c], 4e-3f * expected[side][c]);
        }
}

const std::string kTwoSided =
    R"(<emitter type="area"><boolean name="two_sided" value="true"/></emitter></shape>)";

/// So that no reader can take either for the other side, even where those of the front disagree.
TEST(PlainAreaLights, TheWindingOfBacksAgreesWithTheirNormals) {
    const std::string mirror =
        R"(<transform name="to_world"><scale x="-1" y="1" z="1"/></transform>)";
    const std::string quadric = "\"sphere\">" + kStretched;
    for (const std::string& shape : {kMesh, kMesh + kFlipped, kMesh + mirror,
                                     kMesh + mirror + kFlipped, quadric, quadric + kFlipped}) {
        SCOPED_TRACE(shape);
        SceneDescription plain = parse("<shape type=" + shape + kTwoSided);
        make_plain_mitsuba(plain);
        ASSERT_EQ(plain.meshes.size(), 1u);
        const MeshData& back = plain.meshes[0];
        ASSERT_EQ(back.normals.size(), back.positions.size());
        const auto against = std::count_if(
            back.triangles.begin(), back.triangles.end(), [&](const MeshData::Triangle& t) {
                const auto& [a, b, c] = t;
                const Vec3 n = cross(back.positions[b] - back.positions[a],
                                     back.positions[c] - back.positions[a]);
                // But for slivers at a pole.
                return length(n) > 1e-6f &&
                       dot(n, back.normals[a] + back.normals[b] + back.normals[c]) <= 0;
            });
        EXPECT_EQ(against, 0);
    }
}

/// The back lies behind the front, but not beyond what is opposite. Distances grow with coordinates.
TEST(PlainAreaLights, BacksOfSmallShapesLieWithinThem) {
    const Vec3 center{100, 50, 0};
    const std::string place = R"(<transform name="to_world"><scale value="0.005"/>
        <rotate x="1" angle="50"/><translate x="100" y="50" z="0"/></transform>)";
    const std::string tube =
        R"("cylinder"><point name="p0" x="0" y="0" z="-40"/><point name="p1" x="0" y="0" z="40"/>)";
    for (const std::string& shape :
         {std::string("\"sphere\">"), "\"sphere\">" + kFlipped, tube, tube + kFlipped, kMesh}) {
        SCOPED_TRACE(shape);
        SceneDescription plain = parse("<shape type=" + shape + place + kTwoSided);
        make_plain_mitsuba(plain);
        const Scene scene = build_scene(plain);
        for (const Vec3 d : {Vec3{1, 0, 0}, Vec3{-1, 0.2f, 0}})
            for (const float start : {0.0f, 1.0f}) {
                SurfaceHit hit;
                const Vec3 from = center - d * start;
                ASSERT_TRUE(scene.intersect(Ray{from, d}, 0.5f, hit));
                ASSERT_TRUE(hit.shape->emitter);
                EXPECT_GT(hit.shape->emitter
                              ->eval_surface(hit.geometry.ng, {hit.location.u, hit.location.v},
                                             hit.location.prim, -d)
                              .Le.max(),
                          0);
            }
    }
}

/// Mitsuba 3 refuses scenes that have any.
TEST(PlainAreaLights, GroupsHaveNone) {
    const std::string lamp = "<emitter type=\"area\"/></shape>";
    SceneDescription plain =
        parse("<shape type=\"shapegroup\" id=\"g\"><shape type=\"sphere\">" + kTwoSided +
              "<shape type=\"merge\"><shape type=\"disk\"><bsdf type=\"diffuse\"/>" + lamp +
              "</shape></shape><shape type=\"instance\"><ref id=\"g\"/></shape>"
              "<shape type=\"rectangle\">" +
              lamp);
    SceneDescription lenient = plain;
    const std::vector<std::string> warnings = make_plain_mitsuba(plain);
    EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(),
                            [](const std::string& w) {
                                return w.find("in a shapegroup is left out") != w.npos;
                            }),
              2);
    const Scene scene = build_scene(plain);
    EXPECT_EQ(scene.emitters().size(), 1u);
    EXPECT_EQ(plain.roots.size(), lenient.roots.size());
}

/// Shapes that share a light do not share its power.
TEST(PlainAreaLights, EachShapeHasThePowerOfItsLight) {
    SceneDescription plain = parse("<shape type=\"sphere\"/><shape type=\"rectangle\"/>");
    plain.objects.push_back(
        {"emitter", "area", "lamp", {}, {{"power", 20.0, {}}, {"radiance", Rgb(3), {}}}, {}});
    for (SceneObject& o : plain.objects)
        if (o.category == "shape") o.children.push_back({"", int(plain.objects.size()) - 1, {}});
    EXPECT_TRUE(make_plain_mitsuba(plain).empty());
    EXPECT_FALSE(has_foreign_parameters(plain));
    const Scene scene = build_scene(plain);
    ASSERT_EQ(scene.emitters().size(), 2u);
    for (const auto& e : scene.emitters()) EXPECT_NEAR(e->power(), 20, 1e-3);
}

/// Reflectance of what rays along -z and +z meet.
TEST(PlainAreaLights, BacksHaveTheMaterialOfTheBack) {
    const std::string lamp =
        "<emitter type=\"area\"><boolean name=\"two_sided\" value=\"true\"/></emitter></shape>";
    const auto diffuse = [](const char* value) {
        return fmt::format("<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"{}\"/>"
                           "</bsdf>",
                           value);
    };
    const auto albedos = [&](const std::string& bsdf) {
        SceneDescription plain = parse("<shape type=\"rectangle\">" + bsdf + lamp);
        make_plain_mitsuba(plain);
        const Scene scene = build_scene(plain);
        std::array<float, 2> found{};
        for (const float side : {1.0f, -1.0f}) {
            SurfaceHit hit;
            EXPECT_TRUE(scene.intersect(Ray{{0.2f, 0.1f, side}, {0, 0, -side}}, 0.5f, hit));
            ComponentArena arena;
            const Vec3 wo{0, 0, side}, wi = normalize(Vec3{1, 0, side});
            const SurfaceGeometry& g = hit.geometry;
            const Bsdf b =
                hit.shape->material->bsdf({g.p, g.ng, g.ns, {1, 0, 0}, {0, 1, 0}, g.uv, wo}, arena);
            found[side < 0] = b.eval(wo, wi, TransportMode::Radiance).f.r * kPi * std::sqrt(2.0f);
        }
        return found;
    };
    const auto expect = [](const std::array<float, 2>& found, float front, float back) {
        EXPECT_NEAR(found[0], front, 1e-4f);
        EXPECT_NEAR(found[1], back, 1e-4f);
    };
    expect(albedos(""), 0, 0);
    expect(albedos(diffuse("0.3")), 0.3f, 0);
    expect(albedos("<bsdf type=\"twosided\">" + diffuse("0.3") + "</bsdf>"), 0.3f, 0.3f);
    expect(albedos("<bsdf type=\"twosided\">" + diffuse("0.3") + diffuse("0.6") + "</bsdf>"), 0.3f,
           0.6f);
    expect(
        albedos(
            "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.9\"/><bsdf type=\"twosided\">" +
            diffuse("0.3") + diffuse("0.6") + "</bsdf></bsdf>"),
        0.3f, 0.6f);
}

/// A second pane would refract once more.
TEST(PlainAreaLights, PanesStaySingle) {
    SceneDescription plain = parse(R"(<shape type="sphere"><bsdf type="dielectric"/>
        <emitter type="area"><boolean name="two_sided" value="true"/></emitter></shape>)");
    const std::vector<std::string> warnings = make_plain_mitsuba(plain);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("no parameter \"two_sided\""), std::string::npos) << warnings[0];
    EXPECT_EQ(build_scene(plain).emitters().size(), 1u);
}

}  // namespace
}  // namespace etendue::test
