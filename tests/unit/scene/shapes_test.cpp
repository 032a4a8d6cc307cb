// Shapes in scene files.

#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "random.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

const std::string kIcosahedron =
    "<string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR "/tests/scenes/icosahedron.obj\"/>";

/// (u, v) where the ray meets the scene.
Vec2 uv_at(const Scene& scene, Vec3 from, Vec3 direction) {
    SurfaceHit hit;
    EXPECT_TRUE(scene.intersect(Ray{from, direction}, 0.5f, hit));
    return hit.geometry.uv;
}

// The axis (1, 0, 0) has the tangents (0, 0, -1) and (0, 1, 0) [Duff et al. 2017], as in Mitsuba 3.
TEST(Cylinder, BetweenTwoPointsStartsItsAngleAtTheFirstTangentOfTheAxis) {
    const Scene scene =
        build(sensor("0,0,9", "0,0,0", 4) +
              "<shape type=\"cylinder\"><point name=\"p0\" value=\"1,0,0\"/><point name=\"p1\" "
              "value=\"5,0,0\"/>"
              "<float name=\"radius\" value=\"0.5\"/></shape><emitter type=\"constant\"/>");
    const float a = std::sqrt(0.5f);
    const Vec2 first = uv_at(scene, {2, 5 * a, -5 * a}, {0, -a, a});  // between the tangents
    EXPECT_NEAR(first.x, 0.125f, 1e-5f);
    EXPECT_NEAR(first.y, 0.25f, 1e-5f);
    const Vec2 second = uv_at(scene, {4, 0, 5}, {0, 0, -1});
    EXPECT_NEAR(second.x, 0.5f, 1e-5f);
    EXPECT_NEAR(second.y, 0.75f, 1e-5f);
}

// ---- Mirrored shapes

struct MirroredShape {
    const char *name, *type;
    std::string more;
    bool is_closed = true;  ///< Its front is outside.
};
void PrintTo(const MirroredShape& s, std::ostream* out) {
    *out << s.name;
}

const char* const kMirrors[] = {
    "<scale x=\"-1\"/>",
    "<scale x=\"-1\" y=\"-1\" z=\"-1\"/>",
    "<scale x=\"0.8\" y=\"0.8\" z=\"-0.8\"/><rotate x=\"1\" y=\"2\" angle=\"70\"/>",
};

class MirroredShapes : public ::testing::TestWithParam<MirroredShape> {
protected:
    /// The shape turned and then mirrored, by its own transform or as an instance.
    Scene scene(const std::string& mirror, bool is_instance) const {
        const auto shape = [&](const std::string& type, const std::string& transform,
                               const std::string& inside) {
            return fmt::format(
                "<shape type=\"{}\"><transform name=\"to_world\">{}</transform>{}</shape>", type,
                transform, inside);
        };
        const MirroredShape& s = GetParam();
        // Which needs tangents.
        const std::string inside = s.more + bump_mapped(kGlass, "0.2", "2"),
                          turn = "<rotate x=\"1\" y=\"0.3\" z=\"-0.2\" angle=\"25\"/>";
        return build(front_camera(4) + "<emitter type=\"constant\"/>" +
                     (is_instance
                          ? "<shape type=\"shapegroup\" id=\"g\">" + shape(s.type, turn, inside) +
                                "</shape>" + shape("instance", mirror, "<ref id=\"g\"/>")
                          : shape(s.type, turn + mirror, inside)));
    }
};

/// dn for a step `dp` along the surface.
Vec3d change_of_normal(const SurfaceJet& j, Vec3d dp) {
    const Vec3d n = cross(j.dpdu, j.dpdv);
    return j.dnsdu * (dot(cross(dp, j.dpdv), n) / dot(n, n)) +
           j.dnsdv * (dot(cross(j.dpdu, dp), n) / dot(n, n));
}

void expect_near(Vec3d a, Vec3d b) {
    EXPECT_LT(length(a - b), 2e-4 * (1 + length(a)))
        << fmt::format("({}, {}, {}) and ({}, {}, {})", a.x, a.y, a.z, b.x, b.y, b.z);
}
void expect_near(Vec3 a, Vec3 b) {
    expect_near(Vec3d(a), Vec3d(b));
}

