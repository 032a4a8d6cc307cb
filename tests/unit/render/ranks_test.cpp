// Several processes render the same bits as one. They make the passes of a generation at the same time, so that these cannot
// depend on each other.

#include <fstream>
#include <mutex>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render/render_report.h"
#include "render/renderer.h"
#include "resumable.h"
#include "system/section_file.h"
#include "test_scenes.h"
#include "thread_ranks.h"

namespace etendue::test {
namespace {

/// Everything that a rendering leaves, apart from times.
struct Outcome {
    std::vector<Rgb> image, variance;
    ErrorEstimate error;
    nlohmann::json report;
    StopReason stopped_by = StopReason::Samples;
    std::string failure;
    std::vector<uint64_t> told;  ///< Number of passes at each call of `progress`.
    std::string saved;

    void expect_equal(const Outcome& o) const {
        // Not EXPECT_EQ, which would print thousands of numbers.
        EXPECT_TRUE(image == o.image);
        EXPECT_TRUE(variance == o.variance);
        EXPECT_EQ(error.valid, o.error.valid);
        EXPECT_EQ(error.relative_rms, o.error.relative_rms);
        EXPECT_EQ(error.low, o.error.low);
        EXPECT_EQ(report, o.report);
        EXPECT_EQ(stopped_by, o.stopped_by);
        EXPECT_EQ(told, o.told);
    }
};

struct Rendering {
    const Scene& scene;
    RenderSettings settings;
    std::string from{};  ///< State from which it goes on, if it is not empty.
    /// Makes the integrator of a process; empty: that of the settings.
    std::function<std::unique_ptr<Integrator>(int rank)> make{};
    std::function<void(const Progress&, int rank, std::atomic<bool>& interrupted)> progress{};

    /// The outcome in each process.
    std::vector<Outcome> run(int ranks) const {
        std::vector<Outcome> all{size_t(ranks)};
        ThreadRanks::run(ranks, [&](const Ranks& r) { all[size_t(r.index())] = run(r); });
        return all;
    }
    Outcome run(const Ranks& ranks) const {
        RenderSettings own = settings;
        own.ranks = &ranks;
        Renderer r(scene, own, make ? make(ranks.index()) : make_integrator(settings.integrator));
        Outcome out;
        if (!from.empty()) {
            SectionReader reader(from, "state");
            r.load(reader);
        }
        std::atomic<bool> interrupted{false};
        try {
            out.stopped_by = r.run(
                [&](const Progress& p) {
                    out.told.push_back(p.passes);
                    if (progress) progress(p, ranks.index(), interrupted);
                },
                interrupted);
        } catch (const std::exception& e) {
            out.failure = e.what();
        }
        r.gather();
        out.image = r.film().image();
        out.variance = r.film().variance();
        out.error = r.error();
        out.report = statistics(r.film(), r.stats(), r.seconds(), out.error);
        for (const char* time :
             {"seconds", "samples_per_second", "rays_per_second", "phase_seconds"})
            out.report.erase(time);
        SectionWriter to;
        r.save(to);
        out.saved = to.take();
        return out;
    }
};

RenderSettings settings_of(const std::string& method) {
    RenderSettings s;
    s.integrator = IntegratorSpec::parse(method);
    s.sampler = SamplerKind::Sobol;
    s.threads = 1;
    return s;
}

class SharedRendering : public ::testing::TestWithParam<const char*> {};

TEST_P(SharedRendering, HasTheSameBits) {
    // Methods whose passes depend on those before them.
    static const std::set<std::string> kChained{"pssmlt", "mmlt", "mlt", "upg+pssmlt"};
    const uint32_t refit = refit_pass(GetParam());
    const std::string camera = with_filter(lens_camera(image_size(GetParam())), "gaussian");
    const Scene scene = build(refit > 0 ? lantern_room(camera) : mixed_room(camera));
    RenderSettings settings = settings_of(GetParam());
    settings.spp = refit > 0 ? refit + 2 : 18;
    if (kChained.contains(settings.integrator.name)) {
        ThreadRanks::run(2, [&](const Ranks& ranks) {
            RenderSettings own = settings;
            own.ranks = &ranks;
            EXPECT_THROW(Renderer(scene, own), std::runtime_error);
        });
        return;
    }
    const Outcome alone = Rendering{scene, settings}.run(kAlone);
    for (const int ranks : {2, 3}) {
        SCOPED_TRACE(ranks);
        for (const Outcome& o : Rendering{scene, settings}.run(ranks)) {
            EXPECT_EQ(o.failure, "");
            o.expect_equal(alone);
        }
    }
    // In the middle of a generation, and before the next one.
    for (const uint64_t stop : {6u, 4u}) {
        SCOPED_TRACE(stop);
        RenderSettings first = settings;
        first.spp = stop;
        Outcome o = Rendering{scene, settings, Rendering{scene, first}.run(3)[0].saved}.run(2)[0];
        EXPECT_EQ(o.told.size(), *settings.spp - stop);
        o.told = alone.told;
        o.expect_equal(alone);
    }
}

INSTANTIATE_TEST_SUITE_P(Methods, SharedRendering, ::testing::ValuesIn(resumable_methods()),
                         name_of_method);

/// Counts the bytes of pixels that a process gives to or gets from the others.
class CountingRanks final : public Ranks {
public:
    CountingRanks(const Ranks& ranks, uint64_t pixels) : ranks_(ranks), pixels_(pixels) {}
    int count() const override { return ranks_.count(); }
    int index() const override { return ranks_.index(); }
    void share(void* data, size_t size, std::span<const uint64_t> begins) const override {
        if (begins.back() == pixels_) gathered += size * pixels_;
        ranks_.share(data, size, begins);
    }
    void distribute(const void* from, int senders, size_t size, std::span<const uint64_t> begins,
                    void* to) const override {
        if (begins.back() == pixels_) exchanged += size_t(senders) * size * pixels_;
        ranks_.distribute(from, senders, size, begins, to);
    }
    void broadcast(std::vector<std::byte>& bytes, int from) const override {
        ranks_.broadcast(bytes, from);
    }
    std::vector<std::string> gather(std::string_view said) const override {
        return ranks_.gather(said);
    }

