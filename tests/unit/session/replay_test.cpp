// Paths that are traced again are those of the rendering.

#include "session/replay.h"

#include <algorithm>
#include <map>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

Scene room_with_ball() {
    return build(sensor("0,0,3.5", "0,0,0", 8) + room() + area_lamp() +
                 sphere("0.3,-0.5,0.1", "0.4", "<bsdf type=\"conductor\"/>"));
}

/// All samples of a pixel, without a limit of time that matters.
ReplayRequest request_of(const RenderSettings& settings, uint64_t pixel) {
    ReplayRequest request;
    request.integrator = settings.integrator;
    request.sampler = settings.sampler;
    request.filter_mode = settings.filter_mode;
    request.seed = settings.seed;
    request.pixel = pixel;
    request.seconds = 100;
    return request;
}

Rgb sum_of(const std::vector<ReplayedPath>& paths) {
    Rgb sum;
    for (const ReplayedPath& p : paths) sum += p.value;
    return sum;
}

/// What one thread renders, with technique images of all paths that there can be.
RenderSettings settings_of(const std::string& integrator) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.integrator.params["max_depth"] = "10";
    settings.seed = 4;
    settings.threads = 1;
    settings.technique_depth = 12;
    return settings;
}

class ReplayOf : public ::testing::TestWithParam<std::string> {};

/// Contributions with t ≥ 2 sum to what the pixel has of them; the film's other part are splats.
TEST_P(ReplayOf, SumsToThePixel) {
    const Scene scene = room_with_ball();
    constexpr uint32_t kPasses = 16;
    RenderSettings settings = settings_of(GetParam());
    settings.spp = kPasses;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    std::vector<Rgb> eye(scene.film().pixel_count()), splats(eye.size());
    for (const auto& e : renderer.techniques()->images())
        for (size_t i = 0; i < eye.size(); ++i)
            (e.technique.t >= 2 ? eye : splats)[i] += e.weighted[i];
    for (const uint64_t pixel : {9u, 27u, 36u, 58u}) {
        ReplayRequest request = request_of(settings, pixel);
        request.passes = kPasses;
        const Replay all = replay(scene, request);
        EXPECT_EQ(all.passes, kPasses);
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(all.sum[c] / kPasses, eye[pixel][c], 1e-4f * (1 + eye[pixel][c])) << pixel;
        const Rgb listed = sum_of(all.paths);
        for (const ReplayedPath& p : all.paths) {
            ASSERT_EQ(int(p.points.size()), p.technique.vertices());
            EXPECT_EQ(p.points.front().event, 'L');
            EXPECT_EQ(p.points.back().event, 'E');
        }
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(listed[c], all.sum[c], 1e-3f * (1 + all.sum[c]));
    }
}

/// All integrators whose samples need no others, without roulette of joins and specular connections where they have them.
std::vector<std::string> methods_alone() {
    const Scene scene = room_with_ball();
    std::vector<std::string> methods;
    for (const IntegratorEntry& e : integrator_registry()) {
        IntegratorSpec spec{e.info.name, {}};
        for (const auto& [name, value] :
             {std::pair("roulette", "0"), std::pair("specular_connections", "off")})
            if (e.info.has_param(name)) spec.params[name] = value;
        if (replayed_passes(spec, scene) == ReplayedPasses::Any)
            methods.push_back(spec.to_string());
    }
    return methods;
}
INSTANTIATE_TEST_SUITE_P(Methods, ReplayOf, ::testing::ValuesIn(methods_alone()));

/// An integrator that is in no table: path tracing by another name.
class OwnIntegrator final : public Integrator {
public:
    explicit OwnIntegrator(bool samples_alone) : samples_alone_(samples_alone) {}
    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        path_->trace_eye_paths(c, z, stats);
    }
    void sample(const SampleContext& c, Workspace& work) const override { path_->sample(c, work); }
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return path_->counts(scene, light_paths);
    }
    uint64_t light_paths(const Scene&) const override { return 0; }
    bool samples_alone(const Scene&) const override { return samples_alone_; }
    Estimator estimator() const override { return Estimator::Unbiased; }
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}

private:
    std::unique_ptr<Integrator> path_ =
        make_integrator(IntegratorSpec::parse("path:specular_connections=off"));
    bool samples_alone_;
};

