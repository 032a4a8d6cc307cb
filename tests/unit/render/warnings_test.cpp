// Warnings about images with known or possible errors.

#include "render/warnings.h"

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

TEST(Warnings, AreNoneWhereAllIsWell) {
    EXPECT_TRUE(warnings({}).empty());
}

TEST(Warnings, SayHowManyContributionsAreMissing) {
    RenderStats stats;
    stats.rejected = 3;
    ASSERT_EQ(warnings(stats).size(), 1u);
    EXPECT_TRUE(warnings(stats)[0].starts_with("3 contributions were not finite"));
    stats.runaways = 4;
    stats.bounds_exceeded = 5;
    ASSERT_EQ(warnings(stats).size(), 3u);
    EXPECT_TRUE(warnings(stats)[1].starts_with(
        "4 pairs of vertices or specular connections were abandoned"));
    EXPECT_TRUE(warnings(stats)[2].starts_with("5 trials met a density above its assumed bound"));
}

/// Adds contributions that the sink rejects, and others whose sum over a pixel overflows.
class Overflowing final : public Integrator {
public:
    void sample(const SampleContext& c, Workspace& work) const override {
        work.z.film_weight = 1;
        Join join{};
        join.technique = {Strategy::Hit, 0, 2};
        join.mis_weight = 1;
        if (c.index % 16 == 0) c.sink.add(join, Rgb(kInf));
        if (c.index % 16 == 1)
            for (int i = 0; i < 2; ++i) c.sink.add(join, Rgb(3e38f));
    }
    TechniqueCounts counts(const Scene&, uint64_t) const override { return {}; }
    uint64_t light_paths(const Scene&) const override { return 0; }
    Estimator estimator() const override { return Estimator::Unbiased; }
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}
};

TEST(Warnings, CountWhatTheFilmRefusesToo) {
    const Scene scene = build(front_camera(8) + room());
    RenderSettings settings;
    settings.spp = 3;
    Renderer renderer(scene, settings, std::make_unique<Overflowing>());
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    EXPECT_EQ(renderer.stats().rejected, 3u * (4 + 4));
    EXPECT_EQ(renderer.film().rejected(), 3u * 4);
}

/// The contributions that importance records measure, not only those that reach the film.
TEST(Warnings, CountWhatRecordsLeaveOut) {
    const Scene scene = build(
        front_camera(8) + room() +
        rectangle("<scale value=\"0.4\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.9\"/>",
                  diffuse("0.5,0.5,0.5") +
                      "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3e38\"/></emitter>"));
    const auto rejected = [&](const char* record_fraction) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(
            std::string("pcbpt:connections=1e-6,record_fraction=") + record_fraction);
        settings.spp = 1;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>{false});
        return renderer.stats().rejected;
    };
    EXPECT_GT(rejected("1"), rejected("0") + 10);
}

}  // namespace
}  // namespace etendue::test
