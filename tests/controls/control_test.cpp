// Results of verify() for code with a planted error, and for the same scenes without one. CMakeLists.txt determines
// which error each program contains.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "sample_densities.h"
#include "spec_of.h"
#include "test_scenes.h"
#include "verify/verify.h"

namespace etendue::test {
namespace {

constexpr int kSize = 16;

/// Parts of the report in which an error is found.
enum Part : unsigned {
    Image = 1,
    Lengths = 2,  ///< And classes.
    Techniques = 4,
    Densities = 8,
    Weights = 16,  ///< Of joins, against the explicit sum.
};

struct Planted {
    const char* name;
    std::string xml;
    std::string method;
    unsigned must_find;      ///< Parts that must find it.
    unsigned must_not_find;  ///< Parts that must not find it, since they are not affected.
    uint64_t spp = 64;
};
void PrintTo(const Planted& p, std::ostream* out) {
    *out << p.name;
}

const std::string kMirror = "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>";

/// A lamp as large as the ceiling: hits and next events share its light.
std::string large_lamp() {
    return rectangle("<scale value=\"0.9\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.9\"/>",
                     diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                              "value=\"2,2,2\"/></emitter>");
}

/// A lamp inside glass; for lamps outside, the η² of two refractions cancel.
std::string lamp_in_glass() {
    return sphere("0,0,0", "0.6", kRoughGlass) +
           sphere("0,0,0", "0.3",
                  diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                           "value=\"9,8,7\"/></emitter>");
}

/// The same behind smooth glass, filling most of it.
std::string lamp_in_smooth_glass() {
    return sphere("0.1,-0.2,0.3", "0.6", kGlass) +
           sphere("0.1,-0.2,0.3", "0.45",
                  diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                           "value=\"9,8,7\"/></emitter>");
}

std::string cropped_camera() {
    return "<sensor type=\"perspective\"><float name=\"fov\" value=\"45\"/><transform "
           "name=\"to_world\"><lookat origin=\"0,0,3.4\" target=\"0,0,0\" up=\"0,1,0\"/>"
           "</transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"20\"/><integer "
           "name=\"height\" value=\"20\"/><integer name=\"crop_offset_x\" value=\"2\"/><integer "
           "name=\"crop_offset_y\" value=\"2\"/><integer name=\"crop_width\" "
           "value=\"16\"/><integer "
           "name=\"crop_height\" value=\"16\"/><rfilter type=\"box\"/></film></sensor>";
}

std::string smooth_mesh() {
    return "<shape type=\"obj\"><string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR
           "/tests/scenes/icosahedron.obj\"/><transform name=\"to_world\"><scale value=\"0.5\"/>"
           "<translate x=\"-0.1\" y=\"-0.4\" z=\"0.2\"/></transform>" +
           diffuse("0.8,0.6,0.4") + "</shape>";
}

/// A camera that sees only a sphere, which covers a small part of the neighbourhoods around it.
std::string small_sphere() {
    return sensor("0,0,3.4", "0,0,0", kSize, "1.4") +
           sphere("0,0,0", "0.06", diffuse("0.9,0.9,0.9"));
}

std::vector<Planted> planted() {
    const std::string lit_room = front_camera(kSize) + room() + area_lamp();
    // Records have little information about vertices behind a wall; parameters are those of the paper.
    const std::string by_paper =
        "pcbpt:roulette=0,record_fraction=0.02,direct=stored,uniform=0.1,pmf=contribution";
    const std::string divided_room =
        lit_room + rectangle("<scale value=\"0.8\"/><rotate y=\"1\" angle=\"90\"/>"
                             "<translate x=\"-0.1\" y=\"-0.2\"/>",
                             diffuse("0.7,0.7,0.7"));
    const std::string softly_lit = front_camera(kSize) + room() + large_lamp();
    // Lamps of one power, which a random guide chooses with different probabilities.
    std::string lamps = front_camera(kSize) + room();
    for (const char* at :
         {"-0.6,-0.5,0.2", "0.6,0.1,0.3", "0,0.6,-0.2", "-0.5,0.4,0.4", "0.4,-0.7,0"})
        lamps += sphere(at, "0.15",
                        diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                                 "value=\"3,3,3\"/></emitter>");
    // Lamps that eye paths hit often.
    const std::string large_lamps =
        softly_lit +
        sphere("0,-0.6,0.2", "0.35",
               diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb "
                                        "name=\"radiance\" value=\"2,2,2\"/></emitter>");
    // A caustic of a glass ball on the floor, from a lamp that eye paths hit often enough.
    const std::string by_glass = softly_lit + sphere("0,-0.2,0.1", "0.45", kGlass);
    const std::string lantern = lantern_room(front_camera(kSize));
    // From a point, a lamp is seen in either of two mirrors.
    const std::string with_two_mirrors =
        front_camera(kSize) + room() +
        sphere("0,-0.1,0.2", "0.12",
               diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                        "value=\"9,9,9\"/></emitter>") +
        rectangle("<translate z=\"-0.97\"/>", kMirror) +
        rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-0.97\"/>", kMirror);
    return {
        {"EtaSquared", front_camera(kSize) + room() + lamp_in_glass(), "light",
         Image | Lengths | Techniques, 0},
        {"ShadingNormal", lit_room + smooth_mesh(), "light", Image | Lengths | Techniques, 0},
        {"SplatCount", cropped_camera() + room() + area_lamp(), "light", Image,
         Lengths | Techniques},
        {"Roulette", lit_room, "path:rr_depth=2", Image | Lengths | Techniques, 0},
        {"RouletteOfJoins", lit_room, "bdpt", Image | Lengths, 0},
        {"OwnCount", lit_room, "bdpt:roulette=0", Image | Lengths, Techniques},
        {"CountEverywhere", lit_room, "bdpt:roulette=0", Densities,
         Image | Lengths | Techniques | Weights},
        {"PdfOfEvaluation", softly_lit, "path", Techniques, 0, 256},
        {"PdfOfSampling", softly_lit, "path", Techniques, 0, 256},
        {"PdfEverywhere", softly_lit, "path", Densities, Image | Lengths | Techniques | Weights,
         256},
        {"PmfOfOneRecord", divided_room, by_paper, Image | Lengths, 0, 512},
        {"NoUniformShare", divided_room, by_paper + ",neighbours=1", Image | Lengths, 0, 512},
        {"UniformDenominator", divided_room, by_paper, Image | Lengths, 0, 512},
        {"CapOfTrials", small_sphere() + room() + area_lamp(),
         "upg+bdpt:radius=0.6,bound=cone,roulette=0", Lengths, 0},
        {"DiscProbability", lit_room, "upg+bdpt:radius=0.3,roulette=0", Lengths, 0},
        {"ClampInEstimator", lit_room, "upg+bdpt:radius=0.5,roulette=0", Lengths, 0},
        {"RouletteOfPairs", lit_room, "upg+bdpt:radius=0.3", Lengths, 0},
        {"PredicatesDiffer", lit_room, "upg+bdpt:radius=0.2,roulette=0", Lengths, 0},
        {"GuideNotInReverse", lit_room, "bdpt:roulette=0,guide=random", Lengths, 0},
        {"GuideFieldsSwapped", lit_room, "bdpt:roulette=0,guide=random", Image | Lengths, 0},
        {"GuideJitter", lit_room, "bdpt:roulette=0,guide=random", Lengths, 0},
        {"GuideCosineOfSampling", lit_room, "bdpt:roulette=0,guide=random", Lengths, 0},
        {"OriginNotInHits", front_camera(kSize) + room() + "<emitter type=\"constant\"/>",
         "bdpt:roulette=0,guide=random", Lengths, 0},
        {"EmissionNotInHits", front_camera(kSize) + room() + lamp_in_smooth_glass(),
         "bdpt:roulette=0,guide=random", Lengths, 0},
        {"EmissionPmfNotInNextEvent", lamps, "bdpt:roulette=0,guide=random", Lengths, 0},
        {"SelectionNotInNextEvents", lamps, "bdpt:roulette=0,guide=random", Techniques, 0},
        {"SelectionNotInHits", large_lamps, "path:guide=random", Image, 0, 256},
        {"UniformPointsOfSpheresInHits", lamps, "path", Lengths, 0},
        {"SelectionNotInRatio", lamps, "bdpt:roulette=0,guide=random", Lengths, 0},
        {"CachedGuideLost", lit_room, "vcm:merges=false,roulette=0,guide=random", Lengths, 0},
        {"TrialsWithoutGuide", lit_room, "upg+bdpt:radius=0.3,roulette=0,guide=random", Lengths, 0},
        {"ChainWithoutCurvature", lantern, "path:specular_connections=on", Lengths, 0},
        {"ChainTrialsLeftOut", lantern, "path:specular_connections=on", Lengths, 0},
        {"ChainNotInHits", lantern, "path:specular_connections=on", Lengths, 0},
        {"ChainSolutionsConfused", with_two_mirrors, "path:specular_connections=on", Lengths, 0,
         256},
        {"ChainTrialsOfOtherLampPoint", lantern, "path:specular_connections=on", Lengths, 0},
        {"ChainWithoutFresnel", lantern, "path:specular_connections=on", Lengths, 0},
        {"OnePercentOfOneLength", lit_room, "bdpt:roulette=0", Lengths, 0, 256},
        {"LostConnections", by_glass, "bdpt:roulette=0", Lengths, 0, 256},
        {"LostSplats", by_glass, "bdpt:roulette=0", Image | Lengths, 0, 256},
        {"GeometryBehindDelta", front_camera(kSize) + room() + lamp_in_smooth_glass(),
         "bdpt:roulette=0", Image | Lengths | Weights, 0},
        {"FivePercentOfOneClass", lit_room + sphere("-0.2,-0.5,0", "0.45", kMirror),
         "bdpt:roulette=0", Lengths, 0, 256},
    };
}

/// The parts that found an error, with descriptions.
struct Findings {
    unsigned parts = 0;
    std::string text;

