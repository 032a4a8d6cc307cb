// The integrators agree with path tracing, tile by tile. Path tracing can sample all paths of these scenes: no delta
// emitter is visible directly or through mirrors and glass.

#include <algorithm>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render/learned_guide.h"
#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr int kAgreementSize = 16;
/// Without specular connections, which some methods below have.
const std::string kPath = "path:specular_connections=off";

struct AgreementCase {
    const char* name;
    std::string xml;
    bool light;  ///< Whether light paths can make all of it.
    uint64_t passes = 192;
    double resolution = 0.07;
};
void PrintTo(const AgreementCase& c, std::ostream* out) {
    *out << c.name;
}

std::string point_light(const std::string& position, const std::string& intensity) {
    return "<emitter type=\"point\"><point name=\"position\" value=\"" + position +
           "\"/><rgb name=\"intensity\" value=\"" + intensity + "\"/></emitter>";
}
std::string environment(const std::string& radiance) {
    return "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"" + radiance +
           "\"/></emitter>";
}
std::string ortho_camera() {
    return sensor("0,0,3.4", "0,0,0", kAgreementSize, "", "", "orthographic");
}

const std::string kSpot = "<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"50\"/><rgb "
                          "name=\"intensity\" value=\"9,8,7\"/>"
                          "<transform name=\"to_world\"><lookat origin=\"0.5,0.3,2.6\" "
                          "target=\"-0.1,-0.5,0\" up=\"0,1,0\"/></transform></emitter>";
const std::string kSun =
    "<emitter type=\"directional\"><vector name=\"direction\" value=\"0.3,-0.4,-1\"/><rgb "
    "name=\"irradiance\" value=\"4,3,2\"/></emitter>";
const std::string kBlend =
    "<bsdf type=\"twosided\"><bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.4\"/><bsdf "
    "type=\"diffuse\"/>"
    "<bsdf type=\"roughconductor\"><float name=\"alpha\" value=\"0.15\"/></bsdf></bsdf></bsdf>";
/// Smooth and delta events at one surface.
const std::string kGloss = "<bsdf type=\"twosided\"><bsdf type=\"blendbsdf\"><float "
                           "name=\"weight\" value=\"0.4\"/><bsdf type=\"diffuse\"/>"
                           "<bsdf type=\"conductor\"/></bsdf></bsdf>";
const std::string kMasked = "<bsdf type=\"mask\"><texture name=\"opacity\" "
                            "type=\"checkerboard\"><float name=\"color0\" value=\"0.2\"/>"
                            "<float name=\"color1\" value=\"0.9\"/></texture>" +
                            diffuse("0.6,0.5,0.4") + "</bsdf>";
const std::string kBumped =
    "<bsdf type=\"twosided\"><bsdf type=\"bumpmap\"><texture type=\"checkerboard\"><transform "
    "name=\"to_uv\"><scale value=\"7\"/></transform></texture>"
    "<float name=\"scale\" value=\"0.4\"/><bsdf type=\"diffuse\"/></bsdf></bsdf>";
const std::string kRoughPlastic =
    "<bsdf type=\"roughplastic\"><float name=\"alpha\" value=\"0.2\"/></bsdf>";
const std::string kOpenPbr =
    "<bsdf type=\"openpbr\"><rgb name=\"base_color\" value=\"0.8,0.5,0.3\"/><float "
    "name=\"specular_roughness\" value=\"0.5\"/><float name=\"base_metalness\" value=\"0.3\"/>"
    "<float name=\"transmission_weight\" value=\"0.5\"/><float name=\"coat_weight\" "
    "value=\"0.6\"/><float name=\"coat_roughness\" value=\"0.4\"/><float name=\"fuzz_weight\" "
    "value=\"0.5\"/></bsdf>";
const std::string kTinted =
    "<bsdf type=\"roughdielectric\"><float name=\"alpha\" value=\"0.3\"/></bsdf><medium "
    "type=\"homogeneous\" name=\"interior\">"
    "<rgb name=\"sigma_t\" value=\"0.5,1.5,4\"/><float name=\"albedo\" value=\"0\"/></medium>";

/// Vertex normals that differ much from face normals: an icosahedron shaded like a sphere.
std::string smooth_mesh(const std::string& bsdf) {
    return "<shape type=\"obj\"><string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR
           "/tests/scenes/icosahedron.obj\"/>"
           "<transform name=\"to_world\"><scale value=\"0.5\"/><translate x=\"-0.1\" y=\"-0.4\" "
           "z=\"0.2\"/></transform>" +
           bsdf + "</shape>";
}

