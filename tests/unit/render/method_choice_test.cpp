// The method that `auto` chooses.

#include "render/method_choice.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "error_of.h"
#include "integrator/auto.h"
#include "math/hash.h"
#include "math/statistics.h"
#include "render/pilot_score.h"
#include "render/render_request.h"
#include "test_scenes.h"
#include "thread_ranks.h"

namespace etendue::test {
namespace {

Scene scene_of_project(const std::string& name, int width, int height) {
    BuildOptions options;
    options.resolution = {width, height};
    return build_scene(
        read_mitsuba_xml(std::filesystem::path(ETENDUE_SOURCE_DIR) / "scenes" / name), options);
}

RenderSettings settings_of(const Scene& scene, const std::string& method, double seconds) {
    RenderSettings s;
    s.integrator = choose_integrator(scene, method);
    s.sampler = SamplerKind::Sobol;
    s.seconds = seconds;
    s.threads = 2;
    return s;
}

MethodChoice choice_of(const Scene& scene, const std::string& method = "auto", double seconds = 4) {
    return *with_chosen_method(scene, settings_of(scene, method, seconds)).choice;
}

std::vector<std::string> methods_of(const MethodChoice& choice) {
    std::vector<std::string> all;
    for (const auto& c : choice.candidates) all.push_back(c.method);
    std::sort(all.begin(), all.end());
    return all;
}

TEST(MethodChoice, IsSensible) {
    const auto chosen = [](const std::string& scene) {
        const Scene s = scene_of_project(scene, 240, 180);
        return IntegratorSpec::parse(choice_of(s, "auto", 20).chosen).name;
    };
    const std::string cornell = chosen("cornell.xml");
    EXPECT_TRUE(cornell == "path" || cornell == "bdpt") << cornell;
    EXPECT_NE(chosen("ring.xml"), "path");
    EXPECT_NE(chosen("lantern.xml"), "path");
}

TEST(MethodChoice, IsAFunctionOfSceneSeedAndBudget) {
    const Scene scene = scene_of_project("ring.xml", 160, 120);
    RenderSettings settings = settings_of(scene, "auto", 4);
    const auto text = [&] {
        MethodChoice c = *with_chosen_method(scene, settings).choice;
        c.seconds = 0;
        return c.to_json().dump();
    };
    const std::string first = text();
    for (const int threads : {1, 3}) {
        settings.threads = threads;
        EXPECT_EQ(text(), first);
    }
    settings.first_pass = 100;
    EXPECT_EQ(text(), first);
    settings.seed = 1;
    EXPECT_NE(text(), first);
}

TEST(MethodChoice, TheChosenTextGivesTheSameBits) {
    const Scene scene = scene_of_project("ring.xml", 96, 72);
    RenderSettings settings = settings_of(scene, "auto", 1e9);
    settings.spp = 400;
    const std::atomic<bool> never{false};
    Renderer automatic(scene, settings);
    ASSERT_TRUE(automatic.settings().choice);
    EXPECT_GT(automatic.settings().choice->candidates.front().images, 0);
    automatic.run(
        {.spp = 5, .seconds = {}, .error = {}}, [](const Progress&) {}, never);
    settings.integrator = IntegratorSpec::parse(automatic.settings().choice->chosen);
    Renderer given(scene, settings);
    EXPECT_FALSE(given.settings().choice);
    given.run(
        {.spp = 5, .seconds = {}, .error = {}}, [](const Progress&) {}, never);
    EXPECT_TRUE(automatic.film().image() == given.film().image());
    EXPECT_EQ(automatic.stats().rays(), given.stats().rays());
    // The time of pilots counts.
    EXPECT_GE(automatic.seconds(), automatic.settings().choice->seconds);
}

/// Chains cannot be shared.
TEST(MethodChoice, ProcessesThatRenderTogetherChooseTheSameWithoutChains) {
    const Scene scene = scene_of_project("ring.xml", 48, 36);
    RenderSettings settings = settings_of(scene, "auto:chains=false", 4);
    const std::string alone = with_chosen_method(scene, settings).integrator.to_string();
    settings.integrator = choose_integrator(scene, "auto");
    ThreadRanks::run(2, [&](const Ranks& ranks) {
        RenderSettings own = settings;
        own.ranks = &ranks;
        own.threads = 1;
        const RenderSettings chosen = with_chosen_method(scene, own);
        EXPECT_EQ(chosen.integrator.to_string(), alone);
        EXPECT_GT(chosen.choice->candidates.front().images, 0);
        EXPECT_EQ(chosen.ranks, &ranks);
    });
}

TEST(MethodChoice, PilotsTakeASmallPart) {
    const Scene scene = scene_of_project("cornell.xml", 200, 200);
    for (const double seconds : {0.01, 0.1, 0.5, 2.0, 8.0}) {
        SCOPED_TRACE(seconds);
        const MethodChoice c = choice_of(scene, "auto", seconds);
        EXPECT_DOUBLE_EQ(c.budget, seconds);
        // The first pilot of a scene may be dearer than those of a usual one.
        EXPECT_LE(c.pilots, 0.12 * c.budget);
    }
    // No pilots where they would take longer than that.
    const MethodChoice none = choice_of(scene, "auto", 0.001);
    EXPECT_EQ(none.chosen, "bdpt");
    EXPECT_EQ(none.pilots, 0);
    EXPECT_NE(none.message().find("without pilots"), std::string::npos);
}

TEST(MethodChoice, PilotsTakeNoMoreThanAnErrorNeeds) {
    const Scene scene = scene_of_project("cornell.xml", 200, 200);
    RenderSettings settings = settings_of(scene, "auto", 0);
    settings.seconds = {};
    settings.error = 0.3;
    const MethodChoice loose = *with_chosen_method(scene, settings).choice;
    settings.error = 0.03;
    const MethodChoice tight = *with_chosen_method(scene, settings).choice;
    EXPECT_LT(loose.budget, 0.1 * tight.budget);
    EXPECT_LT(loose.pilots, tight.pilots);
}

TEST(MethodChoice, CandidatesAreThoseThatMayBe) {
    const Scene scene = build(front_camera(16) + room() + area_lamp());
    using Names = std::vector<std::string>;
    EXPECT_EQ(methods_of(choice_of(scene)),
              (Names{"bdpt", "mlt", "mmlt", "path", "pcbpt", "upg+bdpt"}));
    EXPECT_EQ(methods_of(choice_of(scene, "auto:chains=false")),
              (Names{"bdpt", "path", "pcbpt", "upg+bdpt"}));
    EXPECT_EQ(methods_of(choice_of(scene, "auto:chains=false,consistent=true")),
              (Names{"bdpt", "path", "pcbpt", "upg+bdpt", "vcm"}));
    // Too short for chains.
    EXPECT_EQ(methods_of(choice_of(scene, "auto:max_depth=2")),
              (Names{"bdpt", "path", "pcbpt", "upg+bdpt"}));
    // Eye paths do not find all light of a point.
    const Scene lit_by_point =
        build(front_camera(16) + room() +
              "<emitter type=\"point\"><point name=\"position\" value=\"0,0.5,0\"/></emitter>");
    EXPECT_EQ(methods_of(choice_of(lit_by_point)),
              (Names{"bdpt", "mlt", "mmlt", "pcbpt", "upg+bdpt"}));
}

TEST(MethodChoice, ParametersAreThoseOfTheMethod) {
    const Scene scene = build(front_camera(16) + room() + area_lamp());
    const MethodChoice c = choice_of(scene, "auto:max_depth=4,chains=false");
    const IntegratorSpec spec = IntegratorSpec::parse(c.chosen);
    EXPECT_EQ(spec.params.at("max_depth"), "4");
    EXPECT_EQ(spec.params.size(), 1u);
    EXPECT_EQ(c.asked, "auto:chains=false,consistent=false,max_depth=4");
    EXPECT_NE(error_of([&] { choice_of(scene, "auto:depth=4"); }).find("max_depth"),
              std::string::npos);
    EXPECT_NE(error_of([&] { choice_of(scene, "auto:chains=perhaps"); }).find("true or false"),
              std::string::npos);
}

TEST(MethodChoice, IsWrittenAndRead) {
    const Scene scene = build(front_camera(16) + room() + area_lamp());
    const RenderSettings settings = settings_of(scene, "auto", 4);
    const MethodChoice c = *with_chosen_method(scene, settings).choice;
    const MethodChoice read = MethodChoice::from_json(c.to_json().dump());
    EXPECT_EQ(read.to_json(), c.to_json());
    // Another limit would choose anew.
    RenderSettings longer = settings;
    longer.seconds = 1000;
    const RenderSettings resumed = with_chosen_method(longer, read);
    EXPECT_EQ(resumed.integrator.to_string(), c.chosen);
    EXPECT_EQ(resumed.choice->to_json(), c.to_json());
    longer.integrator = choose_integrator(scene, "auto:chains=false");
    EXPECT_NE(error_of([&] { with_chosen_method(longer, read); }).find("chains=false"),
              std::string::npos);
    EXPECT_NE(error_of([] { MethodChoice::from_json("{}"); }).find("damaged"), std::string::npos);
    EXPECT_NE(error_of([] { MethodChoice::from_json("no"); }).find("damaged"), std::string::npos);
}

/// The pixels of a small rendering, in images of one pass each, and their mean.
struct Passes {
    PilotImages images;
    double mean = 0;

