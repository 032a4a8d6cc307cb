// Each technique makes as many samples, and where, as its weights claim.

#include "sample_densities.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

class Densities : public ::testing::TestWithParam<const char*> {};

TEST_P(Densities, AreThoseOfTheSamples) {
    const Scene scene = build(front_camera(16) + room() + area_lamp());
    const std::vector<DensityTest> tests = test_sample_densities(scene, GetParam());
    EXPECT_GE(tests.size(), 14u);
    for (const DensityTest& d : tests) {
        EXPECT_FALSE(d.deviates) << "s = " << d.technique.s << ", t = " << d.technique.t
                                 << ": ratio " << d.ratio;
        EXPECT_LT(d.detectable, 0.25)
            << "s = " << d.technique.s << ", t = " << d.technique.t << ": too few samples";
    }
}

INSTANTIATE_TEST_SUITE_P(Methods, Densities, ::testing::Values("path", "light", "bdpt:roulette=0"),
                         [](const auto& p) {
                             return std::string(p.param).substr(0, std::string(p.param).find(':'));
                         });

}  // namespace
}  // namespace etendue::test
