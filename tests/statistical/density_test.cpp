// The samples of each technique have the density that its MIS weights assume.

#include "sample_densities.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

struct Densities {
    const char* name;
    std::string xml;
    const char* method;
    size_t least_tests;
};
void PrintTo(const Densities& d, std::ostream* out) {
    *out << d.name;
}

/// A lamp behind smooth glass: all paths except those of hits have a refraction, with different distances on both sides
/// of the glass.
std::string lamp_in_glass() {
    return front_camera(16) + room() + sphere("0.1,-0.2,0.3", "0.6", kGlass) +
           sphere("0.1,-0.2,0.3", "0.45",
                  diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                           "value=\"9,8,7\"/></emitter>");
}

class SampleDensities : public ::testing::TestWithParam<Densities> {};

TEST_P(SampleDensities, AreThoseOfTheWeights) {
    const Scene scene = build(GetParam().xml);
    const DensityTests found = test_sample_densities(scene, GetParam().method);
    EXPECT_FALSE(found.has_wrong_weights())
        << "weights are not those of the counts: " << found.wrong_weights;
    EXPECT_GE(found.tests.size(), GetParam().least_tests);
    for (const DensityTest& d : found.tests) {
        EXPECT_FALSE(d.deviates) << "s = " << d.technique.s << ", t = " << d.technique.t
                                 << ": ratio " << d.ratio;
        EXPECT_LT(d.detectable, 0.25)
            << "s = " << d.technique.s << ", t = " << d.technique.t << ": too few samples";
    }
}

const std::string kLitRoom = front_camera(16) + room() + area_lamp();
INSTANTIATE_TEST_SUITE_P(Methods, SampleDensities,
                         ::testing::Values(Densities{"path", kLitRoom, "path", 14},
                                           Densities{"light", kLitRoom, "light", 14},
                                           Densities{"bdpt", kLitRoom, "bdpt:roulette=0", 14},
                                           Densities{"lamp_in_glass", lamp_in_glass(),
                                                     "bdpt:roulette=0,specular_connections=off",
                                                     10}),
                         [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace etendue::test