/// The integrator answers, not its name.
TEST(Replay, AsksTheIntegrator) {
    const Scene scene = room_with_ball();
    ReplayRequest request;
    request.pixel = 27;
    request.passes = 4;
    request.integrator = IntegratorSpec::parse("path:specular_connections=off");
    const Replay expected = replay(scene, request);
    for (const bool alone : {true, false}) {
        request.integrator = {alone ? "own" : "path", {}, [=](const auto&) {
                                  return std::make_unique<OwnIntegrator>(alone);
                              }};
        EXPECT_EQ(replayed_passes(request.integrator, scene),
                  alone ? ReplayedPasses::Any : ReplayedPasses::Whole);
        if (alone)
            EXPECT_EQ(replay(scene, request).sum, expected.sum);
        else
            EXPECT_THROW(replay(scene, request), std::runtime_error);
    }
}

TEST(Replay, SplatsAreThoseOfOnePass) {
    const Scene scene = room_with_ball();
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse("light");
    settings.seed = 4;
    settings.threads = 1;
    settings.spp = 1;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    ReplayRequest request = request_of(settings, 60);
    request.splats = true;
    const Replay r = replay(scene, request);
    EXPECT_EQ(r.light_paths, scene.film().pixel_count());
    const Rgb sum = sum_of(r.paths);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(sum[c], renderer.film().image()[60][c], 1e-5f + 1e-4f * sum[c]);
}

/// Also where pixels have several light paths, and where some have none.
TEST(Replay, TracesAllLightPaths) {
    const Scene scene = room_with_ball();
    for (const int light_paths : {40, 64, 150}) {
        RenderSettings settings = settings_of(
            "bdpt:roulette=0,specular_connections=off,light_paths=" + std::to_string(light_paths));
        settings.seed = 0;
        settings.spp = 1;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>(false));
        ReplayRequest request = request_of(settings, 60);
        request.splats = true;
        request.passes = 0;
        const Replay r = replay(scene, request);
        EXPECT_EQ(r.light_paths, uint64_t(light_paths));
        const Rgb sum = sum_of(r.paths);
        Rgb expected;
        for (const auto& e : renderer.techniques()->images())
            if (e.technique.t <= 1) expected += e.weighted[60];
        EXPECT_GT(expected.g, 0);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], expected[c], 1e-5f + 1e-4f * sum[c]);
    }
}

TEST(Replay, EndsAtItsLimits) {
    const Scene scene = room_with_ball();
    ReplayRequest request;
    request.integrator = IntegratorSpec::parse("bdpt:specular_connections=off");
    request.pixel = 27;
    request.passes = 1000;
    request.most_paths = 10;
    const Replay r = replay(scene, request);
    EXPECT_EQ(r.paths.size(), 10u);
    EXPECT_GT(r.left_out, 0u);
    request.seconds = 0;
    EXPECT_EQ(replay(scene, request).passes, 0u);
    request.integrator = IntegratorSpec::parse("vcm");
    EXPECT_THROW(replay(scene, request), std::runtime_error);
}

TEST(Replay, KnowsWhichPassesCanBeTraced) {
    const Scene mirror = room_with_ball(),
                rough = build(sensor("0,0,3.5", "0,0,0", 8) + room() + area_lamp());
    const auto passes = [&](const char* text, const Scene& scene) {
        return replayed_passes(IntegratorSpec::parse(text), scene);
    };
    for (const char* alone : {"path:specular_connections=off", "light", "path:guide=off",
                              "bdpt:roulette=0,specular_connections=off"})
        EXPECT_EQ(passes(alone, rough), ReplayedPasses::Any) << alone;
    for (const char* shared : {"vcm", "upg", "pcbpt", "path:guide=on"})
        EXPECT_EQ(passes(shared, rough), ReplayedPasses::Whole) << shared;
    for (const char* none : {"mlt", "pssmlt", "pm"})
        EXPECT_EQ(passes(none, rough), ReplayedPasses::None) << none;
    // The selection of lamps is learned where there are several.
    const Scene lamps =
        build(sensor("0,0,3.5", "0,0,0", 8) + room() + area_lamp() + "<emitter type=\"point\"/>");
    for (const std::string method : {"path", "bdpt"}) {
        EXPECT_EQ(passes(method.c_str(), lamps), ReplayedPasses::Whole) << method;
        EXPECT_EQ(passes((method + ":lights=power").c_str(), lamps), ReplayedPasses::Any) << method;
    }
    // Specular connections are prepared where there is something smooth.
    for (const char* method : {"path", "bdpt", "path:specular_connections=on"}) {
        EXPECT_EQ(passes(method, rough), ReplayedPasses::Any) << method;
        EXPECT_EQ(passes(method, mirror), ReplayedPasses::Whole) << method;
    }
}

