// Shadow rays at the limits of single precision.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "math/frame.h"
#include "random.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

const std::string kSky = "<emitter type=\"constant\"/>";

std::string wall(float z) {
    return rectangle(fmt::format("<scale value=\"10\"/><translate z=\"{}\"/>", z), "");
}

// A wall 1 mm before another, seen from a kilometre away.
TEST(Transmittance, AWallHidesWhatLiesCloseBehindIt) {
    const Scene scene = build(front_camera(1) + kSky + wall(0) + wall(0.001f));
    const Vec3 far{0.3f, 0.2f, 1000}, behind{1.2f, -0.7f, 0}, before{1.2f, -0.7f, 0.001f};
    const Vec3 n{0, 0, 1};
    EXPECT_EQ(scene.transmittance({far, -n}, {behind, n}), 0);
    EXPECT_EQ(scene.transmittance({behind, n}, {far, -n}), 0);
    EXPECT_EQ(scene.transmittance({far, -n}, {before, n}), 1);
    EXPECT_EQ(scene.transmittance({before, n}, {far, -n}), 1);
}

// No point of a surface is hidden by its own surface, from near or far, head on or grazing.
TEST(Transmittance, ASurfaceDoesNotHideItself) {
    etendue::testing::Random random(7);
    for (const float distance : {0.1f, 1.0f, 100.0f, 1e4f})
        for (const float size : {1.0f, 50.0f}) {
            int hidden = 0, total = 0;
            for (int turn = 0; turn < 20; ++turn) {
                const Scene scene = build(
                    front_camera(1) + kSky +
                    rectangle(fmt::format("<scale value=\"{}\"/><rotate x=\"1\" y=\"0.3\" "
                                          "angle=\"{}\"/><translate x=\"1\" y=\"-2\" z=\"3\"/>",
                                          size, 3 + 17 * turn),
                              ""));
                const uint32_t shape = uint32_t(scene.shapes().size() - 1);
                for (int i = 0; i < 1000; ++i) {
                    const SurfaceLocation at{shape, uint32_t(random.bits() & 1), kNoInstance,
                                             0.5f * random.next_1d(), 0.5f * random.next_1d()};
                    const SurfaceGeometry g = scene.surface(at);
                    // cos θ down to 0.01
                    const float cosine = std::pow(10.0f, -2 * random.next_1d()),
                                phi = 2 * kPi * random.next_1d(), sine = safe_sqrt(1 - sqr(cosine));
                    const Vec3 w = Frame::from_normal(g.ng).to_world(
                        {sine * std::cos(phi), sine * std::sin(phi), cosine});
                    const Vec3 from = g.p + w * distance;
                    hidden += scene.transmittance({from}, {g.p, g.ng, g.slack}) == 0;
                    hidden += scene.transmittance({g.p, g.ng, g.slack}, {from}) == 0;
                    total += 2;
                }
            }
            EXPECT_EQ(hidden, 0) << "of " << total << " at " << distance << ", size " << size;
        }
}

/// A large shape whose surface passes near the origin.
struct LargeShape {
    const char* name;
    std::string xml;
};

std::string shape(const std::string& type, const std::string& transform,
                  const std::string& more = "") {
    return fmt::format("<shape type=\"{}\"><transform name=\"to_world\">{}</transform>{}</shape>",
                       type, transform, more);
}

/// An instance of a shape that lies far from the origin of its group.
std::string instance(const std::string& inside, const std::string& transform) {
    return "<shape type=\"shapegroup\" id=\"group\">" + inside + "</shape>" +
           shape("instance", transform, "<ref id=\"group\"/>");
}

const std::string kTurnedSquare =
    "<rotate x=\"1\" y=\"0.3\" angle=\"23\"/><rotate y=\"1\" z=\"0.4\" angle=\"71\"/>";

const LargeShape kLargeShapes[] = {
    {"ground of radius 1000",
     "<shape type=\"sphere\"><point name=\"center\" value=\"0,-1000,0\"/><float name=\"radius\" "
     "value=\"1000\"/></shape>"},
    {"wall of radius 1e5",
     "<shape type=\"sphere\"><point name=\"center\" value=\"100001,40.8,81.6\"/><float "
     "name=\"radius\" value=\"100000\"/></shape>"},
    {"sphere around the scene", shape("sphere", "<scale value=\"20000\"/><translate y=\"20000\"/>",
                                      "<boolean name=\"flip_normals\" value=\"true\"/>")},
    {"disk", shape("disk", "<scale value=\"5000\"/>" + kTurnedSquare)},
    {"cylinder",
     shape("cylinder", "<translate y=\"-1\" z=\"-0.5\"/><scale value=\"3000\"/>" + kTurnedSquare)},
    {"rectangle", shape("rectangle", "<scale value=\"1000\"/>" + kTurnedSquare)},
    {"large rectangle", shape("rectangle", "<scale value=\"100000\"/>" + kTurnedSquare)},
    {"box", shape("cube", "<translate z=\"-1\"/><scale value=\"2000\"/>" + kTurnedSquare)},
    {"instance of a rectangle",
     instance(shape("rectangle", kTurnedSquare + "<translate x=\"3000\" y=\"2000\" z=\"-700\"/>"),
              "<translate x=\"-3000\" y=\"-2000\" z=\"700\"/>")},
    {"instance of a sphere",
     instance("<shape type=\"sphere\"><point name=\"center\" value=\"0,-10,0\"/><float "
              "name=\"radius\" value=\"10\"/></shape>",
              "<scale value=\"300\"/>" + kTurnedSquare)},
};