    mutable uint64_t exchanged = 0, gathered = 0;

private:
    const Ranks& ranks_;
    uint64_t pixels_;
};

/// A number that bench/ranks_model.py assumes.
uint64_t assumed(const std::string& name) {
    std::ifstream file(ETENDUE_SOURCE_DIR "/bench/ranks_model.py");
    for (std::string line; std::getline(file, line);)
        if (line.starts_with(name + " = ")) return std::stoull(line.substr(name.size() + 3));
    return 0;
}

TEST(Ranks, ExchangeAndGatherWhatTheModelOfTheirTimeAssumes) {
    const Scene scene = build(mixed_room(lens_camera(24)));
    const uint64_t pixels = scene.film().pixel_count();
    RenderSettings settings = settings_of("bdpt");
    settings.spp = 3;
    ThreadRanks::run(2, [&](const Ranks& ranks) {
        const CountingRanks counting(ranks, pixels);
        RenderSettings own = settings;
        own.ranks = &counting;
        Renderer r(scene, own);
        r.run([](const Progress&) {}, std::atomic<bool>(false));
        EXPECT_EQ(counting.exchanged, 3 * pixels * assumed("EXCHANGED"));
        counting.gathered = 0;
        r.gather();
        EXPECT_EQ(counting.gathered, pixels * assumed("GATHERED"));
    });
}

class SharedRenderings : public ::testing::Test {
protected:
    SharedRenderings() : scene(build(mixed_room(lens_camera(24)))) { settings.spp = 18; }
    /// The first passes of a rendering that nothing disturbs.
    Outcome first_passes(uint64_t passes) const {
        RenderSettings s = settings;
        s.error = {};
        s.spp = passes;
        return Rendering{scene, s}.run(kAlone);
    }