TEST_P(MirroredShapes, AreTheSameAsInstances) {
    for (const char* mirror : kMirrors) {
        SCOPED_TRACE(mirror);
        const Scene direct = scene(mirror, false), instance = scene(mirror, true);
        ASSERT_EQ(instance.statistics().instances, 1u);
        etendue::testing::Random random(5);
        SurfaceHit a, b;
        int hits = 0, agreeing = 0;
        for (int i = 0; i < 1000 && !HasFailure(); ++i) {
            const Vec3 o = random.unit_vector() * 5, d = normalize(random.in_cube() * 0.9f - o);
            const Ray ray{o, d, kInf};
            const bool meets = direct.intersect(ray, 0.5f, a);
            if (meets != instance.intersect(ray, 0.5f, b)) continue;  // at the rim
            if (!meets || std::fabs(a.t - b.t) > 1e-3f || abs_dot(a.geometry.ng, d) < 0.05f)
                continue;
            ++hits;
            if (GetParam().is_closed) {
                EXPECT_LT(dot(b.geometry.ng, d), 0);
            }
            expect_near(a.geometry.ng, b.geometry.ng);
            expect_near(a.geometry.ns, b.geometry.ns);
            expect_near(a.geometry.dpdu, b.geometry.dpdu);
            expect_near(a.geometry.dpdv, b.geometry.dpdv);
            const auto j = direct.jet(a.location, Vec3d(o), Vec3d(d), double(a.t)),
                       k = instance.jet(b.location, Vec3d(o), Vec3d(d), double(b.t));
            ASSERT_TRUE(j && k);
            expect_near(Vec3d(b.geometry.ng), k->ng);
            expect_near(j->ng, k->ng);
            // At edges of texels, the two may see different ones.
            const Vec3d dj = change_of_normal(*j, j->dpdu), dk = change_of_normal(*k, j->dpdu);
            agreeing += length(j->ns - k->ns) < 1e-3 && length(dj - dk) < 1e-3 * (1 + length(dj));
        }
        EXPECT_GT(agreeing, 0.97 * hits);
        EXPECT_GT(hits, 200);
    }
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, MirroredShapes,
    ::testing::Values(MirroredShape{"sphere", "sphere", ""}, MirroredShape{"cube", "cube", ""},
                      MirroredShape{"rectangle", "rectangle", "", false},
                      MirroredShape{"disk", "disk", "", false},
                      MirroredShape{"cylinder", "cylinder", "", false},
                      MirroredShape{"flipped_sphere", "sphere",
                                    "<boolean name=\"flip_normals\" value=\"true\"/>", false},
                      MirroredShape{"smooth_mesh", "obj", kIcosahedron},
                      MirroredShape{"flat_mesh", "obj",
                                    kIcosahedron +
                                        "<boolean name=\"compute_normals\" value=\"false\"/>"}),
    [](const auto& p) { return p.param.name; });

// Of meshes with `face_normals`, the winding of the faces decides, which a transform of the mesh reverses.
TEST(MirroredInstances, KeepTheFrontOfFlatMeshes) {
    for (const char* mirror : {"", kMirrors[0], kMirrors[2]}) {
        const Scene scene =
            build(front_camera(4) +
                  "<emitter type=\"constant\"/><shape type=\"shapegroup\" "
                  "id=\"g\"><shape type=\"obj\">" +
                  kIcosahedron + "<boolean name=\"face_normals\" value=\"true\"/></shape></shape>" +
                  "<shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\">" + mirror +
                  "</transform></shape>");
        etendue::testing::Random random(6);
        SurfaceHit hit;
        for (int i = 0; i < 100; ++i) {
            const Vec3 o = random.unit_vector() * 5, d = normalize(random.in_cube() * 0.3f - o);
            ASSERT_TRUE(scene.intersect({o, d, kInf}, 0.5f, hit));
            EXPECT_LT(dot(hit.geometry.ng, d), 0) << mirror;
        }
    }
}

}  // namespace
}  // namespace etendue::test