/// A point on the last shape of the scene, and near the origin on large ones.
SurfaceHit point_near_origin(const Scene& scene, etendue::testing::Random& random) {
    SurfaceHit hit;
    for (;;) {
        // From a sphere about the origin through it.
        const Vec3 d = normalize(random.in_cube()), o = normalize(random.in_cube()) * 5;
        if (scene.intersect({o, d, kInf}, 0.5f, hit) && length(hit.geometry.p) < 10) return hit;
    }
}

// Of walks, shadow rays, rays of light from the surface, and of their other ends.
TEST(Transmittance, LargeSurfacesDoNotHideThemselves) {
    etendue::testing::Random random(8);
    for (const LargeShape& large : kLargeShapes) {
        // A small object, whose size determines offsets of rays near the origin.
        const Scene scene = build(front_camera(1) + kSky + large.xml);
        int met_again = 0, hidden = 0, total = 0;
        float reach = 0;
        for (int i = 0; i < 20000; ++i) {
            const SurfaceHit at = point_near_origin(scene, random);
            const SurfaceGeometry& g = at.geometry;
            const float cosine = std::pow(10.0f, -1.5f * random.next_1d()),
                        phi = 2 * kPi * random.next_1d(), sine = safe_sqrt(1 - sqr(cosine));
            const Vec3 n = i % 2 ? g.ng : -g.ng,
                       w = Frame::from_normal(n).to_world(
                           {sine * std::cos(phi), sine * std::sin(phi), cosine});
            const RayEnd end{g.p, g.ng, g.slack};
            SurfaceHit next;
            if (scene.intersect({offset_origin(end, w), w, kInf}, 0.5f, next) && next.t < 0.5f) {
                ++met_again;
                reach = std::max(reach, next.t * cosine);
            }
            const Vec3 from = g.p + w * std::pow(10.0f, 1 - 2 * random.next_1d());
            hidden += scene.transmittance(end, {from}) == 0;
            hidden += scene.transmittance({from}, end) == 0;
            ++total;
        }
        EXPECT_EQ(met_again, 0) << large.name << ", up to " << reach << " from the surface, of "
                                << total;
        EXPECT_EQ(hidden, 0) << large.name << ", of " << 2 * total;
    }
}

/// The share of rays from random points of the scene's only shape, which is convex, to the outside that meet it again.
double met_again(const Scene& scene, uint32_t prims, bool is_instance,
                 etendue::testing::Random& random) {
    constexpr int kRays = 500;
    const uint32_t shape = uint32_t(scene.shapes().size() - 1);
    int met = 0;
    for (int i = 0; i < kRays; ++i) {
        const Vec2 at = random.next_2d();
        const SurfaceGeometry g =
            scene.surface({shape, uint32_t(random.bits() % prims), is_instance ? 0 : kNoInstance,
                           at.x * (1 - at.y), at.y});
        const float cosine = std::pow(10.0f, -2 * random.next_1d()),
                    sine = safe_sqrt(1 - sqr(cosine)), phi = 2 * kPi * random.next_1d();
        const Vec3 w =
            Frame::from_normal(g.ng).to_world({sine * std::cos(phi), sine * std::sin(phi), cosine});
        met += scene.transmittance_to_infinity({g.p, g.ng, g.slack}, w) == 0;
    }
    return double(met) / kRays;
}

std::string turned(etendue::testing::Random& random) {
    const Vec3 axis = normalize(random.in_cube());
    return fmt::format("<rotate x=\"{}\" y=\"{}\" z=\"{}\" angle=\"{}\"/>", axis.x, axis.y, axis.z,
                       360 * random.next_1d());
}

// The normal that Embree computes in single precision is the less exact the thinner a triangle is.
TEST(Transmittance, ThinTrianglesDoNotHideThemselves) {
    etendue::testing::Random random(11);
    double met = 0;
    for (int i = 0; i < 100; ++i)
        met += met_again(build(front_camera(1) + kSky +
                               shape("rectangle", "<scale x=\"0.001\" y=\"4\"/>" + turned(random))),
                         2, false, random) /
               100;
    EXPECT_LT(met, 0.03);
}

