// Passes that fail or are dropped have no effect on the image, and the rendering can continue.

#include <algorithm>
#include <functional>
#include <optional>
#include <span>

#include <gtest/gtest.h>

#include "film/splat_buffer.h"
#include "lit_room.h"
#include "no_memory.h"
#include "render/renderer.h"
#include "system/section_file.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// Wraps another integrator and calls functions at certain points of its passes.
class Disturbed final : public Integrator {
public:
    struct Hooks {
        std::function<void(uint32_t pass)> trace = [](uint32_t) {}, end_of_trace = [](uint32_t) {};
        std::function<void(uint32_t pass, uint64_t index)> sample = [](uint32_t, uint64_t) {};
        /// Before each group of paths that prepare() or trace() makes for itself.
        std::function<void(uint32_t pass)> other_paths = [](uint32_t) {};
        /// The block of memory that learn() does not get before pass 4, from 1; 0: it gets all.
        long block_of_learn = 0;
    };
    Disturbed(const std::string& name, Hooks& hooks)
        : inner_(make_integrator(IntegratorSpec::parse(name))), hooks_(hooks) {}

    void learn(const LearnContext& context) override {
        EXPECT_EQ(context.index, context.film.passes());
        learned_.push_back(context.index);
        const NoMemoryForBlock missing(context.index == 4 ? hooks_.block_of_learn : 0);
        inner_->learn(context);
    }
    bool is_learning() const override { return inner_->is_learning(); }
    void save(LearnedState& to) const override { inner_->save(to); }
    void load(LearnedState& from) override { inner_->load(from); }
    void prepare(const PassContext& pass) override { inner_->prepare(watched(pass)); }
    void trace(const PassContext& pass) override {
        pass_ = pass.index;
        hooks_.trace(pass_);
        inner_->trace(watched(pass));
        hooks_.end_of_trace(pass_);
    }
    std::unique_ptr<PassSums> make_sums() const override { return inner_->make_sums(); }
    void collect(std::span<const std::unique_ptr<PassSums>> sums) override {
        inner_->collect(sums);
    }
    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        inner_->trace_eye_paths(c, z, stats);
    }
    void sample(const SampleContext& context, Workspace& work) const override {
        hooks_.sample(pass_, context.index);
        inner_->sample(context, work);
    }
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return inner_->counts(scene, light_paths);
    }
    uint64_t light_paths(const Scene& scene) const override { return inner_->light_paths(scene); }
    Estimator estimator() const override { return inner_->estimator(); }
    int error_groups() const override { return inner_->error_groups(); }
    double splat_error_factor() const override { return inner_->splat_error_factor(); }
    const std::vector<uint32_t>& learned() const { return learned_; }

private:
    PassContext watched(const PassContext& pass) const {
        PassContext watched = pass;
        watched.for_each_other_path = [&](uint64_t count, const PassContext::Task& task) {
            hooks_.other_paths(pass.index);
            pass.for_each_other_path(count, task);
        };
        return watched;
    }

    std::unique_ptr<Integrator> inner_;
    Hooks& hooks_;
    uint32_t pass_ = 0;
    std::vector<uint32_t> learned_;
};

class DropPass : public ::testing::TestWithParam<const char*> {
protected:
    explicit DropPass(Scene in = build(mixed_room(lens_camera(24)))) : scene(std::move(in)) {
        settings.sampler = SamplerKind::Sobol;
        settings.technique_depth = 4;
        settings.threads = 2;
        settings.spp = 5;
    }
    Renderer renderer() {
        return {scene, settings, std::make_unique<Disturbed>(GetParam(), hooks)};
    }
    StopReason run(Renderer& r) {
        return r.run([](const Progress&) {}, interrupted, drop);
    }
    /// Of `passes` passes that nothing disturbs.
    void expect_as_undisturbed(const Renderer& r, uint64_t passes) {
        Disturbed::Hooks none;
        RenderSettings s = settings;
        s.spp = passes;
        Renderer other(scene, s, std::make_unique<Disturbed>(GetParam(), none));
        other.run([](const Progress&) {}, std::atomic<bool>{false});
        EXPECT_EQ(r.film().passes(), passes);
        expect_same_bits(r.film().image(), other.film().image());
        expect_same_bits(r.film().variance(), other.film().variance());
        EXPECT_EQ(r.film().mean_luminance().mean, other.film().mean_luminance().mean);
        EXPECT_EQ(r.stats().rays(), other.stats().rays());
        EXPECT_EQ(r.stats().eye_paths, other.stats().eye_paths);
        EXPECT_EQ(r.stats().light_paths, other.stats().light_paths);
        EXPECT_EQ(r.stats().joins_skipped, other.stats().joins_skipped);
        if (!r.techniques()) return;
        const auto layers = r.techniques()->images(), others = other.techniques()->images();
        ASSERT_EQ(layers.size(), others.size());
        for (size_t i = 0; i < layers.size(); ++i) {
            EXPECT_EQ(layers[i].technique, others[i].technique);
            expect_same_bits(layers[i].weighted, others[i].weighted);
            expect_same_bits(layers[i].unweighted, others[i].unweighted);
        }
    }
    static void expect_same_bits(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
        ASSERT_EQ(a.size(), b.size());
        for (size_t i = 0; i < a.size(); ++i)
            for (int c = 0; c < 3; ++c) ASSERT_EQ(a[i][c], b[i][c]) << i;
    }

