// The same seed gives the same bits, whatever the number of threads.

#include <cctype>
#include <cstring>

#include <gtest/gtest.h>

#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

bool is_guided(const std::string& integrator) {
    return integrator.find("guide") != std::string::npos;
}

/// A tent filter with a radius of two pixels, so that splats of many light paths overlap; several chunks of work. For guides,
/// a room in which they gain.
Scene scene_with_tent(const std::string& integrator) {
    std::string camera = lens_camera(40);
    const std::string box = "<rfilter type=\"box\"/>";
    camera.replace(camera.find(box), box.size(), "<rfilter type=\"tent\"/>");
    if (is_guided(integrator)) return build(lantern_room(camera));
    return build(
        mixed_room(camera) +
        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.5\"/></emitter>");
}

struct Rendering {
    std::vector<Rgb> image, variance;
    uint64_t rays;
};

Rendering render(const Scene& scene, const std::string& integrator, SamplerKind sampler,
                 uint64_t seed, int threads) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.sampler = sampler;
    // Each of both with one of the samplers.
    settings.filter_mode = sampler == SamplerKind::Sobol ? FilterMode::Spread : FilterMode::Sample;
    settings.seed = seed;
    settings.threads = threads;
    // Guides of 3000 walks are fitted again before pass 16: there are eight times as many samples.
    settings.spp = is_guided(integrator) ? 17 : 3;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    EXPECT_EQ(renderer.run([](const Progress&) {}, interrupted), StopReason::Samples);
    return {renderer.film().image(), renderer.film().variance(), renderer.stats().rays()};
}

bool same_bits(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Rgb)) == 0;
}

#ifdef __SANITIZE_THREAD__
// A race shows with either sampler and with few threads, and a rendering takes ten times as long.
constexpr int kThreads[] = {4};
constexpr SamplerKind kSamplers[] = {SamplerKind::Sobol};
constexpr bool kComparesSeeds = false;
#else
constexpr int kThreads[] = {1, 2, 3, 7};
constexpr SamplerKind kSamplers[] = {SamplerKind::Independent, SamplerKind::Sobol};
constexpr bool kComparesSeeds = true;
#endif

class Determinism : public ::testing::TestWithParam<std::tuple<const char*, SamplerKind>> {};

TEST_P(Determinism, OfThreadsAndSeeds) {
    const auto& [integrator, sampler] = GetParam();
    const Scene scene = scene_with_tent(integrator);
    const Rendering one = render(scene, integrator, sampler, 5, 1);
    for (const int threads : kThreads) {
        const Rendering more = render(scene, integrator, sampler, 5, threads);
        EXPECT_TRUE(same_bits(one.image, more.image)) << threads << " threads";
        EXPECT_TRUE(same_bits(one.variance, more.variance)) << threads << " threads";
        EXPECT_EQ(one.rays, more.rays) << threads << " threads";
    }
    if (kComparesSeeds) {
        EXPECT_FALSE(same_bits(one.image, render(scene, integrator, sampler, 6, 1).image));
    }
}

INSTANTIATE_TEST_SUITE_P(
    Integrators, Determinism,
    ::testing::Combine(
        ::testing::Values(
            "path", "light", "bdpt", "bdpt:eorr=true", "pcbpt", "vcm", "vcm:exact=true", "upg+bdpt",
            "path:specular_connections=on", "upg+bdpt:specular_connections=auto",
            "path:guide=on,guide_roulette=false,guide_walks=3000",
            "bdpt:guide=hp02,guide_walks=3000", "upg+bdpt:guide=on,guide_walks=3000", "sppm",
            "ppm:eye_paths=2", "pm:light_paths=2000",
            "pm:light_paths=2000,cache_error=0.3,cache_rays=32", "pssmlt:groups=2,chains=24",
            "mmlt:groups=2,chains=48", "mlt:groups=2,chains=48",
            "mmlt:groups=2,chains=48,guide=on,guide_walks=3000",
            "mlt:groups=2,chains=48,guide=on,guide_walks=3000",
            "pssmlt:groups=2,chains=24,guide=on,guide_walks=3000", "upg+pssmlt:groups=2,chains=24",
            "mps:mutations=2000,precision=0.2", "mps:target=path,mutations=1000,precision=0.2"),
        ::testing::ValuesIn(kSamplers)),
    [](const auto& p) {
        std::string name = std::get<0>(p.param);
        for (char& c : name)
            if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
        return name + (std::get<1>(p.param) == SamplerKind::Sobol ? "_sobol" : "_independent");
    });

}  // namespace
}  // namespace etendue::test
