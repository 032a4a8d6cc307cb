// Paths outside of samples have random numbers that no sample of a pass has.

#include <mutex>
#include <set>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "sampler/pilot_seed.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr uint64_t kLightPaths = 400;  // more than pixels

/// Collects a random number of each path.
class NumberCollector final : public Integrator {
public:
    void trace(const PassContext& pass) override {
        pass.for_each_light_path(
            [&](const SampleContext& c, Workspace&) { add(c.sampler, samples); });
        pass.for_each_other_path(2 * kLightPaths, [&](uint64_t i, Sampler& sampler, Workspace&) {
            sampler.start(pass.index, i);
            add(sampler, others);
        });
    }
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}
    void sample(const SampleContext& c, Workspace&) const override { add(c.sampler, samples); }
    TechniqueCounts counts(const Scene&, uint64_t) const override { return {}; }
    uint64_t light_paths(const Scene&) const override { return kLightPaths; }
    Estimator estimator() const override { return Estimator::Unbiased; }

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

TEST(PilotNumbers, DifferByUse) {
    std::set<uint64_t> seeds;
    int count = 0;
    for (const uint64_t seed : {0, 1, 2})
        for (const PilotUse use : {PilotUse::OtherPaths, PilotUse::LightPathCount, PilotUse::Pairs,
                                   PilotUse::Guide, PilotUse::Chains, PilotUse::PhotonScale,
                                   PilotUse::PhotonPilot, PilotUse::PhotonPaths}) {
            seeds.insert(pilot_seed(seed, use));
            ++count;
            EXPECT_NE(pilot_seed(seed, use), seed);
        }
    EXPECT_EQ(int(seeds.size()), count);
}

}  // namespace
}  // namespace etendue::test
