// What an integrator has learned can be saved and loaded: the rendering goes on with the same bits.

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "resumable.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// An integrator that is replaced by a new one, with its saved state, before a given pass.
class Resumed final : public Integrator {
public:
    Resumed(std::string name, uint32_t resume_at)
        : name_(std::move(name)), resume_at_(resume_at), inner_(make()) {}

    void learn(const LearnContext& context) override {
        if (context.index == resume_at_) resume();
        inner_->learn(context);
    }
    bool is_learning() const override { return inner_->is_learning(); }
    void save(LearnedState& to) const override { inner_->save(to); }
    void load(LearnedState& from) override { inner_->load(from); }
    void prepare(const PassContext& pass) override { inner_->prepare(pass); }
    void trace(const PassContext& pass) override {
        if (pass.index == resume_at_ && !is_resumed_) resume();
        inner_->trace(pass);
    }
    std::unique_ptr<PassSums> make_sums() const override { return inner_->make_sums(); }
    void collect(std::span<const std::unique_ptr<PassSums>> sums) override {
        inner_->collect(sums);
    }
    uint32_t eye_paths_of(uint32_t pass) const override { return inner_->eye_paths_of(pass); }
    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        inner_->trace_eye_paths(c, z, stats);
    }
    void sample(const SampleContext& context, Workspace& work) const override {
        inner_->sample(context, work);
    }
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return inner_->counts(scene, light_paths);
    }
    uint64_t light_paths(const Scene& scene) const override { return inner_->light_paths(scene); }
    Estimator estimator() const override { return inner_->estimator(); }

private:
    std::unique_ptr<Integrator> make() const {
        return make_integrator(IntegratorSpec::parse(name_));
    }
    void resume() {
        LearnedState saved;
        inner_->save(saved);
        LearnedState read(saved.bytes());
        inner_ = make();
        inner_->load(read);
        LearnedState again;
        inner_->save(again);
        EXPECT_EQ(again.bytes(), saved.bytes());
        is_resumed_ = true;
    }

    std::string name_;
    uint32_t resume_at_;
    std::unique_ptr<Integrator> inner_;
    bool is_resumed_ = false;
};

class Resume : public ::testing::TestWithParam<const char*> {};

TEST_P(Resume, GivesTheSameBits) {
    // With a filter that is wider than a pixel, the film points of a pass have a common place within their pixels, which
    // differs from pass to pass.
    const uint32_t refit = refit_pass(GetParam());
    const std::string camera = with_filter(lens_camera(image_size(GetParam())), "gaussian");
    const Scene scene = build(refit > 0 ? lantern_room(camera) : mixed_room(camera));
    RenderSettings settings;
    settings.sampler = SamplerKind::Sobol;
    settings.threads = 2;
    // Integrators learn before pass 4.
    const uint32_t learning_pass = refit > 0 ? refit : 4;
    settings.spp = learning_pass + 2;
    const auto image = [&](std::unique_ptr<Integrator> integrator) {
        Renderer r(scene, settings, std::move(integrator));
        r.run([](const Progress&) {}, std::atomic<bool>{false});
        return r.film().image();
    };
    const std::vector<Rgb> whole = image(make_integrator(IntegratorSpec::parse(GetParam())));
    for (const uint32_t pass : {learning_pass - 1, learning_pass}) {
        const std::vector<Rgb> resumed = image(std::make_unique<Resumed>(GetParam(), pass));
        for (size_t i = 0; i < whole.size(); ++i)
            for (int c = 0; c < 3; ++c) ASSERT_EQ(resumed[i][c], whole[i][c]) << pass << ", " << i;
    }
}

INSTANTIATE_TEST_SUITE_P(Integrators, Resume, ::testing::ValuesIn(resumable_methods()),
                         name_of_method);

TEST(LearnedState, OfAnotherIntegratorIsRefused) {
    LearnedState state;
    state.put(7);
    for (const char* name : {"upg", "vcm"}) {
        LearnedState read(state.bytes());
        EXPECT_THROW(make_integrator(IntegratorSpec::parse(name))->load(read), std::runtime_error);
    }
}

}  // namespace
}  // namespace etendue::test