// Embree inverts the matrices of instances in single precision.
TEST(Transmittance, ShearedInstancesDoNotHideThemselves) {
    etendue::testing::Random random(12);
    for (const char* type : {"sphere", "rectangle"}) {
        double met = 0;
        for (int i = 0; i < 100; ++i) {
            const Vec3 to = random.in_cube() * 10;
            met +=
                met_again(build(front_camera(1) + kSky +
                                instance(fmt::format("<shape type=\"{}\"/>", type),
                                         turned(random) + "<scale y=\"100\"/>" + turned(random) +
                                             fmt::format("<translate x=\"{}\" y=\"{}\" z=\"{}\"/>",
                                                         to.x, to.y, to.z))),
                          type[0] == 's' ? 1 : 2, true, random) /
                100;
        }
        EXPECT_LT(met, 1e-3) << type;
    }
}

// The offsets on large surfaces are small enough for walls of a few thousandths of their size.
TEST(Transmittance, LargeThinWallsBlock) {
    etendue::testing::Random random(9);
    const struct {
        std::string xml;
        float thickness;
    } walls[] = {
        {shape("cube", "<scale x=\"1000\" y=\"1000\" z=\"0.02\"/>" + kTurnedSquare), 0.04f},
        {shape("rectangle", "<scale value=\"1000\"/>" + kTurnedSquare) +
             shape("rectangle", "<scale value=\"1000\"/><translate z=\"0.01\"/>" + kTurnedSquare),
         0.01f},
        {shape("sphere", "<scale value=\"1000\"/><translate y=\"-1000\"/>") +
             shape("sphere", "<scale value=\"999.999\"/><translate y=\"-1000\"/>"),
         0.001f},
    };
    for (const auto& wall : walls) {
        const Scene scene = build(front_camera(1) + kSky + wall.xml);
        int leaks = 0;
        for (int i = 0; i < 5000; ++i) {
            const SurfaceHit at = point_near_origin(scene, random);
            const SurfaceGeometry& g = at.geometry;
            const RayEnd end{g.p, g.ng, g.slack};
            // Through the other surface of the wall, on the side where it is.
            for (const float side : {-1.0f, 1.0f}) {
                SurfaceHit other;
                const Vec3 n = g.ng * side;
                if (!scene.intersect({g.p + n * (0.3f * wall.thickness), n, kInf}, 0.5f, other) ||
                    other.t > wall.thickness)
                    continue;
                const Vec3 beyond = g.p + n * 3;
                leaks += scene.transmittance(end, {beyond}) != 0;
                leaks += scene.transmittance({beyond}, end) != 0;
                leaks += scene.transmittance_to_infinity(end, n) != 0;
            }
        }
        EXPECT_EQ(leaks, 0) << wall.thickness;
    }
}

// Offsets of rays do not grow with the scene: where a small object lies far from the origin and another one at it, walls of a
// thousandth of the small object's size still block.
TEST(Transmittance, OffsetsDoNotDependOnOtherObjects) {
    etendue::testing::Random random(10);
    constexpr float kThickness = 0.01f;
    const auto wall = [](float at) {
        return shape("rectangle", fmt::format("<scale value=\"3\"/><translate z=\"{}\"/>"
                                              "<translate x=\"8000\" y=\"-8000\" z=\"8000\"/>",
                                              at));
    };
    const Scene scene =
        build(front_camera(1) + kSky + wall(0) + wall(-kThickness) + sphere("0,0,0", "1", ""));
    for (int i = 0; i < 1000; ++i) {
        SurfaceHit hit;
        const Vec3 o = Vec3{8000, -8000, 8004} + Vec3{2, 2, 0} * (2 * random.next_1d() - 1);
        ASSERT_TRUE(scene.intersect({o, {0, 0, -1}, kInf}, 0.5f, hit));
        const SurfaceGeometry& g = hit.geometry;
        EXPECT_EQ(scene.transmittance_to_infinity({g.p, g.ng, g.slack}, {0, 0, -1}), 0);
        SurfaceHit next;
        ASSERT_TRUE(scene.intersect(
            {offset_origin({g.p, g.ng, g.slack}, {0, 0, -1}), {0, 0, -1}, kInf}, 0.5f, next));
        EXPECT_LT(next.t, 1.1f * kThickness);
    }
}

std::string masked(const std::string& opacity) {
    return "<bsdf type=\"mask\">" + opacity + diffuse("0.6,0.5,0.4") + "</bsdf>";
}

std::string half_masked() {
    return masked("<float name=\"opacity\" value=\"0.5\"/>");
}

