// The shading normal of maps in double against that of materials, and its derivatives against differences.

#include <gtest/gtest.h>

#include "pathspace/vertex.h"
#include "random.h"
#include "test_scenes.h"

namespace etendue {
namespace {

struct MappedCase {
    std::string name, xml;
};

std::vector<MappedCase> mapped_cases() {
    using namespace test;
    const std::string turned = "<rotate x=\"1\" y=\"0.3\" z=\"-0.2\" angle=\"25\"/>";
    const auto shape = [&](const std::string& type, const std::string& transform,
                           const std::string& more) {
        return "<shape type=\"" + type + "\"><transform name=\"to_world\">" + transform + turned +
               "</transform>" + more + "</shape>";
    };
    const std::string flipped = "<boolean name=\"flip_normals\" value=\"true\"/>",
                      file = "<string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR
                             "/tests/scenes/icosahedron.obj\"/>",
                      mirror = "<bsdf type=\"conductor\"/>",
                      squeezed = "<scale x=\"1.2\" y=\"-0.8\" z=\"1\"/>";
    const auto in = [](const std::string& what, const std::string& inside) {
        return "<bsdf type=\"" + what + "\">" + inside + "</bsdf>";
    };
    // Normals that vary over the whole surface, some of them so much that they would face away.
    const std::string smooth_normals =
        "<bsdf type=\"normalmap\"><texture type=\"bilerp\" name=\"normalmap\"><rgb name=\"v00\" "
        "value=\"0.2,0.9,0.6\"/><rgb name=\"v10\" value=\"0.9,0.4,0.55\"/><rgb name=\"v01\" "
        "value=\"0.4,0.3,0.9\"/><rgb name=\"v11\" value=\"0.7,0.6,1\"/></texture>" +
        mirror + "</bsdf>";
    const std::string mixed_heights =
        "<bsdf type=\"bumpmap\"><texture type=\"scale\" name=\"displacement\"><texture "
        "type=\"mix\" name=\"value\"><texture type=\"bilerp\" name=\"value0\"/><float "
        "name=\"value1\" value=\"0.3\"/>" +
        map_image("weight", "heights.pgm", "2") +
        "</texture><rgb name=\"scale\" value=\"0.3,0.2,0.1\"/></texture>" + mirror + "</bsdf>";
    const std::vector<std::pair<std::string, std::string>> materials = {
        {"normals", normal_mapped(kGlass, "2", "3")},
        {"smooth_normals", smooth_normals},
        {"bumps", bump_mapped(kGlass, "0.2", "3")},
        {"mixed_heights", mixed_heights},
        {"windy_bumps",
         "<bsdf type=\"bumpmap\"><texture type=\"windy\" name=\"displacement\"/><float "
         "name=\"scale\" value=\"2\"/>" +
             mirror + "</bsdf>"},
        {"bumps_of_both_sides", in("twosided", bump_mapped(mirror, "0.3", "2"))},
        {"normals_of_both_sides", in("twosided", normal_mapped(mirror, "1.5", "2"))},
        {"normals_outside", normal_mapped(in("twosided", mirror), "1.5", "2")},
        {"bumped_normals", normal_mapped(bump_mapped(kGlass, "0.2", "2"), "1.5", "3")},
    };
    std::vector<MappedCase> list;
    for (const auto& [name, bsdf] : materials) {
        list.push_back({name + "_on_sphere", shape("sphere", "", bsdf)});
        list.push_back({name + "_on_rectangle", shape("rectangle", squeezed, bsdf)});
        list.push_back(
            {name + "_on_faces",
             shape("obj", "", file + "<boolean name=\"face_normals\" value=\"true\"/>" + bsdf)});
        list.push_back({name + "_on_smooth_mesh", shape("obj", squeezed, file + bsdf)});
        list.push_back({name + "_on_flipped_cylinder", shape("cylinder", "", flipped + bsdf)});
        list.push_back({name + "_on_disk", shape("disk", squeezed, bsdf)});
        list.push_back({name + "_on_instance", "<shape type=\"shapegroup\" id=\"g\">" +
                                                   shape("sphere", "", flipped + bsdf) +
                                                   "</shape>" +
                                                   shape("instance", squeezed, "<ref id=\"g\"/>")});
    }
    return list;
}

class MappedNormals : public ::testing::TestWithParam<MappedCase> {};

TEST_P(MappedNormals, AreThoseOfMaterialsWithTheirDerivatives) {
    constexpr double kStep = 1e-7;
    // Slopes of noise are differences of its values, which are rounded to float.
    const double rounding = GetParam().name.starts_with("windy") ? 1e-3 : 1e-4;
    const Scene scene =
        test::build(test::front_camera(4) + GetParam().xml + "<emitter type=\"constant\"/>");
    testing::Random random(3);
    ComponentArena arena;
    Vertex v;
    SurfaceHit hit;
    int hits = 0, compared = 0, tilted = 0, agreeing = 0;
    for (int i = 0; i < 2000; ++i) {
        const Vec3 o = random.unit_vector() * 4, d = normalize(random.in_cube() * 0.8f - o);
        if (!scene.intersect({o, d, kInf}, 0.5f, hit)) continue;
        if (abs_dot(hit.geometry.ng, d) < 0.1f) continue;
        ++hits;
        ASSERT_TRUE(may_be_in_chain(*hit.shape));
        v.set_surface(*hit.shape, hit.location, hit.geometry, -d, arena);
        const Vec3d start(o), along(d);
        const auto jet = [&](Vec3d from) {
            return scene.jet(hit.location, from, along, double(hit.t));
        };
        const auto at = jet(start);
        ASSERT_TRUE(at);
        EXPECT_NEAR(length(at->ns), 1, 1e-12);
        const double miss = length(at->ns - Vec3d(v.bsdf.shading_normal()));
        agreeing += miss < rounding;
        tilted += dot(at->ns, Vec3d(hit.geometry.ns)) < 0.999;

        const Vec3d n = cross(at->dpdu, at->dpdv);
        for (const Vec3d axis : {at->dpdu, at->dpdv}) {
            const Vec3d step = axis * (kStep / length(axis));
            const auto normal = [&](double share) { return jet(start + step * share); };
            const auto plus = normal(1), minus = normal(-1);
            ASSERT_TRUE(plus && minus);
            // Where the surface is not smooth, as at edges of texels, differences do not have one limit.
            const Vec3d forth = plus->ns - at->ns, back = at->ns - minus->ns,
                        dp = plus->p - minus->p;
            const double rate = 1 + length(forth) / kStep, error = 1e-4 * rate * rate;
            if (length(forth - back) > 0.1 * error * kStep) continue;
            const double by_u = dot(cross(dp, at->dpdv), n) / dot(n, n),
                         by_v = dot(cross(at->dpdu, dp), n) / dot(n, n);
            const Vec3d expected = at->dnsdu * by_u + at->dnsdv * by_v;
            EXPECT_LT(length(forth + back - expected) / kStep, error);
            ++compared;
        }
    }
    EXPECT_GT(hits, 400);
    EXPECT_GT(tilted, 0.3 * hits);
    // The others are at edges of texels.
    EXPECT_GT(agreeing, 0.99 * hits);
    EXPECT_GT(compared, 1.8 * hits);
}

INSTANTIATE_TEST_SUITE_P(Cases, MappedNormals, ::testing::ValuesIn(mapped_cases()),
                         [](const auto& p) { return p.param.name; });

TEST(ChainsWithMaps, HaveTexturesThatAreKnownInDouble) {
    const auto may_have_chains = [](const std::string& bsdf) {
        return test::build(test::front_camera(4) + test::sphere("0,0,0", "1", bsdf) +
                           "<emitter type=\"constant\"/>")
            .may_have_chains();
    };
    const auto bumped = [](const std::string& texture) {
        return "<bsdf type=\"bumpmap\">" + texture + test::kGlass + "</bsdf>";
    };
    EXPECT_TRUE(may_have_chains(test::normal_mapped(test::kGlass)));
    EXPECT_TRUE(may_have_chains(test::bump_mapped(test::kGlass, "0.1")));
    EXPECT_TRUE(may_have_chains(bumped("<texture type=\"bilerp\"/>")));
    EXPECT_FALSE(may_have_chains(bumped("<texture type=\"checkerboard\"/>")));
    EXPECT_FALSE(may_have_chains(
        bumped("<texture type=\"scale\"><texture type=\"checkerboard\"/></texture>")));
    EXPECT_FALSE(may_have_chains("<bsdf type=\"mixturebsdf\"><string name=\"weights\" "
                                 "value=\"0.5,0.5\"/>" +
                                 test::kGlass + test::normal_mapped(test::kGlass) + "</bsdf>"));
}

}  // namespace
}  // namespace etendue