    Scene scene;
    RenderSettings settings = settings_of("upg+bdpt");
};

TEST_F(SharedRenderings, EndAtTheSamePassByTheirError) {
    settings.spp = {};
    settings.error = 1.2 * first_passes(13).error.relative_rms;
    const Outcome alone = Rendering{scene, settings}.run(kAlone);
    EXPECT_EQ(alone.stopped_by, StopReason::Error);
    EXPECT_LE(alone.told.size(), 13u);
    for (const int ranks : {2, 4})
        for (const Outcome& o : Rendering{scene, settings}.run(ranks)) o.expect_equal(alone);
}

TEST_F(SharedRenderings, EndWhereOneIsInterrupted) {
    for (const int one : {0, 2}) {
        Rendering rendering{scene, settings};
        rendering.progress = [=](const Progress& p, int rank, std::atomic<bool>& interrupted) {
            // Passes 4 to 6 are made together.
            if (rank == one && p.passes == 5) interrupted = true;
        };
        for (Outcome& o : rendering.run(3)) {
            EXPECT_EQ(o.stopped_by, StopReason::Interrupted);
            o.stopped_by = StopReason::Samples;
            o.expect_equal(first_passes(7));
        }
    }
}

/// Throws in a pass.
class Failing final : public Integrator {
public:
    Failing(const IntegratorSpec& spec, uint32_t pass)
        : inner_(make_integrator(spec)), pass_(pass) {}
    void learn(const LearnContext& c) override { inner_->learn(c); }
    void prepare(const PassContext& pass) override { inner_->prepare(pass); }
    bool is_learning() const override { return inner_->is_learning(); }
    void save(LearnedState& to) const override { inner_->save(to); }
    void load(LearnedState& from) override { inner_->load(from); }
    void trace(const PassContext& pass) override {
        inner_->trace(pass);
        if (pass.index == pass_) throw std::runtime_error("a bad pass");
    }
    std::unique_ptr<PassSums> make_sums() const override { return inner_->make_sums(); }
    void collect(std::span<const std::unique_ptr<PassSums>> sums) override {
        inner_->collect(sums);
    }
    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        inner_->trace_eye_paths(c, z, stats);
    }
    void sample(const SampleContext& c, Workspace& work) const override { inner_->sample(c, work); }
    TechniqueCounts counts(const Scene& scene, uint64_t n) const override {
        return inner_->counts(scene, n);
    }
    uint64_t light_paths(const Scene& scene) const override { return inner_->light_paths(scene); }
    Estimator estimator() const override { return inner_->estimator(); }

private:
    std::unique_ptr<Integrator> inner_;
    uint32_t pass_;
};

TEST_F(SharedRenderings, EndBeforeThePassThatFails) {
    for (const uint32_t failing : {4u, 5u, 6u}) {
        SCOPED_TRACE(failing);
        Rendering rendering{scene, settings};
        rendering.make = [&](int) {
            return std::make_unique<Failing>(settings.integrator, failing);
        };
        // Passes 4 to 6 are made together, each by one process.
        const std::vector<Outcome> all = rendering.run(3);
        for (size_t r = 0; r < all.size(); ++r) {
            all[r].expect_equal(first_passes(failing));
            EXPECT_EQ(all[r].failure,
                      r + 4 == failing ? "a bad pass"
                                       : "process " + std::to_string(failing - 4) + ": a bad pass");
        }
        // The rendering goes on, with another number of processes.
        Outcome rest = Rendering{scene, settings, all[0].saved}.run(2)[0];
        rest.told = first_passes(18).told;
        rest.expect_equal(first_passes(18));
    }
}

TEST_F(SharedRenderings, HaveNoTechniqueImages) {
    settings.technique_depth = 3;
    ThreadRanks::run(2, [&](const Ranks& ranks) {
        RenderSettings own = settings;
        own.ranks = &ranks;
        EXPECT_THROW(Renderer(scene, own), std::runtime_error);
    });
}

TEST_F(SharedRenderings, StateIsCompleteAtTheEndOfEveryRound) {
    // Each process gathers there, as for a checkpoint; it goes on with the same bits.
    const Outcome alone = Rendering{scene, settings}.run(kAlone);
    const auto gather = [&](const Ranks& ranks) {
        RenderSettings own = settings;
        own.ranks = &ranks;
        Renderer r(scene, own);
        std::vector<uint64_t> rounds;
        r.run(
            [&](const Progress& p) {
                if (!p.ends_round) return;
                rounds.push_back(p.passes);
                r.gather();
            },
            std::atomic<bool>{false});
        r.gather();
        EXPECT_EQ(rounds, (std::vector<uint64_t>{1, 4, 7, 10, 13, 16, 18}));
        EXPECT_TRUE(r.film().image() == alone.image);
    };
    ThreadRanks::run(3, gather);
}

}  // namespace
}  // namespace etendue::test