    Scene scene;
    RenderSettings settings;
    Disturbed::Hooks hooks;
    std::atomic<bool> interrupted{false}, drop{false};
};

TEST_P(DropPass, WhereASampleThrows) {
    hooks.sample = [](uint32_t pass, uint64_t index) {
        if (pass == 3 && index == 300) throw std::runtime_error("a bad sample");
    };
    Renderer r = renderer();
    EXPECT_THROW(run(r), std::runtime_error);
    expect_as_undisturbed(r, 3);
    EXPECT_THROW(run(r), std::runtime_error);
    expect_as_undisturbed(r, 3);
    hooks.sample = [](uint32_t, uint64_t) {};
    EXPECT_EQ(run(r), StopReason::Samples);
    expect_as_undisturbed(r, 5);
}

TEST_P(DropPass, SaysWhatHasFailed) {
    hooks.sample = [](uint32_t pass, uint64_t) {
        if (pass == 3) throw std::runtime_error("a bad sample");
    };
    Renderer r = renderer();
    EXPECT_THROW(run(r), std::runtime_error);
    EXPECT_EQ(r.place_of_failure(), "pass 4 failed");
    hooks.sample = [](uint32_t, uint64_t) {};
    const auto fail = [](const Progress&) { throw std::bad_alloc(); };
    EXPECT_THROW(r.run(fail, interrupted), std::bad_alloc);
    EXPECT_EQ(r.place_of_failure(), "after pass 4");
    EXPECT_EQ(r.film().passes(), 4u);
}

TEST_P(DropPass, WhereAPassCannotBegin) {
    for (auto* moment : {&hooks.trace, &hooks.end_of_trace}) {
        *moment = [](uint32_t pass) {
            if (pass == 2) throw std::bad_alloc();
        };
        Renderer r = renderer();
        EXPECT_THROW(run(r), std::bad_alloc);
        expect_as_undisturbed(r, 2);
        *moment = [](uint32_t) {};
        EXPECT_EQ(run(r), StopReason::Samples);
        expect_as_undisturbed(r, 5);
    }
}

TEST_P(DropPass, WhereTheFirstPassFails) {
    hooks.sample = [](uint32_t, uint64_t index) {
        if (index == 500) throw std::runtime_error("a bad sample");
    };
    Renderer r = renderer();
    EXPECT_THROW(run(r), std::runtime_error);
    EXPECT_EQ(r.film().passes(), 0u);
    EXPECT_EQ(r.stats().rays(), 0u);
    EXPECT_EQ(r.seconds(), 0);
    EXPECT_TRUE(r.techniques()->images().empty());
    hooks.sample = [](uint32_t, uint64_t) {};
    run(r);
    expect_as_undisturbed(r, 5);
}

TEST_P(DropPass, WhereTheCallerAsksForIt) {
    std::atomic<uint64_t> samples_after{0};
    hooks.sample = [&](uint32_t pass, uint64_t) {
        if (drop.load()) ++samples_after;
        if (pass == 3) interrupted = drop = true;
    };
    Renderer r = renderer();
    EXPECT_EQ(run(r), StopReason::Interrupted);
    // Chunks in flight end, no others begin.
    EXPECT_LE(samples_after, 2 * 256u);
    expect_as_undisturbed(r, 3);
    const double seconds = r.seconds();
    hooks.sample = [](uint32_t, uint64_t) {};
    EXPECT_EQ(run(r), StopReason::Interrupted) << "still";
    EXPECT_EQ(r.seconds(), seconds);
    interrupted = drop = false;
    EXPECT_EQ(run(r), StopReason::Samples);
    expect_as_undisturbed(r, 5);
}

