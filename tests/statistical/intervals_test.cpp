// The intervals of pixel values that the studio states.

#include <cmath>

#include <gtest/gtest.h>

#include "readers/mitsuba_xml.h"
#include "readers/scene_file.h"
#include "render/renderer.h"
#include "scene/builder.h"
#include "session/snapshot.h"

namespace etendue::test {
namespace {

Snapshot rendering(const Scene& scene, uint64_t seed, uint64_t spp) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse("path:max_depth=5");
    settings.sampler = SamplerKind::Independent;
    settings.seed = seed;
    settings.spp = spp;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    Snapshot snapshot;
    fill_snapshot(renderer.film(), snapshot);
    return snapshot;
}

/// Share of the pixels' channels whose interval of 256 passes contains the value of a better image, whose own noise widens
/// the intervals by 3 %.
TEST(LongIntervals, Cover92PercentOfCornell) {
    BuildOptions options;
    options.resolution = {40, 30};
    const Scene scene = build_scene(
        read_scene_file(ETENDUE_SOURCE_DIR "/scenes/cornell.xml", ReadOptions()), options);
    constexpr uint64_t kPasses = 256, kReferencePasses = 16 * kPasses;
    const Snapshot shown = rendering(scene, 1, kPasses),
                   reference = rendering(scene, 2, kReferencePasses);
    double covered = 0;
    for (size_t i = 0; i < shown.mean.size(); ++i)
        for (int c = 0; c < 3; ++c) {
            const double variance = double(shown.variance[i][c]) + double(reference.variance[i][c]);
            const double error = std::abs(double(shown.mean[i][c] - reference.mean[i][c]));
            covered += error <= interval_half_width(variance, kPasses);
        }
    covered /= 3 * double(shown.mean.size());
    EXPECT_GE(covered, 0.92);
    // Far more would mean intervals that are too wide.
    EXPECT_LE(covered, 0.98);
}

}  // namespace
}  // namespace etendue::test
