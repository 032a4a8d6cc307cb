// An observer does not change the image, although integrators restore whole light paths for it instead of the last
// vertices only.

#include <cstring>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

class SilentObserver final : public ContributionObserver {
public:
    void observe(const Join&, Rgb, float, const FilmTarget&, const Workspace&) override { ++seen; }
    std::atomic<uint64_t> seen{0};
};

std::vector<Rgb> render(const Scene& scene, const IntegratorSpec& spec, SamplerKind sampler,
                        ContributionObserver* observer) {
    RenderSettings settings;
    settings.integrator = spec;
    settings.sampler = sampler;
    settings.threads = 2;
    settings.spp = 4;
    settings.seed = 3;
    settings.observer = observer;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    return renderer.film().image();
}

class Observer : public ::testing::TestWithParam<SamplerKind> {};

TEST_P(Observer, GetsTheBitsOfARenderingWithoutOne) {
    // Glass, a mirror, a finite lens and light from infinity.
    const Scene scene = build(
        mixed_room(lens_camera(24)) +
        sphere("0.5,0.1,-0.4", "0.3", "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>") +
        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.5\"/></emitter>");
    std::vector<IntegratorSpec> specs;
    for (const IntegratorEntry& e : integrator_registry()) specs.push_back({e.info.name, {}});
    for (const char* text : {"bdpt:roulette=0", "bdpt:eorr=true", "vcm:exact=true",
                             "pcbpt:direct=both", "pcbpt:cache=false", "upg+bdpt:roulette=0"})
        specs.push_back(IntegratorSpec::parse(text));
    int compared = 0;
    for (const IntegratorSpec& spec : specs) {
        if (!make_integrator(spec)->keeps_paths()) continue;
        SilentObserver observer;
        const std::vector<Rgb> with = render(scene, spec, GetParam(), &observer),
                               without = render(scene, spec, GetParam(), nullptr);
        EXPECT_GT(observer.seen, 0u) << spec.to_string();
        ASSERT_EQ(with.size(), without.size());
        EXPECT_EQ(std::memcmp(with.data(), without.data(), with.size() * sizeof(Rgb)), 0)
            << spec.to_string();
        ++compared;
    }
    EXPECT_GE(compared, 12);
}

INSTANTIATE_TEST_SUITE_P(Samplers, Observer,
                         ::testing::Values(SamplerKind::Sobol, SamplerKind::Independent),
                         [](const auto& p) {
                             return p.param == SamplerKind::Sobol ? "sobol" : "independent";
                         });

}  // namespace
}  // namespace etendue::test