class ReplayOfPass : public ::testing::TestWithParam<const char*> {};

/// Any pass is traced again as it was when it was the last one, whatever was learned since.
TEST_P(ReplayOfPass, IsThatAfterThePass) {
    const Scene scene = room_with_ball();
    RenderSettings settings = settings_of(GetParam());
    settings.keeps_generations = true;
    Renderer renderer(scene, settings);
    const auto shared = std::shared_ptr<const Scene>(std::shared_ptr<void>(), &scene);
    std::map<uint32_t, std::vector<Replay>> before;
    const uint64_t pixels = scene.film().pixel_count();
    for (const uint32_t pass : {0u, 2u, 5u, 19u}) {
        RenderLimits limits;
        limits.spp = pass + 1;
        renderer.run(
            limits, [](const Progress&) {}, std::atomic<bool>(false));
        for (uint64_t p = 0; p < pixels; p += 7)
            before[pass].push_back(replay_last(renderer, p, 100000));
    }
    EXPECT_FALSE(renderer.generation_of(20));
    size_t paths = 0;
    for (const auto& [pass, replays] : before) {
        const PassOfRun of{shared, renderer.settings(), pass, renderer.generation_of(pass)};
        ASSERT_TRUE(of.generation);
        for (uint64_t p = 0, i = 0; p < pixels; p += 7, ++i) {
            const Replay again = replay_pass(of, p, 100000, std::atomic<bool>(false));
            EXPECT_EQ(again.sum, replays[i].sum) << "pass " << pass << ", pixel " << p;
            EXPECT_EQ(size_t(std::count_if(again.paths.begin(), again.paths.end(),
                                           [](const auto& q) { return q.technique.t >= 2; })),
                      replays[i].paths.size());
            for (const ReplayedPath& path : again.paths) EXPECT_EQ(path.pass, pass);
            paths += again.paths.size();
        }
    }
    EXPECT_GT(paths, 20u);
    // Others trace nothing before the samples.
    const std::string& name = settings.integrator.name;
    if (name == "path" || name == "bdpt") return;
    const PassOfRun of{shared, renderer.settings(), 2, renderer.generation_of(2)};
    EXPECT_THROW(replay_pass(of, 0, 1, std::atomic<bool>(true)), PassDropped);
}

INSTANTIATE_TEST_SUITE_P(Methods, ReplayOfPass,
                         ::testing::Values("vcm:radius=0.3", "vcm:guide=on,radius=0.3",
                                           "upg:radius=0.3", "upg+bdpt:radius=0.3", "pcbpt",
                                           "sppm:radius=0.3", "path:guide=on", "bdpt:guide=on",
                                           "path:specular_connections=auto"));

class SplatsOfPass : public ::testing::TestWithParam<const char*> {};

/// With the splats, the paths sum to all that the pass has added to the pixel.
TEST_P(SplatsOfPass, SumToThePass) {
    const Scene scene = room_with_ball();
    RenderSettings settings = settings_of(GetParam());
    settings.keeps_generations = true;
    Renderer renderer(scene, settings);
    const auto image_after = [&](uint64_t spp) {
        RenderLimits limits;
        limits.spp = spp;
        renderer.run(
            limits, [](const Progress&) {}, std::atomic<bool>(false));
        return renderer.film().image();
    };
    constexpr uint32_t kPass = 4;
    const std::vector<Rgb> before = image_after(kPass), after = image_after(kPass + 1);
    const auto shared = std::shared_ptr<const Scene>(std::shared_ptr<void>(), &scene);
    const PassOfRun of{shared, renderer.settings(), kPass, renderer.generation_of(kPass)};
    size_t splats = 0;
    for (uint64_t p = 0; p < before.size(); p += 5) {
        const Replay all = replay_pass(of, p, 1000000, std::atomic<bool>(false));
        EXPECT_EQ(all.light_paths, renderer.light_paths());
        const Rgb listed = sum_of(all.paths);
        for (int c = 0; c < 3; ++c) {
            const float added = after[p][c] * (kPass + 1) - before[p][c] * kPass;
            EXPECT_NEAR(listed[c], added, 1e-4f * (1 + after[p][c] * (kPass + 1))) << p;
        }
        splats += size_t(std::count_if(all.paths.begin(), all.paths.end(),
                                       [](const auto& q) { return q.technique.t <= 1; }));
    }
    EXPECT_GT(splats, 3u);
}

