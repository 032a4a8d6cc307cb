// Images do not depend on the units of radiance and length: scaling all emitters by a power of two scales every pixel
// exactly, and scaling the scene by one changes nothing.

#include <gtest/gtest.h>

#include "lit_room.h"
#include "render/renderer.h"

namespace etendue::test {
namespace {

struct Rendering {
    std::vector<Rgb> image, variance;
    ErrorEstimate error;
    RenderStats stats;
};

Rendering render(Units units, const std::string& integrator) {
    const Scene scene = lit_room(units);
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.sampler = SamplerKind::Sobol;
    settings.spp = 16;  // enough for an estimate of the error, from groups of chains too
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    return {renderer.film().image(), renderer.film().variance(), renderer.film().error(),
            renderer.stats()};
}

/// Of a against b · factor.
size_t different(const std::vector<Rgb>& a, const std::vector<Rgb>& b, float factor) {
    size_t count = 0;
    for (size_t i = 0; i < a.size(); ++i)
        for (int c = 0; c < 3; ++c) count += a[i][c] != b[i][c] * factor;
    return count;
}

class ScaledScene : public ::testing::TestWithParam<std::string> {};

/// Powers of two: of radiance, and of lengths about four orders of magnitude.
TEST_P(ScaledScene, HasTheSameBits) {
    const Rendering one = render({}, GetParam());
    ASSERT_TRUE(one.error.valid);
    for (const Units units : {Units{.radiance = 0x1p40f},
                              {.radiance = 0x1p-40f},
                              {.length = 0x1p13f},
                              {.length = 0x1p-13f}}) {
        SCOPED_TRACE(::testing::PrintToString(units));
        const float factor = units.radiance;
        const Rendering other = render(units, GetParam());
        EXPECT_EQ(different(other.image, one.image, factor), 0u) << "of " << 3 * one.image.size();
        EXPECT_EQ(different(other.variance, one.variance, factor * factor), 0u);
        EXPECT_EQ(other.error.relative_rms, one.error.relative_rms);
        // Values near the smallest floats may become 0, which saves a ray.
        EXPECT_NEAR(double(other.stats.rays()), double(one.stats.rays()),
                    1e-4 * double(one.stats.rays()));
        EXPECT_EQ(other.stats.joins_skipped, one.stats.joins_skipped);
    }
}

INSTANTIATE_TEST_SUITE_P(Integrators, ScaledScene, ::testing::ValuesIn(all_integrators()),
                         name_of_integrator);

}  // namespace
}  // namespace etendue::test
