// The error of an image for those who are told of every pass.

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

struct Seen {
    double recent, now;
    bool is_last;
};

std::vector<Seen> errors_of(const char* method, uint64_t spp) {
    const Scene scene = build(mixed_room(lens_camera(16)));
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(method);
    settings.spp = spp;
    Renderer renderer(scene, settings);
    RecentError recent;
    std::vector<Seen> seen;
    renderer.run(
        [&](const Progress& p) {
            const ErrorEstimate e = recent.update(p), now = p.error();
            EXPECT_EQ(e.valid, now.valid) << p.passes;
            if (e.valid) seen.push_back({e.relative_rms, now.relative_rms, p.passes == spp});
        },
        std::atomic<bool>{false});
    return seen;
}

TEST(RecentError, IsThatOfThePassWhereItIsCheap) {
    const std::vector<Seen> seen = errors_of("path", 24);
    ASSERT_GT(seen.size(), 4u);
    for (const Seen& s : seen) EXPECT_EQ(s.recent, s.now);
}

TEST(RecentError, IsUpToASecondOldWhereItIsNot) {
    const std::vector<Seen> seen = errors_of("pssmlt:groups=4,chains=16", 24);
    ASSERT_GT(seen.size(), 4u);
    size_t old = 0;
    for (const Seen& s : seen) old += s.recent != s.now;
    EXPECT_GT(old, 4u) << "computed in every pass";
    EXPECT_TRUE(seen.back().is_last);
    EXPECT_EQ(seen.back().recent, seen.back().now);
}

}  // namespace
}  // namespace etendue::test