TEST_P(DropPass, LearnsOnceBeforeAPassThatIsTracedAgain) {
    hooks.sample = [](uint32_t pass, uint64_t index) {
        if (pass == 4 && index == 300) throw std::runtime_error("a bad sample");
    };
    auto integrator = std::make_unique<Disturbed>(GetParam(), hooks);
    const Disturbed& disturbed = *integrator;
    Renderer r(scene, settings, std::move(integrator));
    EXPECT_THROW(run(r), std::runtime_error);
    EXPECT_THROW(run(r), std::runtime_error);
    EXPECT_EQ(disturbed.learned(), (std::vector<uint32_t>{0, 1, 4}));
    hooks.sample = [](uint32_t, uint64_t) {};
    run(r);
    EXPECT_EQ(disturbed.learned(), (std::vector<uint32_t>{0, 1, 4}));
}

TEST_P(DropPass, WhereThereIsNoMemoryToLearn) {
    int failures = 0;
    for (bool is_reached = true; is_reached; failures += is_reached) {
        SCOPED_TRACE(failures);
        ASSERT_LT(failures, 100);
        hooks.block_of_learn = failures + 1;
        Renderer r = renderer();
        try {
            run(r);
            is_reached = false;
        } catch (const std::bad_alloc&) {
            EXPECT_EQ(r.film().passes(), 4u);
        }
        hooks.block_of_learn = 0;
        EXPECT_EQ(run(r), StopReason::Samples);
        expect_as_undisturbed(r, 5);
    }
    // The variance of the film, its relative values, what is learned of places, and more.
    if (std::string(GetParam()) == "upg+bdpt") {
        EXPECT_GE(failures, 3);
    }
}

TEST_P(DropPass, WhereItsStateIsSavedAfterwards) {
    settings.spp = 6;
    // Integrators learn before pass 4.
    for (const uint32_t dropped : {0u, 3u, 4u}) {
        SCOPED_TRACE(dropped);
        hooks.sample = [=](uint32_t pass, uint64_t index) {
            if (pass == dropped && index == 300) throw std::runtime_error("a bad sample");
        };
        Renderer first = renderer();
        EXPECT_THROW(run(first), std::runtime_error);
        SectionWriter saved;
        first.save(saved);
        hooks.sample = [](uint32_t, uint64_t) {};
        Renderer second = renderer();
        SectionReader reader(saved.take(), "state");
        second.load(reader);
        EXPECT_EQ(second.film().passes(), dropped);
        run(second);
        expect_as_undisturbed(second, 6);
    }
}

/// Photons that are kept where their pass is dropped do not count in its statistics, on which later passes depend.
TEST(DropPassOfPhotons, ChangesNothing) {
    const Scene scene = build(mixed_room(front_camera(24)));
    RenderSettings settings;
    settings.threads = 2;
    settings.spp = 6;
    Disturbed::Hooks hooks;
    const auto image = [&](bool is_dropped) {
        Renderer r(scene, settings,
                   std::make_unique<Disturbed>("pm:eorr=true,light_paths=2000", hooks));
        const auto run = [&] { r.run([](const Progress&) {}, std::atomic<bool>{false}); };
        if (is_dropped) {
            hooks.sample = [](uint32_t, uint64_t index) {
                if (index == 300) throw std::runtime_error("a bad sample");
            };
            EXPECT_THROW(run(), std::runtime_error);
            hooks.sample = [](uint32_t, uint64_t) {};
        }
        run();
        return r.film().image();
    };
    const std::vector<Rgb> whole = image(false), dropped = image(true);
    for (size_t i = 0; i < whole.size(); ++i)
        for (int c = 0; c < 3; ++c) ASSERT_EQ(dropped[i][c], whole[i][c]) << i;
}

/// Guides, whose training takes seconds. Nothing of it may be left where it is dropped.
class DropTraining : public DropPass {
protected:
    DropTraining() : DropPass(build(lantern_room(lens_camera(36)))) {
        settings.technique_depth = 0;
        settings.spp = 65;  // A refit of 8000 walks comes before pass 64.
    }
    /// The number of groups of training walks in a whole rendering, and the pass of each.
    std::vector<uint32_t> groups() {
        std::vector<uint32_t> passes;
        hooks.other_paths = [&](uint32_t pass) { passes.push_back(pass); };
        Renderer r = renderer();
        run(r);
        hooks.other_paths = [](uint32_t) {};
        return passes;
    }
};