    void add(Part part, bool found, const std::string& what) {
        if (!found) return;
        parts |= part;
        text += what + "\n";
    }
};

Findings findings(const Planted& planted, SamplerKind sampler) {
    const Scene scene = build(planted.xml);
    VerifyOptions options;
    options.longest = 5;
    options.spp = planted.spp;
    options.threads = 1;
    options.sampler = sampler;
    const VerifyReport report = verify(scene, {spec_of(scene, planted.method)}, options);
    const MethodReport& m = report.methods.front();
    Findings found;
    for (const auto* parts : {&m.image, &m.tiles})
        for (const WelchTest& c : *parts)
            found.add(Image, report.deviates(c), fmt::format("image or tile: {:.4f}", c.ratio()));
    for (const LengthReport& l : m.lengths)
        found.add(Lengths, report.deviates(l.comparison),
                  fmt::format("length {}: {:.4f} ± {:.4f}, would be found {:.4f}", l.edges,
                              l.comparison.ratio(), l.comparison.ratio_error(),
                              l.comparison.detectable(report.level)));
    for (const ClassReport& c : m.classes)
        found.add(Lengths, report.deviates(c.comparison),
                  fmt::format("class {}: {:.4f} ± {:.4f}", to_string(c.path_class),
                              c.comparison.ratio(), c.comparison.ratio_error()));
    for (const TechniqueReport& t : m.techniques)
        found.add(Techniques, report.deviates(t.comparison),
                  fmt::format("s = {}, t = {}: {:.4f} ± {:.4f}", t.technique.s, t.technique.t,
                              t.comparison.ratio(), t.comparison.ratio_error()));
    EXPECT_GE(report.tests, 40) << "hardly anything was tested";
    if ((planted.must_find | planted.must_not_find) & (Densities | Weights)) {
        const DensityTests densities = test_sample_densities(scene, planted.method);
        for (const DensityTest& d : densities.tests)
            found.add(Densities, d.deviates,
                      fmt::format("density of s = {}, t = {}: {:.4f}", d.technique.s, d.technique.t,
                                  d.ratio));
        found.add(Weights, densities.has_wrong_weights(),
                  fmt::format("{:.3f} of the weights", densities.wrong_weights));
    }
    return found;
}

class Control : public ::testing::TestWithParam<Planted> {};
class NoError : public ::testing::TestWithParam<std::tuple<Planted, SamplerKind>> {};

TEST_P(Control, IsFound) {
    const Findings found = findings(GetParam(), SamplerKind::Independent);
    EXPECT_EQ(found.parts & GetParam().must_find, GetParam().must_find) << found.text;
    EXPECT_EQ(found.parts & GetParam().must_not_find, 0u) << found.text;
    RecordProperty("found", found.text);
}

TEST_P(NoError, IsFound) {
    const auto& [planted, sampler] = GetParam();
    const Findings found = findings(planted, sampler);
    EXPECT_EQ(found.parts, 0u) << found.text;
}

const auto kSamplers = ::testing::Values(SamplerKind::Sobol, SamplerKind::Independent);
const auto kName = [](const auto& p) {
    return fmt::format("{}_{}", std::get<0>(p.param).name,
                       std::get<1>(p.param) == SamplerKind::Sobol ? "sobol" : "independent");
};
INSTANTIATE_TEST_SUITE_P(Planted, Control, ::testing::ValuesIn(planted()),
                         [](const auto& p) { return std::string(p.param.name); });
INSTANTIATE_TEST_SUITE_P(Clean, NoError,
                         ::testing::Combine(::testing::ValuesIn(planted()), kSamplers), kName);

}  // namespace
}  // namespace etendue::test