std::vector<AgreementCase> cases() {
    const std::string two =
        sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) + sphere("0.4,-0.65,0.3", "0.3", kRoughGlass);
    const std::string front = front_camera(kAgreementSize);
    return {
        {"room", front + room() + area_lamp(), true},
        {"rough", front + room() + area_lamp() + two, true},
        {"mixed_room", mixed_room(front), false, 192, 0.08},
        {"thinlens", lens_camera(kAgreementSize) + room() + area_lamp() + two, true, 480},
        {"orthographic", ortho_camera() + room() + area_lamp() + two, true},
        {"point", front + room() + two + point_light("0.4,0.8,3.6", "30,20,10"), false},
        {"point_on_diffuse", front + room() + point_light("0.4,0.8,3.6", "30,20,10"), true},
        {"spot", front + room() + two + kSpot, true},
        // Light tracing samples rough glass in front of an environment by rare bright splats, too few for a t-test.
        {"constant", front + room() + two + environment("3,2,1"), false},
        {"constant_on_diffuse", front + room() + environment("3,2,1"), true},
        {"directional", front + room() + two + kSun, true},
        {"several",
         front + room() + area_lamp() + two + environment("0.3,0.4,0.5") +
             point_light("0.4,0.8,3.6", "9,6,3") + kSun,
         true, 240},
        {"mask",
         front + room() + area_lamp() +
             rectangle("<scale value=\"0.6\"/><rotate x=\"1\" angle=\"-60\"/>", kMasked),
         true},
        // A pierced lamp: where a ray passes, nothing is emitted.
        {"masked_lamp",
         front + room() +
             rectangle("<scale value=\"0.3\"/><rotate x=\"1\" angle=\"90\"/><translate "
                       "y=\"0.5\"/>",
                       kMasked + "<emitter type=\"area\"><rgb name=\"radiance\" value=\"9,8,7\"/>"
                                 "<boolean name=\"two_sided\" value=\"true\"/></emitter>"),
         true},
        {"blend", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", kBlend), true},
        {"gloss", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", kGloss), false, 384},
        {"bump",
         front + room() + area_lamp() +
             rectangle(
                 "<scale value=\"0.8\"/><rotate x=\"1\" angle=\"-70\"/><translate y=\"-0.6\"/>",
                 kBumped),
         true},
        {"medium", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", kTinted), true},
        {"roughplastic", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", kRoughPlastic),
         true},
        {"openpbr", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", kOpenPbr), true},
        {"smooth_mesh", front + room() + area_lamp() + smooth_mesh(diffuse("0.8,0.6,0.4")), true},
        {"smooth_glass", front + room() + area_lamp() + smooth_mesh(kRoughGlass), true},
        {"lantern", lantern_room(front), false, 768},
    };
}

/// Without lamps that the camera sees. Their noise, which all methods share, is far above that of all other light here.
Tiles indirect_tiles(const Scene& scene, const std::string& integrator, uint64_t passes,
                     uint64_t seed) {
    return render_tiles(scene, integrator, {.passes = passes, .seed = seed, .shortest = 2});
}

/// Paths of one edge.
TEST(DirectlySeenLight, IsTheSameForAllMethods) {
    const Scene scene =
        build(sensor("0,-0.8,0.5", "0,1,0", kAgreementSize) + room() + area_lamp() +
              environment("0.3,0.4,0.5") + point_light("0.1,0.5,0.1", "9,6,3") + kSun);
    const Tiles path = render_tiles(scene, "path:max_depth=1", {1024, 4, 1});
    for (const char* method :
         {"light", "bdpt", "vcm", "upg+bdpt", "pcbpt", "pssmlt", "mmlt", "mlt"})
        expect_same_image(render_tiles(scene, std::string(method) + ":max_depth=1", {2048, 4, 2}),
                          path, 0.03, method);
}

class Agreement : public ::testing::TestWithParam<AgreementCase> {
protected:
    /// `path` has `path_factor` times as many samples: it finds the lamp through rough glass by few bright samples,
    /// whose mean would not be normally distributed otherwise.
    void expect_agreement(uint64_t factor, uint64_t path_factor) {
        const AgreementCase& c = GetParam();
        const Scene scene = build(c.xml);
        const double resolution = c.resolution / std::sqrt(double(factor));
        const Tiles path = indirect_tiles(scene, kPath, path_factor * factor * c.passes, 1);
        expect_same_image(indirect_tiles(scene, "bdpt", factor * c.passes, 2), path, resolution,
                          "bdpt against path");
        expect_same_image(indirect_tiles(scene, "upg+bdpt:radius=0.12", factor * c.passes, 4), path,
                          resolution, "upg+bdpt against path");
        expect_same_image(
            indirect_tiles(scene, "pcbpt:connections=2,record_fraction=0.02", factor * c.passes, 5),
            path, 1.5 * resolution, "pcbpt against path");
        if (c.light)
            expect_same_image(indirect_tiles(scene, "light", 2 * factor * c.passes, 3), path,
                              2 * resolution, "light against path");
    }
};
class LongAgreement : public Agreement {};

/// Methods with chains. Each pass has its own group, so that passes are independent, and start-up bias were at its largest.
class ChainAgreement : public Agreement {};

TEST_P(ChainAgreement, WithPathTracing) {
    const AgreementCase& c = GetParam();
    const Scene scene = build(c.xml);
    const Tiles path = indirect_tiles(scene, kPath, 2 * c.passes, 1);
    // The variance of mlt's passes has long tails.
    for (const auto& [method, more] :
         {std::pair("pssmlt:chains=16,groups=", uint64_t{1}),
          {"mmlt:chains=48,groups=", 1},
          {"mlt:chains=48,groups=", 4},
          {"upg+pssmlt:radius=0.12,light_paths=800,chains=16,groups=", 1}}) {
        const uint64_t passes = std::min<uint64_t>(1024, more * c.passes);
        expect_same_image(indirect_tiles(scene, fmt::format("{}{}", method, passes), passes, 6),
                          path, 1.5 * c.resolution, std::string(method) + " against path");
    }
}

/// A guide that has learned, and one that knows nothing and is sure of it.
class GuidedChainAgreement : public Agreement {};

TEST_P(GuidedChainAgreement, WithPathTracing) {
    const AgreementCase& c = GetParam();
    const Scene scene = build(c.xml);
    const Tiles path = indirect_tiles(scene, kPath, 2 * c.passes, 1);
    for (const char* guide : {"guide=on,guide_walks=4000", "guide=random"})
        for (const char* method : {"pssmlt:chains=16", "mmlt:chains=48", "mlt:chains=48"}) {
            const uint64_t passes = std::min<uint64_t>(512, c.passes);
            const std::string chains = fmt::format("{},groups={},{}", method, passes, guide);
            expect_same_image(indirect_tiles(scene, chains, passes, 6), path, 2 * c.resolution,
                              chains + " against path");
        }
}

/// Every method with a guide, of `passes` times `factor` passes: a guide that has learned, and one that knows nothing
/// and is sure of it.
class GuidedAgreement : public Agreement {
protected:
    void expect_guided_agreement(uint64_t factor) {
        const AgreementCase& c = GetParam();
        const Scene scene = build(c.xml);
        const double resolution = c.resolution / std::sqrt(double(factor));
        const Tiles path = render_tiles(scene, kPath, {2 * factor * c.passes, 4, 1});
        for (const std::string guide :
             {"guide=on", "guide=hp02", "guide=random", "guide=on,guide_roulette=false",
              "guide=random,guide_roulette=false"}) {
            for (const std::string method :
                 {"path:", "bdpt:", "upg+bdpt:radius=0.12,", "pcbpt:record_fraction=0.02,"}) {
                // Alone, eye paths that a bad guide misleads would need too many samples.
                if (method == "path:" && guide.starts_with("guide=random")) continue;
                // Footprints of few photons are noisy. Roulette by the throughput ends walks early that a bad guide has
                // misled.
                const uint64_t more =
                    guide == "guide=hp02" || guide == "guide=random,guide_roulette=false" ? 2 : 1;
                const TileOptions plan{more * factor * c.passes, 4, 2};
                expect_same_image(render_tiles(scene, method + guide, plan), path,
                                  (method == "path:" ? 3 : 2) * resolution, method + guide);
            }
            if (c.light)
                expect_same_image(render_tiles(scene, "light:" + guide, {factor * c.passes, 4, 2}),
                                  path, 4 * resolution, "light:" + guide);
        }
    }
};
class LongGuidedAgreement : public GuidedAgreement {};

/// All parameters of gathers give unbiased methods.
TEST(GatherChoices, AgreeWithPathTracing) {
    const Scene scene = build(mixed_room(front_camera(kAgreementSize)));
    const Tiles path = indirect_tiles(scene, kPath, 400, 1);
    uint64_t seed = 5;
    for (const char* choice : {"bound=box", "bound=cone", "drop=eye", "drop=light", "drop=both"})
        expect_same_image(
            indirect_tiles(scene, fmt::format("upg+bdpt:radius=0.12,{}", choice), 192, seed++),
            path, 0.08, choice);
}

/// Eight lamps near the walls, each of which lights its surroundings.
std::string room_of_lamps() {
    std::string scene = front_camera(kAgreementSize) + room();
    for (const char* x : {"-0.8", "0.8"})
        for (const char* y : {"-0.8", "0.8"})
            for (const char* z : {"-0.8", "0.5"})
                scene += sphere(fmt::format("{},{},{}", x, y, z), "0.08",
                                "<emitter type=\"area\"><rgb name=\"radiance\" "
                                "value=\"12,10,8\"/></emitter>");
    return scene;
}

TEST(LearnedLights, AgreeWithTheSelectionByPower) {
    const Scene scene = build(room_of_lamps());
    EXPECT_FALSE(
        LearnedGuide(scene, IntegratorSpec::parse("path"), 1, 2).guide().lights.is_empty());
    const auto tiles = [&](const std::string& method, uint64_t passes, uint64_t seed) {
        return render_tiles(scene, method, {.passes = passes, .seed = seed, .shortest = 2});
    };
    const Tiles path = tiles("path:lights=power", 512, 1);
    uint64_t seed = 2;
    for (const char* method :
         {"path", "bdpt", "upg+bdpt:radius=0.12", "pcbpt:record_fraction=0.02", "vcm:merges=false"})
        expect_same_image(tiles(method, 192, seed++), path, 0.05, method);
    expect_same_image(tiles("mmlt:chains=48,groups=256", 256, seed), path, 0.08, "mmlt");
}

/// Specular connections, on scenes whose lamps hits find often enough.
class SpecularAgreement : public ::testing::TestWithParam<AgreementCase> {};

TEST_P(SpecularAgreement, WithPathTracing) {
    const AgreementCase& c = GetParam();
    const Scene scene = build(c.xml);
    const Tiles path =
        render_tiles(scene, kPath + ",rr_depth=20,max_depth=8", {8 * c.passes, 4, 1});
    for (const std::string method : {"path", "bdpt", "pcbpt", "upg+bdpt"})
        expect_same_image(render_tiles(scene,
                                       method + ":rr_depth=20,max_depth=8,specular_connections=on",
                                       {3 * c.passes, 4, 2}),
                          path, c.resolution, method);
}

/// A lamp as large as the ceiling.
std::string ceiling_lamp() {
    return rectangle("<scale value=\"0.9\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.98\"/>",
                     diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                              "value=\"2,2,2\"/></emitter>");
}

std::vector<AgreementCase> specular_cases() {
    const std::string front = front_camera(kAgreementSize), lit = room() + ceiling_lamp();
    const std::string mirror = "<bsdf type=\"conductor\"/>";
    const auto bumped = [](const std::string& bsdf) {
        return "<bsdf type=\"bumpmap\"><texture type=\"checkerboard\"><transform "
               "name=\"to_uv\"><scale value=\"3\"/></transform></texture><float name=\"scale\" "
               "value=\"0.2\"/>" +
               bsdf + "</bsdf>";
    };
    const std::string absorbing =
        "<medium type=\"homogeneous\" name=\"interior\"><rgb name=\"sigma_t\" value=\"0.5,1.5,4\"/>"
        "<float name=\"albedo\" value=\"0\"/></medium>";
    const std::string masked_pane = rectangle(
        "<scale value=\"0.7\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.4\"/>", kMasked);
    return {
        {"lantern", lantern_room(front), false},
        {"glass_ball", front + lit + sphere("0,-0.2,0.1", "0.45", kGlass), false},
        // Caustics seen in a mirror, which no connection makes.
        {"ball_and_mirror",
         front + lit + sphere("0.3,-0.4,0.2", "0.4", kGlass) +
             rectangle("<translate z=\"-0.98\"/>", "<bsdf type=\"twosided\">" + mirror + "</bsdf>"),
         false},
        {"thinlens_and_mirror",
         lens_camera(kAgreementSize) + lit + sphere("0.3,-0.4,0.2", "0.4", kGlass) +
             rectangle("<translate z=\"-0.98\"/>", "<bsdf type=\"twosided\">" + mirror + "</bsdf>"),
         false},
        {"tinted", front + lit + sphere("0,-0.2,0.1", "0.45", kGlass + absorbing), false},
        {"mask", front + lit + masked_pane + sphere("0,-0.4,0.1", "0.45", kGlass), false},
        {"bumped_glass", front + lit + sphere("0,-0.3,0.1", "0.45", bumped(kGlass)), false},
        {"normal_mapped_glass",
         front + lit + sphere("0,-0.3,0.1", "0.45", normal_mapped(kGlass, "0.4", "2")), false},
        // Water in which the floor is seen.
        {"bump_mapped_water",
         front + lit +
             rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-0.5\"/>",
                       bump_mapped(kGlass, "0.1", "2")),
         false},
        {"plastic", front + lit + sphere("0,-0.3,0.1", "0.6", kPlastic), false},
        {"smooth_mesh", front + lit + smooth_mesh(kGlass), false},
        {"environment",
         front + room() + sphere("0,-0.2,0.1", "0.45", kGlass) + environment("1,1,1"), false},
    };
}

TEST_P(Agreement, WithPathTracing) {
    expect_agreement(1, 2);
}
TEST_P(LongAgreement, WithPathTracing) {
    expect_agreement(16, 16);
}

/// Otherwise, GuidedAgreement would compare unguided walks.
TEST(LearnedGuide, IsUsedInTheLantern) {
    const Scene scene = build(lantern_room(front_camera(kAgreementSize)));
    const LearnedGuide learned(scene, IntegratorSpec::parse("bdpt:guide=on"), 1, 2);
    EXPECT_TRUE(learned.guide().guides_surfaces());
    EXPECT_FALSE(learned.guide().lights.is_empty());
    EXPECT_GT(LearnedGuide::mean_shares(learned.shares())[0], 0.2);
}

TEST(LearnedGuide, IsNotUsedAtSurfacesOfARoom) {
    const Scene scene = build(front_camera(kAgreementSize) + room() + area_lamp());
    const LearnedGuide learned(scene, IntegratorSpec::parse("bdpt:guide=on"), 1, 2);
    EXPECT_FALSE(learned.guide().guides_surfaces());
}

TEST_P(GuidedAgreement, WithPathTracing) {
    expect_guided_agreement(1);
}
TEST_P(LongGuidedAgreement, WithPathTracing) {
    expect_guided_agreement(16);
}

/// Of the cases, those with these names.
std::vector<AgreementCase> cases(std::initializer_list<std::string_view> names) {
    std::vector<AgreementCase> chosen;
    for (const AgreementCase& c : cases())
        if (std::find(names.begin(), names.end(), c.name) != names.end()) chosen.push_back(c);
    return chosen;
}

const auto kName = [](const ::testing::TestParamInfo<AgreementCase>& p) {
    return std::string(p.param.name);
};
INSTANTIATE_TEST_SUITE_P(Quick, Agreement, ::testing::ValuesIn(cases()), kName);
INSTANTIATE_TEST_SUITE_P(Quick, SpecularAgreement, ::testing::ValuesIn(specular_cases()), kName);
INSTANTIATE_TEST_SUITE_P(Quick, ChainAgreement,
                         ::testing::ValuesIn(cases({"thinlens", "mask", "medium"})), kName);
INSTANTIATE_TEST_SUITE_P(Quick, GuidedChainAgreement, ::testing::ValuesIn(cases({"lantern"})),
                         kName);
INSTANTIATE_TEST_SUITE_P(Long, GuidedChainAgreement, ::testing::ValuesIn(cases({"thinlens"})),
                         kName);
INSTANTIATE_TEST_SUITE_P(Long, ChainAgreement, ::testing::ValuesIn(cases()), kName);
INSTANTIATE_TEST_SUITE_P(Long, LongAgreement, ::testing::ValuesIn(cases()), kName);
INSTANTIATE_TEST_SUITE_P(Quick, GuidedAgreement,
                         ::testing::ValuesIn(cases({"constant_on_diffuse", "lantern"})), kName);
INSTANTIATE_TEST_SUITE_P(Long, LongGuidedAgreement, ::testing::ValuesIn(cases()), kName);

}  // namespace
}  // namespace etendue::test