TEST_P(DropTraining, AnywhereChangesNothing) {
    const std::vector<uint32_t> passes = groups();
    ASSERT_GE(passes.size(), 5u);
    ASSERT_EQ(passes.back(), 64u) << "the refit";
    Disturbed::Hooks none;
    Renderer whole(scene, settings, std::make_unique<Disturbed>(GetParam(), none));
    run(whole);
    for (const size_t at : {size_t(1), size_t(3), passes.size() - 1}) {
        SCOPED_TRACE(at);
        size_t group = 0;
        hooks.other_paths = [&](uint32_t) {
            if (group++ == at) throw std::runtime_error("dropped");
        };
        Renderer r = renderer();
        EXPECT_THROW(run(r), std::runtime_error);
        EXPECT_EQ(run(r), StopReason::Samples);
        expect_same_bits(r.film().image(), whole.film().image());
    }
}

/// Chains train their guide in the first pass, before their pilot run and the pool of the first group.
class DropTrainingOfChains : public DropTraining {
protected:
    DropTrainingOfChains() { settings.spp = 6; }
};

TEST_P(DropTrainingOfChains, AnywhereChangesNothing) {
    const std::vector<uint32_t> passes = groups();
    const auto first = size_t(std::count(passes.begin(), passes.end(), 0u));
    ASSERT_GE(first, 7u);
    ASSERT_GT(passes.size(), first) << "the pool of the second group";
    Disturbed::Hooks none;
    Renderer whole(scene, settings, std::make_unique<Disturbed>(GetParam(), none));
    run(whole);
    for (const size_t at : {size_t(1), size_t(3), size_t(4), first - 1, first}) {
        SCOPED_TRACE(at);
        size_t group = 0;
        hooks.other_paths = [&](uint32_t) {
            if (group++ == at) throw std::runtime_error("dropped");
        };
        Renderer r = renderer();
        EXPECT_THROW(run(r), std::runtime_error);
        EXPECT_EQ(run(r), StopReason::Samples);
        expect_same_bits(r.film().image(), whole.film().image());
    }
}

INSTANTIATE_TEST_SUITE_P(Guided, DropTrainingOfChains,
                         ::testing::Values("pssmlt:groups=2,chains=16,guide=on,guide_walks=4000",
                                           "mmlt:groups=2,chains=48,guide=on,guide_walks=4000",
                                           "mlt:groups=2,chains=48,guide=on,guide_walks=4000"),
                         [](const auto& p) {
                             const std::string name = p.param;
                             return name.substr(0, name.find(':'));
                         });

/// An object at a distance makes what counts as a usual radiance small, so that every splat needs memory of its own.
class DropSplats : public DropPass {
protected:
    DropSplats()
        : DropPass(
              lit_room({.origin = {4000, 0, 0}, .has_object_at_origin = true, .has_sky = false})) {
        settings.technique_depth = 0;  // Its images would be the first to fail.
    }
};

TEST_P(DropSplats, WhereThereIsNoMemoryForOne) {
    std::optional<NoMemoryFor> missing;
    hooks.trace = [&](uint32_t pass) {
        if (pass == 0) missing.emplace(SplatBuffer::kBytesOfLargeSplats);
    };
    Renderer r = renderer();
    EXPECT_THROW(run(r), std::bad_alloc);
    missing.reset();
    hooks.trace = [](uint32_t) {};
    EXPECT_EQ(r.film().passes(), 0u);
    EXPECT_EQ(run(r), StopReason::Samples);
    expect_as_undisturbed(r, 5);
}

INSTANTIATE_TEST_SUITE_P(Integrators, DropSplats,
                         ::testing::Values("light", "pssmlt:groups=2,chains=24",
                                           "mlt:groups=2,chains=48"),
                         [](const auto& p) {
                             const std::string name = p.param;
                             return name.substr(0, name.find(':'));
                         });

INSTANTIATE_TEST_SUITE_P(Guided, DropTraining,
                         ::testing::Values("path:guide=on,guide_walks=8000",
                                           "bdpt:guide=on,guide_walks=8000"),
                         [](const auto& p) {
                             const std::string name = p.param;
                             return name.substr(0, name.find(':'));
                         });

INSTANTIATE_TEST_SUITE_P(Integrators, DropPass,
                         ::testing::Values("path", "light", "bdpt", "vcm:radius=0.3", "upg+bdpt",
                                           "sppm", "pcbpt", "pssmlt:groups=2,chains=16",
                                           "mmlt:groups=2,chains=48", "mlt:groups=2,chains=48",
                                           "upg+pssmlt:groups=2,chains=16"),
                         [](const auto& p) {
                             std::string name = p.param;
                             name = name.substr(0, name.find(':'));
                             std::replace(name.begin(), name.end(), '+', '_');
                             return name;
                         });

}  // namespace
}  // namespace etendue::test