/// The transmittance along a ray by a walk over all of its surfaces.
float walked_transmittance(const Scene& scene, const Ray& ray) {
    SurfaceHit hit;
    Passage passage;
    return scene.find_certain(ray, hit, passage) ? 0.0f : passage.attenuation.r;
}

TEST(Transmittance, OfMasksIsTheProductOverTheSurfaces) {
    const std::string holes = masked(
        "<texture name=\"opacity\" type=\"checkerboard\"><float name=\"color0\" "
        "value=\"0\"/><float "
        "name=\"color1\" value=\"1\"/><transform name=\"to_uv\"><scale value=\"5\"/></transform>"
        "</texture>");
    const Scene scene = build(
        front_camera(1) + kSky +
        rectangle("<rotate x=\"1\" angle=\"40\"/><translate z=\"0.5\"/>", holes) +
        rectangle("<rotate y=\"1\" angle=\"70\"/><translate x=\"0.3\"/>", half_masked()) +
        shape("disk", "<rotate x=\"1\" y=\"0.5\" angle=\"110\"/><translate y=\"-0.4\"/>",
              half_masked()) +
        shape("sphere", "<scale value=\"0.6\"/><translate x=\"-0.8\"/>", holes) +
        shape("disk", "<scale value=\"0.7\"/><translate x=\"0.7\" z=\"-0.6\"/>") +
        rectangle("<scale value=\"0.5\"/><rotate y=\"1\" angle=\"25\"/><translate y=\"0.9\"/>",
                  diffuse("0.5,0.5,0.5")) +
        instance(shape("disk", "<translate z=\"1\"/>", half_masked()) +
                     rectangle("<scale value=\"0.3\"/>", holes) +
                     shape("sphere", "<scale value=\"0.2\"/>"),
                 "<scale value=\"0.7\"/><translate x=\"-0.2\" z=\"0.9\"/>"));
    etendue::testing::Random random(13);
    int blocked = 0, open = 0, masked = 0, blocked_behind_masks = 0;
    for (int i = 0; i < 500'000; ++i) {
        const Vec3 a = random.in_cube() * 2.0f, b = random.in_cube() * 2.0f;
        for (const bool is_segment : {true, false}) {
            const Ray ray{a, b - a, is_segment ? 1 : kInf};
            const float Tr = is_segment ? scene.transmittance({a}, {b})
                                        : scene.transmittance_to_infinity({a}, ray.d),
                        walked = walked_transmittance(scene, ray);
            (Tr == 0 ? blocked : Tr == 1 ? open : masked) += 1;
            if (Tr == walked) continue;
            // The walk goes on from points that are offset from masks, and may pass an edge of an opaque shape.
            ASSERT_EQ(Tr, 0);
            ++blocked_behind_masks;
        }
    }
    EXPECT_GT(blocked, 100'000);
    EXPECT_GT(open, 100'000);
    EXPECT_GT(masked, 100'000);
    EXPECT_LT(blocked_behind_masks, 20);
}

// Of two surfaces along a ray, the mask comes first or last.
TEST(Transmittance, MasksDoNotHideWhatIsOpaque) {
    for (const char* type : {"disk", "rectangle"})
        for (const float z : {-1.0f, 1.0f}) {
            const std::string veil = shape(type, "", half_masked()),
                              wall = shape(type, fmt::format("<translate z=\"{}\"/>", z));
            const RayEnd a{{0.1f, 0.2f, 5}}, b{{0.1f, 0.2f, -5}};
            EXPECT_EQ(build(front_camera(1) + kSky + veil).transmittance(a, b), 0.5f) << type;
            EXPECT_EQ(build(front_camera(1) + kSky + veil + wall).transmittance(a, b), 0) << type;
        }
}

TEST(Transmittance, OfEditedMaterials) {
    const auto described = [](float opacity) {
        return parse_mitsuba_xml(
            "<scene version=\"3.0.0\">" + front_camera(1) + kSky +
                instance(
                    shape("rectangle", "",
                          masked(fmt::format("<float name=\"opacity\" value=\"{}\"/>", opacity))),
                    "<translate x=\"3\"/>") +
                shape("rectangle", "",
                      masked(fmt::format("<float name=\"opacity\" value=\"{}\"/>", opacity))) +
                "</scene>",
            "test.xml");
    };
    BuildOptions options;
    for (const float opacity : {1.0f, 0.25f, 0.5f, 1.0f}) {
        BuiltScene built = build_scene_again(described(opacity), options);
        for (const float x : {0.1f, 3.1f})
            EXPECT_EQ(built.scene.transmittance({{x, 0.2f, 5}}, {{x, 0.2f, -5}}), 1 - opacity)
                << "at " << x;
        options.earlier = std::move(built.parts);
    }
}

}  // namespace
}  // namespace etendue::test