INSTANTIATE_TEST_SUITE_P(Methods, SplatsOfPass,
                         ::testing::Values("vcm:radius=0.3", "pcbpt", "bdpt:guide=on",
                                           "bdpt:guide=on,light_paths=100", "light:guide=on",
                                           "bdpt:specular_connections=on"));

class LastReplayOf : public ::testing::TestWithParam<const char*> {};

/// Contributions with t ≥ 2 sum to the difference of the pixel's sums after and before the last pass.
TEST_P(LastReplayOf, SumsToTheLastPass) {
    const Scene scene = room_with_ball();
    constexpr int kPasses = 6;
    RenderSettings settings = settings_of(GetParam());
    std::vector<Rgb> in_flight;
    const Renderer* made = nullptr;
    settings.meanwhile = [&] {
        if (made->kept_pass() != uint32_t(kPasses - 1)) return;
        for (uint64_t pixel = 0; pixel < scene.film().pixel_count(); ++pixel)
            in_flight.push_back(replay_last(*made, pixel, 1).sum);
    };
    Renderer renderer(scene, settings);
    made = &renderer;
    EXPECT_THROW(replay_last(renderer, 0, 10), std::runtime_error);
    const auto sums = [&](uint64_t passes) {
        RenderLimits limits;
        limits.spp = passes;
        renderer.run(
            limits, [](const Progress&) {}, std::atomic<bool>(false));
        std::vector<Rgb> eye(scene.film().pixel_count());
        for (const auto& e : renderer.techniques()->images())
            for (size_t i = 0; i < eye.size(); ++i)
                if (e.technique.t >= 2) eye[i] += e.weighted[i] * float(passes);
        return eye;
    };
    const std::vector<Rgb> before = sums(kPasses - 1), after = sums(kPasses);
    size_t paths = 0;
    bool has_pairs = false;
    ASSERT_EQ(in_flight.size(), before.size());
    for (uint64_t pixel = 0; pixel < before.size(); ++pixel) {
        const Replay last = replay_last(renderer, pixel, 100000);
        EXPECT_EQ(last.sum, in_flight[pixel]) << "otherwise while the pass is traced";
        const Rgb expected = after[pixel] - before[pixel];
        for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(last.sum[c], expected[c], 2e-4f * (1 + after[pixel][c])) << pixel;
        for (const ReplayedPath& p : last.paths) {
            ASSERT_EQ(int(p.points.size()), p.technique.vertices());
            EXPECT_EQ(p.pass, uint32_t(kPasses - 1));
            EXPECT_EQ(p.points.front().event, 'L');
            EXPECT_EQ(p.points.back().event, 'E');
            // All points are in the room, or on its lens.
            for (const ReplayedPath::Point& point : p.points)
                EXPECT_LT(length(point.p), 3.6f) << p.technique.s << ',' << p.technique.t;
            EXPECT_NEAR(p.points.front().p.y, 0.98f, 1e-3f) << "not on the lamp";
            has_pairs |= is_pair(p.technique.strategy);
        }
        paths += last.paths.size();
    }
    EXPECT_GT(paths, before.size() / 4) << "too few paths to say anything";
    const std::string name = settings.integrator.name;
    EXPECT_EQ(has_pairs, name == "vcm" || name == "sppm" || name.starts_with("upg"));
    // After a discarded pass, its light paths are not those of the last one.
    const std::atomic<bool> yes{true};
    RenderLimits more;
    more.spp = kPasses + 1;
    renderer.run(
        more, [](const Progress&) {}, yes, yes);
    EXPECT_THROW(replay_last(renderer, 27, 1), std::runtime_error);
}

INSTANTIATE_TEST_SUITE_P(
    Methods, LastReplayOf,
    // Roulette has the thresholds of the pass.
    ::testing::Values("vcm:roulette=0,radius=0.3", "vcm:roulette=0.3,radius=0.3",
                      "upg:roulette=0,radius=0.3", "upg:roulette=0.3,radius=0.3",
                      "upg+bdpt:roulette=0,radius=0.3", "upg+bdpt:roulette=0.3,radius=0.3",
                      "pcbpt:roulette=0", "pcbpt:roulette=0.3", "pcbpt:eorr=true", "path:guide=on",
                      "sppm:radius=0.3"));

}  // namespace
}  // namespace etendue::test
