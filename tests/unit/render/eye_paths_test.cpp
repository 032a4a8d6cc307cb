// The eye paths of several samples are made in turns. The image is the same as with one path after the other.

#include <gtest/gtest.h>

#include "lit_room.h"
#include "render/renderer.h"

namespace etendue {
namespace {

/// Another integrator whose samples trace their own eye paths.
class OneByOne final : public Integrator {
public:
    explicit OneByOne(const IntegratorSpec& spec) : inner_(make_integrator(spec)) {}
    void learn(const LearnContext& c) override { inner_->learn(c); }
    void prepare(const PassContext& pass) override { inner_->prepare(pass); }
    bool is_learning() const override { return inner_->is_learning(); }
    void save(LearnedState& to) const override { inner_->save(to); }
    void load(LearnedState& from) override { inner_->load(from); }
    void trace(const PassContext& pass) override { inner_->trace(pass); }
    std::unique_ptr<PassSums> make_sums() const override { return inner_->make_sums(); }
    void collect(std::span<const std::unique_ptr<PassSums>> sums) override {
        inner_->collect(sums);
    }
    void sample(const SampleContext& c, Workspace& work) const override { inner_->sample(c, work); }
    TechniqueCounts counts(const Scene& scene, uint64_t n) const override {
        return inner_->counts(scene, n);
    }
    uint64_t light_paths(const Scene& scene) const override { return inner_->light_paths(scene); }
    Estimator estimator() const override { return inner_->estimator(); }

private:
    std::unique_ptr<Integrator> inner_;
};

struct Image {
    std::vector<Rgb> pixels;
    uint64_t eye_paths, vertices, rays;
};
Image render(const Scene& scene, const std::string& method, bool in_turns) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(method);
    settings.spp = 3;
    const IntegratorSpec spec = settings.integrator;
    auto integrator = in_turns ? make_integrator(spec) : std::make_unique<OneByOne>(spec);
    Renderer renderer(scene, settings, std::move(integrator));
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    return {renderer.film().image(), renderer.stats().eye_paths, renderer.stats().vertices,
            renderer.stats().rays()};
}

/// A lens, glass, a sky, and a masked pane with an image; an odd number of pixels.
Scene masked_room() {
    return test::build(
        test::lens_camera(13) + test::room() + test::area_lamp() +
        test::sphere("0.3,-0.6,0.2", "0.3", test::kGlass) +
        test::rectangle("<scale value=\"0.4\"/><translate z=\"0.5\"/>",
                        "<bsdf type=\"mask\"><texture name=\"opacity\" type=\"checkerboard\"/>" +
                            test::diffuse("0.6,0.5,0.4") + "</bsdf>") +
        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.2,0.3,0.4\"/></emitter>");
}

class EyePaths : public ::testing::TestWithParam<std::string> {};

TEST_P(EyePaths, AreTheSameInTurns) {
    for (const Scene& scene : {test::lit_room({}), masked_room()}) {
        const Image in_turns = render(scene, GetParam(), true),
                    one_by_one = render(scene, GetParam(), false);
        EXPECT_EQ(in_turns.pixels, one_by_one.pixels);
        EXPECT_EQ(in_turns.eye_paths, one_by_one.eye_paths);
        EXPECT_EQ(in_turns.vertices, one_by_one.vertices);
        EXPECT_EQ(in_turns.rays, one_by_one.rays);
    }
}

INSTANTIATE_TEST_SUITE_P(Methods, EyePaths,
                         ::testing::Values("path", "path:max_depth=3", "path:guide=on", "bdpt",
                                           "vcm", "upg+bdpt", "pcbpt"));

}  // namespace
}  // namespace etendue
