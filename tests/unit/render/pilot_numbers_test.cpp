// Paths outside of samples have random numbers that no sample of a pass has.

#include <atomic>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "integrator/light_path_options.h"
#include "math/statistics.h"
#include "pathspace/walk.h"
#include "render/renderer.h"
#include "sampler/pilot_seed.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr uint64_t kLightPaths = 400;  // more than pixels

/// Makes no image.
class Collector : public Integrator {
public:
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}
    void sample(const SampleContext&, Workspace&) const override {}
    TechniqueCounts counts(const Scene&, uint64_t) const override { return {}; }
    Estimator estimator() const override { return Estimator::Unbiased; }
};

/// Collects a random number of each path.
class NumberCollector final : public Collector {
public:
    void trace(const PassContext& pass) override {
        pass.for_each_light_path(
            [&](const SampleContext& c, Workspace&) { add(c.sampler, samples); });
        pass.for_each_other_path(2 * kLightPaths, [&](uint64_t i, Sampler& sampler, Workspace&) {
            sampler.start(pass.index, i);
            add(sampler, others);
        });
    }
    void sample(const SampleContext& c, Workspace&) const override { add(c.sampler, samples); }
    uint64_t light_paths(const Scene&) const override { return kLightPaths; }

    mutable std::set<double> samples, others;

private:
    void add(Sampler sampler, std::set<double>& to) const {
        sampler.seek(Stream::Light, 0);
        const std::lock_guard lock(mutex_);
        to.insert(sampler.next_1d_fine());
    }
    mutable std::mutex mutex_;
};

TEST(PilotNumbers, AreNotThoseOfSamples) {
    const Scene scene = build(front_camera(4) + room());
    for (const SamplerKind kind : {SamplerKind::Independent, SamplerKind::Sobol}) {
        RenderSettings settings;
        settings.sampler = kind;
        settings.spp = 1;
        auto integrator = std::make_unique<NumberCollector>();
        const NumberCollector& numbers = *integrator;
        Renderer renderer(scene, settings, std::move(integrator));
        renderer.run([](const Progress&) {}, std::atomic<bool>(false));
        EXPECT_EQ(numbers.samples.size(), kLightPaths);  // those of pixels among them
        EXPECT_EQ(numbers.others.size(), 2 * kLightPaths);
        for (const double u : numbers.others) EXPECT_FALSE(numbers.samples.contains(u));
    }
}

/// Notes the numbers of vertices of the first light paths of a pass.
class LengthCollector final : public Collector {
public:
    explicit LengthCollector(const DepthOptions& depth) : depth_(depth) {}
    void trace(const PassContext& pass) override {
        pass.for_each_light_path([&](const SampleContext& c, Workspace& work) {
            const TechniqueCounts none;
            const WalkContext walk{c.scene, none, work.stats, {depth_.max_depth, depth_.rr_depth}};
            trace_light_path(walk, c.sampler, work.y);
            lengths[c.index] = work.y.size();
        });
    }
    uint64_t light_paths(const Scene&) const override { return lengths.size(); }

    std::vector<int> lengths = std::vector<int>(4096);

private:
    DepthOptions depth_;
};

/// The number of light paths, which may depend on how long they are, is not chosen by those of a pass.
TEST(PilotNumbers, OfTheLightPathCountAreNotThoseOfAPass) {
    const DepthOptions depth{10, 2};
    const Scene scene = build(front_camera(4) + room() + area_lamp());
    RenderSettings settings;
    settings.sampler = SamplerKind::Independent;
    settings.seed = 0;
    settings.spp = 1;
    auto integrator = std::make_unique<LengthCollector>(depth);
    const LengthCollector& collected = *integrator;
    Renderer renderer(scene, settings, std::move(integrator));
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    Moments of_pass;
    for (const int length : collected.lengths) of_pass.add(length);
    const Moments of_pilot = light_path_length(scene, depth);
    ASSERT_EQ(of_pilot.count(), of_pass.count());
    EXPECT_NEAR(of_pilot.mean(), of_pass.mean(), 0.1);
    EXPECT_NE(of_pilot.mean(), of_pass.mean());
    EXPECT_NE(of_pilot.variance(), of_pass.variance());
}

TEST(PilotNumbers, DifferByUse) {
    std::set<uint64_t> seeds;
    int count = 0;
    for (const uint64_t seed : {0, 1, 2})
        for (const PilotUse use :
             {PilotUse::OtherPaths, PilotUse::LightPathCount, PilotUse::Pairs, PilotUse::Guide,
              PilotUse::Chains, PilotUse::PhotonScale, PilotUse::PhotonPilot, PilotUse::PhotonPaths,
              PilotUse::SeenExtent, PilotUse::Choice}) {
            seeds.insert(pilot_seed(seed, use));
            ++count;
            EXPECT_NE(pilot_seed(seed, use), seed);
        }
    EXPECT_EQ(int(seeds.size()), count);
}

}  // namespace
}  // namespace etendue::test