    Passes(const Scene& scene, const std::string& method, uint64_t seed) {
        constexpr int kPasses = 4;
        RenderSettings s;
        s.integrator = IntegratorSpec::parse(method);
        s.seed = seed;
        s.threads = 1;
        s.spp = kPasses;
        Renderer r(scene, s);
        std::vector<double> before(scene.film().pixel_count());
        r.run(
            s,
            [&](const Progress&) {
                auto& image = images.images.emplace_back();
                for (size_t i = 0; i < before.size(); ++i) {
                    const double sum = r.film().moments()[i].sum[0];
                    image.push_back(float(sum - before[i]));
                    before[i] = sum;
                }
            },
            std::atomic<bool>{false});
        for (const double v : before) mean += v / kPasses / double(before.size());
        images.horizon = kPasses;
    }
};

/// A choice by the passes that it steers prefers methods whose samples happen to be dark. Means over many renderings show
/// it; they do not where the passes are others.
TEST(MethodChoice, ByThePassesThatItSteersWouldBeBiased) {
    const Scene scene = scene_of_project("ring.xml", 12, 9);
    const std::vector<std::string> methods{"path:max_depth=3", "bdpt:max_depth=3"};
    Moments seen, unseen;  // relative to one of the methods, which is unbiased
    for (uint64_t seed = 0; seed < 400; ++seed) {
        std::vector<Passes> own, others;
        for (const std::string& m : methods) {
            own.emplace_back(scene, m, hash_combine(seed, 1));
            others.emplace_back(scene, m, hash_combine(seed, 2));
        }
        const auto best = [&](const std::vector<Passes>& of) {
            const std::vector<PilotImages> images{of[0].images, of[1].images};
            const auto s = score_pilots(images, 12, 9);
            return s[0].error() <= s[1].error() ? 0 : 1;
        };
        seen.add(own[size_t(best(own))].mean - own[1].mean);
        unseen.add(own[size_t(best(others))].mean - own[1].mean);
    }
    const auto errors = [](const Moments& m) {
        return m.mean() / std::sqrt(m.variance() / double(m.count()));
    };
    EXPECT_LT(std::abs(errors(unseen)), 4) << unseen.mean();
    EXPECT_LT(errors(seen), -6) << seen.mean();
}

}  // namespace
}  // namespace etendue::test
