// The method that `auto` chooses.

#include "render/method_choice.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <optional>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "error_of.h"
#include "integrator/auto.h"
#include "integrator/shared_by_pilots.h"
#include "math/statistics.h"
#include "render/candidates.h"
#include "render/cost_table.h"
#include "render/learned_guide.h"
#include "render/pilot_rendering.h"
#include "render/render_request.h"
#include "sampler/pilot_seed.h"
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

/// A lamp behind more panes than specular connections pass. Eye paths never find it, and light paths rarely: most of them start
/// outside of the room.
TEST(MethodChoice, IsNoMethodThatFindsNoLightWhereAnotherOneDoes) {
    std::string panes;
    for (const char* radius : {"0.3", "0.28", "0.26", "0.24", "0.22"})
        panes += sphere("0,0.2,0", radius, "<bsdf type=\"thindielectric\"/>");
    const Scene scene = build(
        front_camera(32) + room() + panes +
        sphere("0,0.2,0", "0.0005",
               "<emitter type=\"area\"><rgb name=\"radiance\" value=\"40000\"/></emitter>") +
        rectangle("<scale value=\"0.25\"/><rotate y=\"1\" angle=\"180\"/><translate z=\"-3\"/>",
                  "<emitter type=\"area\"><rgb name=\"radiance\" value=\"1500\"/></emitter>"));
    int black = 0;
    for (uint64_t seed = 0; seed < 6; ++seed) {
        SCOPED_TRACE(seed);
        RenderSettings settings = settings_of(scene, "auto:chains=false", 20);
        settings.seed = seed;
        const MethodChoice choice = *with_chosen_method(scene, settings).choice;
        for (const auto& c : choice.candidates) black += c.method == "path" && c.noise == 0;
        EXPECT_NE(IntegratorSpec::parse(choice.chosen).name, "path");
    }
    EXPECT_GE(black, 3);
}

/// The light of a point in a glass ball, on walls that are seen through the ball. Specular connections alone find it.
TEST(MethodChoice, IsNoChainWhereConnectionsAloneFindLight) {
    const auto pilots_of_chains = [](const std::string& xml) {
        int images = 0;
        for (const auto& c : choice_of(build(xml), "auto", 20).candidates)
            if (c.method == "mlt" || c.method == "mmlt") images += c.images;
        return images;
    };
    EXPECT_EQ(pilots_of_chains(front_camera(32) + room() + sphere("0.3,0.2,0.1", "0.25", kGlass) +
                               "<emitter type=\"point\"><point name=\"position\" "
                               "value=\"0.3,0.2,0.1\"/></emitter>"),
              0);
    // The lamp is large enough for hits.
    EXPECT_GT(pilots_of_chains(lantern_room(front_camera(32))), 0);
}

/// `asked` for a rendering of so many seconds.
void expect_function_of_scene_seed_and_budget(const std::string& asked, double seconds) {
    const Scene scene = scene_of_project("ring.xml", 160, 120);
    RenderSettings settings = settings_of(scene, asked, seconds);
    const auto text = [&] {
        MethodChoice c = *with_chosen_method(scene, settings).choice;
        EXPECT_GT(c.candidates.front().images, 0);
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

TEST(MethodChoice, IsAFunctionOfSceneSeedAndBudget) {
    expect_function_of_scene_seed_and_budget("auto", 4);
}

/// A rendering of some passes.
std::unique_ptr<Renderer> rendered(const Scene& scene, const RenderSettings& settings) {
    auto r = std::make_unique<Renderer>(scene, settings);
    r->run(
        {.spp = 5, .seconds = {}, .error = {}}, [](const Progress&) {}, std::atomic<bool>{false});
    return r;
}

TEST(MethodChoice, TheChosenTextGivesTheSameBits) {
    const std::string lit = front_camera(72) + room() + area_lamp();
    const auto with = [&](const std::string& integrator) {
        return build(lit + "<integrator type=\"" + integrator + "</integrator>");
    };
    // Where the scene has parameters for the chosen method, too, and where it has a limit that is asked for otherwise.
    const std::string limit = "<integer name=\"max_depth\" value=\"2\"/>";
    std::vector<Scene> scenes;
    scenes.push_back(scene_of_project("ring.xml", 96, 72));
    scenes.push_back(with("path\"><integer name=\"rr_depth\" value=\"2\"/>"));
    scenes.push_back(with("bdpt\"><integer name=\"rr_depth\" value=\"3\"/>"));
    scenes.push_back(with("path\">" + limit));
    for (const Scene& scene : scenes)
        for (const char* asked : {"auto:chains=false", "auto:chains=false,max_depth=-1"}) {
            SCOPED_TRACE(asked);
            RenderSettings settings = settings_of(scene, asked, 1e9);
            settings.spp = 400;
            const auto automatic = rendered(scene, settings);
            const auto choice = automatic->settings().choice;
            ASSERT_TRUE(choice);
            SCOPED_TRACE(choice->chosen);
            EXPECT_GT(choice->candidates.front().images, 0);
            settings.integrator = choose_integrator(scene, choice->chosen);
            const auto given = rendered(scene, settings);
            EXPECT_FALSE(given->settings().choice);
            EXPECT_TRUE(automatic->film().image() == given->film().image());
            EXPECT_EQ(automatic->stats().rays(), given->stats().rays());
            // The time of pilots counts.
            EXPECT_GE(automatic->seconds(), choice->seconds);
            // A rendering that goes on has it, too.
            settings.integrator = choose_integrator(scene, asked);
            EXPECT_EQ(with_chosen_method(settings, *choice).integrator.to_string(), choice->chosen);
        }
}

/// Methods whose walks and chains are guided.
TEST(MethodChoice, HasCandidatesWithGuides) {
    const Scene scene = scene_of_project("ring.xml", 160, 120);
    int guided = 0, guided_chains = 0;
    constexpr double kSeconds = 100;
    const MethodChoice choice = choice_of(scene, "auto", kSeconds);
    EXPECT_LE(choice.pilots, 0.08 * kSeconds);
    for (const auto& k : choice.candidates)
        if (k.method.find(":guide=on") != std::string::npos && k.images > 0) {
            ++guided;
            guided_chains += candidate_method(k.method).has_chains;
            // The training is booked.
            EXPECT_GE(k.start_seconds, training_seconds(100000));
        }
    EXPECT_GT(guided, 1);
    EXPECT_GT(guided_chains, 0);
    // Where the training of the rendering would take a large part of it, there are none.
    for (const auto& k : choice_of(scene, "auto", 8).candidates)
        EXPECT_EQ(k.method.find(":guide"), std::string::npos) << k.method;
}

TEST(GuideChoice, IsSensible) {
    const auto chosen = [](const std::string& scene, const std::string& method) {
        const MethodChoice c = choice_of(scene_of_project(scene, 240, 180), method, 60);
        return IntegratorSpec::parse(c.chosen).params.at("guide");
    };
    EXPECT_EQ(chosen("lantern.xml", "path:guide=auto"), "on");
    EXPECT_EQ(chosen("cornell.xml", "bdpt:guide=auto"), "off");
}

/// For each method, also where the parameters name it.
TEST(GuideChoice, ExistsForEachMethodThatHasAGuide) {
    const Scene scene = scene_of_project("ring.xml", 64, 48);
    for (const IntegratorEntry& entry : integrator_registry()) {
        if (!entry.info.has_param("guide")) continue;
        const std::string name = entry.info.name;
        SCOPED_TRACE(name);
        const MethodChoice c =
            choice_of(scene, name + ":guide=auto,guide_walks=20000,max_depth=5", 30);
        EXPECT_EQ(methods_of(c), (std::vector{name, name + ":guide=on"}));
        EXPECT_EQ(c.asked, name + ":guide=auto,guide_walks=20000,max_depth=5");
        EXPECT_TRUE(c.chosen == name + ":guide=off,guide_walks=20000,max_depth=5" ||
                    c.chosen == name + ":guide=on,guide_walks=20000,max_depth=5")
            << c.chosen;
        EXPECT_LE(c.pilots, 0.04 * 30);
        for (const auto& k : c.candidates) EXPECT_GT(k.images, 0);
        EXPECT_EQ(c.message().rfind("guide=auto: ", 0), 0u);
    }
    EXPECT_FALSE(is_chosen_by_pilots(IntegratorSpec::parse("bdpt:guide=on")));
    EXPECT_NE(error_of([&] { choice_of(scene, "bdpt:guide=auto,depth=4"); }).find("max_depth"),
              std::string::npos);
}

TEST(GuideChoice, IsAFunctionOfSceneSeedAndBudget) {
    expect_function_of_scene_seed_and_budget("pcbpt:guide=auto", 30);
}

TEST(GuideChoice, TheChosenTextGivesTheSameBits) {
    const Scene lantern = scene_of_project("lantern.xml", 96, 72),
                asked_by_scene = build(front_camera(72) + room() + area_lamp() +
                                       "<integrator type=\"bdpt\"><string name=\"guide\" "
                                       "value=\"auto\"/></integrator>");
    for (const auto& [scene, asked] :
         {std::pair{&lantern, "bdpt:guide=auto"}, {&asked_by_scene, ""}}) {
        RenderSettings settings = settings_of(*scene, asked, 1e9);
        settings.spp = 4000;
        const auto automatic = rendered(*scene, settings);
        const auto choice = automatic->settings().choice;
        ASSERT_TRUE(choice);
        SCOPED_TRACE(choice->chosen);
        EXPECT_GT(choice->candidates.front().images, 0);
        settings.integrator = choose_integrator(*scene, choice->chosen);
        const auto given = rendered(*scene, settings);
        EXPECT_FALSE(given->settings().choice);
        EXPECT_TRUE(automatic->film().image() == given->film().image());
        // A rendering that goes on has it, too.
        settings.integrator = choose_integrator(*scene, asked);
        EXPECT_EQ(with_chosen_method(settings, *choice).integrator.to_string(), choice->chosen);
        settings.integrator = IntegratorSpec::parse("path:guide=auto");
        EXPECT_NE(error_of([&] { with_chosen_method(settings, *choice); }).find("path"),
                  std::string::npos);
    }
}

/// Nothing is trained for renderings that it would make much longer.
TEST(GuideChoice, ShortRenderingsHaveNoPilots) {
    const Scene scene = scene_of_project("lantern.xml", 240, 180);
    for (const char* method : {"path:guide=auto", "bdpt:guide=auto", "mlt:guide=auto"}) {
        SCOPED_TRACE(method);
        RenderSettings settings = settings_of(scene, method, 1);
        const auto expect_none = [&] {
            const MethodChoice c = *with_chosen_method(scene, settings).choice;
            EXPECT_EQ(c.pilots, 0);
            EXPECT_NE(c.chosen.find("guide=off"), std::string::npos);
        };
        expect_none();
        settings.seconds = {};
        settings.spp = 4;
        expect_none();
        for (const double seconds : {10.0, 20.0, 40.0})
            EXPECT_LE(choice_of(scene, method, seconds).pilots, 0.04 * seconds);
    }
}

/// The number of light paths that is given is that of a whole pass.
TEST(GuideChoice, PilotsHaveTheirPartOfTheLightPaths) {
    const Scene scene = scene_of_project("lantern.xml", 160, 120);
    const MethodChoice few = choice_of(scene, "upg+bdpt:guide=auto", 120),
                       many = choice_of(scene, "upg+bdpt:guide=auto,light_paths=19200", 120);
    ASSERT_GT(many.candidates.front().images, 0);
    EXPECT_LT(many.pilots, 2 * few.pilots);
}

/// Direct light on its own lamps has no noise.
TEST(GuideChoice, NothingIsTrainedWithoutNoise) {
    const Scene scene = scene_of_project("lantern.xml", 160, 120);
    EXPECT_LT(choice_of(scene, "path:guide=auto,max_depth=1", 60).pilots, 0.1);
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

/// The same choice as for so many times the seconds, whatever the number of threads that render.
TEST(MethodChoice, SecondsAreThoseOfTheGivenThreads) {
    const Scene scene = scene_of_project("ring.xml", 160, 120);
    const MethodChoice many = choice_of(scene, "auto:chains=false,threads=32", 0.25),
                       one = choice_of(scene, "auto:chains=false", 8);
    EXPECT_EQ(many.budget, 8);
    EXPECT_EQ(many.pilots, one.pilots);
    EXPECT_EQ(many.chosen, one.chosen);
    // Other limits have no seconds.
    RenderSettings settings = settings_of(scene, "auto:chains=false,threads=32", 0);
    settings.seconds = {};
    settings.spp = 400;
    const double budget = with_chosen_method(scene, settings).choice->budget;
    settings.integrator = choose_integrator(scene, "auto:chains=false");
    EXPECT_EQ(budget, with_chosen_method(scene, settings).choice->budget);
}

TEST(MethodChoice, PilotsTakeASmallPart) {
    const Scene scene = scene_of_project("cornell.xml", 200, 200);
    for (const double seconds : {0.01, 0.1, 0.5, 2.0, 8.0}) {
        SCOPED_TRACE(seconds);
        const MethodChoice c = choice_of(scene, "auto", seconds);
        EXPECT_DOUBLE_EQ(c.budget, seconds);
        EXPECT_LE(c.pilots, 0.08 * c.budget);
    }
    // With guides and all chains.
    const Scene ring = scene_of_project("ring.xml", 480, 360);
    for (const double seconds : {10.0, 14.0, 30.0}) {
        SCOPED_TRACE(seconds);
        EXPECT_LE(choice_of(ring, "auto", seconds).pilots, 0.08 * seconds);
    }
    // No pilots where they would take longer than that.
    const MethodChoice none = choice_of(scene, "auto", 0.001);
    EXPECT_EQ(none.chosen, "bdpt");
    EXPECT_EQ(none.pilots, 0);
    EXPECT_NE(none.message().find("without pilots"), std::string::npos);
}

/// Specular connections in glass take many times what samples of other scenes do, which nothing tells before the first pilots.
TEST(MethodChoice, CostlyPilotsAreStopped) {
    const Scene scene = build(lantern_room(front_camera(128)));
    for (const double seconds : {1.5, 2.0, 3.0, 8.0}) {
        SCOPED_TRACE(seconds);
        RenderSettings settings = settings_of(scene, "auto", seconds);
        std::string first;
        for (const int threads : {1, 3}) {
            settings.threads = threads;
            MethodChoice c = *with_chosen_method(scene, settings).choice;
            EXPECT_GT(c.pilots, 0);
            EXPECT_LE(c.pilots, 0.08 * seconds);
            c.seconds = 0;
            if (first.empty()) first = c.to_json().dump();
            EXPECT_EQ(c.to_json().dump(), first);
            // What renders although its pilots were stopped is the method that renders without pilots.
            if (c.candidates.front().images == 0) {
                EXPECT_EQ(c.chosen, "bdpt");
            }
        }
    }
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
    // Before the first pilots, the rendering is not taken to be longer than that of a simple scene.
    settings.error = 2;
    EXPECT_EQ(with_chosen_method(scene, settings).choice->pilots, 0);
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

/// What `auto` knows of methods is what they are, whatever their parameters.
TEST(Candidates, AreWhatTheirIntegratorsAre) {
    for (const CandidateMethod& m : kCandidateMethods) {
        SCOPED_TRACE(m.name);
        EXPECT_GT(typical_sample_seconds(m.name), 0);
        for (const std::string guide : {"off", "on"}) {
            const std::string method = fmt::format("{}:guide={}", m.name, guide);
            const auto integrator = make_integrator(IntegratorSpec::parse(method));
            EXPECT_EQ(candidate_method(method).name, m.name);
            EXPECT_EQ(candidate_method(method).has_chains, integrator->error_groups() > 0);
            const std::string name = m.name;
            EXPECT_EQ(candidate_method(method).reuses_light_paths,
                      name == "vcm" || name == "upg+bdpt" || name == "upg");
        }
    }
    EXPECT_THROW(candidate_method("sppm"), std::logic_error);
    // Pilots can judge the guide of each method that has one.
    for (const IntegratorEntry& entry : integrator_registry())
        if (entry.info.has_param("guide")) {
            EXPECT_EQ(candidate_method(entry.info.name).name, std::string(entry.info.name));
        }
}

/// What is rendered without a word about the method, also where there is little to render, or no light.
TEST(MethodChoice, IsTheDefaultOfScenesWithoutIntegrator) {
    for (const int size : {1, 2, 40})
        for (const std::string& light : {std::string(), area_lamp()})
            for (const uint64_t spp : {1u, 3u, 2000u}) {
                const Scene scene = build(front_camera(size) + room() + light);
                RenderRequest request;
                request.spp = spp;
                request.threads = 1;
                Renderer r(scene, settings_of(request, scene));
                ASSERT_TRUE(r.settings().choice);
                EXPECT_EQ(r.settings().choice->message().find("nan"), std::string::npos);
                // Pilots that meet no light say nothing.
                if (light.empty()) {
                    EXPECT_EQ(r.settings().integrator.name, "bdpt");
                }
                r.run(
                    {.spp = 1, .seconds = {}, .error = {}}, [](const Progress&) {},
                    std::atomic<bool>{false});
                EXPECT_EQ(r.film().passes(), 1u);
            }
}

/// Those of which there was no time for pilots are told, too.
TEST(MethodChoice, TellsOfAllCandidates) {
    const Scene scene = scene_of_project("cornell.xml", 200, 200);
    const MethodChoice c = choice_of(scene, "auto", 0.7);
    EXPECT_EQ(methods_of(c),
              (std::vector<std::string>{"bdpt", "mlt", "mmlt", "path", "pcbpt", "upg+bdpt"}));
    EXPECT_GT(c.candidates.front().images, 0);
    EXPECT_EQ(c.candidates.back().images, 0);
    EXPECT_EQ(c.candidates.back().pixels, 0);
}

TEST(MethodChoice, ParametersAreThoseOfTheMethod) {
    const Scene scene = build(front_camera(16) + room() + area_lamp());
    const MethodChoice c = choice_of(scene, "auto:max_depth=4,chains=false");
    const IntegratorSpec spec = IntegratorSpec::parse(c.chosen);
    EXPECT_EQ(spec.params.at("max_depth"), "4");
    EXPECT_EQ(spec.params.size(), 1u);
    EXPECT_EQ(c.asked, "auto:chains=false,consistent=false,max_depth=4,threads=1");
    EXPECT_NE(error_of([&] { choice_of(scene, "auto:depth=4"); }).find("max_depth"),
              std::string::npos);
    EXPECT_NE(error_of([&] { choice_of(scene, "auto:chains=perhaps"); }).find("true or false"),
              std::string::npos);
    EXPECT_NE(error_of([&] { choice_of(scene, "auto:threads=0"); }).find("threads"),
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

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

/// The images of the passes of a rendering, in grey.
std::vector<std::vector<float>> passes_of(const Scene& scene, RenderSettings settings) {
    settings.spp = kPilotPasses;
    Renderer r(scene, settings);
    std::vector<std::vector<float>> images;
    std::vector<float> before(scene.film().pixel_count());
    r.run(
        settings,
        [&](const Progress&) {
            auto& image = images.emplace_back();
            for (size_t i = 0; i < before.size(); ++i) {
                const PixelMoments& m = r.film().moments()[i];
                const auto sum = float((m.sum[0] + m.sum[1] + m.sum[2]) / 3);
                image.push_back(sum - before[i]);
                before[i] = sum;
            }
        },
        std::atomic<bool>{false});
    return images;
}

/// A choice by the passes that it steers would prefer methods whose samples happen to be dark: pilots have others.
TEST(Pilots, HaveNoPassOfTheRendering) {
    const Scene scene = scene_of_project("ring.xml", 24, 18);
    const std::atomic<bool> never{false};
    for (const SamplerKind sampler : {SamplerKind::Sobol, SamplerKind::Independent})
        for (const char* method : {"path", "bdpt", "pcbpt", "mlt:groups=4,chains=16"}) {
            SCOPED_TRACE(method);
            RenderSettings settings = settings_of(scene, method, 1);
            settings.sampler = sampler;
            settings.seed = 7;
            const auto own = passes_of(scene, settings);
            const MethodPilot pilot = render_pilot(scene, settings, 0, kNoLimit, never);
            std::vector<std::vector<float>> all = pilot.images.images;
            ASSERT_GE(all.size(), size_t(2 * kPilotReplicates));
            // The comparison can find equal ones.
            RenderSettings same = settings;
            same.seed = pilot_seed(settings.seed, PilotUse::Choice, 0);
            const auto first = passes_of(scene, same);
            EXPECT_NE(std::find(first.begin(), first.end(), all[0]), first.end());
            // Nor are any of them equal.
            all.insert(all.end(), own.begin(), own.end());
            std::sort(all.begin(), all.end());
            EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end());
        }
}

/// A pilot that would take too much is stopped, and books what it was allowed to take.
TEST(Pilots, AreStopped) {
    const Scene scene = build(lantern_room(front_camera(24)));
    const std::atomic<bool> never{false};
    for (const char* method : {"path", "upg+bdpt", "mlt:groups=2,chains=16"}) {
        SCOPED_TRACE(method);
        RenderSettings settings = settings_of(scene, method, 1);
        const MethodPilot whole = render_pilot(scene, settings, 0, kNoLimit, never);
        ASSERT_FALSE(whole.is_stopped);
        const double passes = kPilotPasses * whole.pass_seconds + whole.start_seconds;
        EXPECT_NEAR(whole.all_seconds, whole.prepared_seconds + kPilotReplicates * passes,
                    0.01 * whole.all_seconds);
        // Of all, of what the first one shows, and of what precedes its passes.
        for (const double share : {0.9, 0.5, 0.02}) {
            const double most = share * whole.all_seconds;
            std::optional<double> taken;
            for (const int threads : {1, 3}) {
                settings.threads = threads;
                const MethodPilot pilot = render_pilot(scene, settings, 0, most, never);
                EXPECT_TRUE(pilot.is_stopped);
                EXPECT_TRUE(pilot.images.images.empty());
                EXPECT_LE(pilot.all_seconds, most);
                if (!taken) taken = pilot.all_seconds;
                EXPECT_EQ(pilot.all_seconds, *taken);
            }
        }
        EXPECT_EQ(render_pilot(scene, settings, 0, 1.5 * whole.all_seconds, never).images.images,
                  whole.images.images);
    }
}

/// A film of pilots has few light paths, so that gathers find few pairs there. What a sample takes is predicted for the film of
/// the rendering.
TEST(Pilots, PredictTheCostOfPairs) {
    const Scene scene = build(front_camera(160) + room() + area_lamp());
    const RenderSettings settings = settings_of(scene, "auto:chains=false", 15);
    const std::atomic<bool> never{false};
    const auto choice = with_chosen_method(scene, settings, never).choice;
    const auto candidate = std::find_if(choice->candidates.begin(), choice->candidates.end(),
                                        [](const auto& c) { return c.method == "upg+bdpt"; });
    ASSERT_NE(candidate, choice->candidates.end());
    ASSERT_GT(candidate->images, 0);
    ASSERT_LT(4 * candidate->pixels, int(scene.film().pixel_count()));
    const MethodPilot whole =
        render_pilot(scene, settings_of(scene, "upg+bdpt", 1), 0, kNoLimit, never);
    const double real = whole.pass_seconds / double(scene.film().pixel_count());
    EXPECT_NEAR(candidate->sample_seconds, real, 0.2 * real);
}

/// What is decided about specular connections, and what the first pass costs more.
TEST(Pilots, BookWhatPrecedesTheFirstPass) {
    const Scene scene = build(lantern_room(front_camera(24)));
    const std::atomic<bool> never{false};
    for (const char* method : {"path", "bdpt", "upg+bdpt"}) {
        SCOPED_TRACE(method);
        const MethodPilot pilot =
            render_pilot(scene, settings_of(scene, method, 1), 0, kNoLimit, never);
        EXPECT_GT(pilot.prepared_seconds, 0);
        // Joins have Russian roulette once there is an image; specular connections have it from the start.
        if (std::string(method) != "path") {
            EXPECT_GT(pilot.start_seconds, 0);
        }
    }
    const Scene plain = build(front_camera(24) + room() + area_lamp());
    EXPECT_EQ(
        render_pilot(plain, settings_of(plain, "path", 1), 0, kNoLimit, never).prepared_seconds, 0);
}

/// A rendering with a guide decides with it about specular connections, and so do its pilots.
TEST(Pilots, DecideOnSpecularConnectionsWithTheirGuides) {
    const Scene scene = build(lantern_room(front_camera(24)));
    const std::atomic<bool> never{false};
    RenderSettings settings = settings_of(scene, "path", 1);
    const auto shared = std::make_shared<SharedByPilots>();
    settings.integrator.shared_by_pilots = shared;
    render_pilot(scene, settings, 0, kNoLimit, never);
    settings.integrator.params["guide"] = "on";
    settings.integrator.guide = std::make_shared<const Guide>(
        LearnedGuide(scene, choose_integrator(scene, "path:guide_walks=20000"), 1, 2).guide());
    render_pilot(scene, settings, 1, kNoLimit, never);
    ASSERT_EQ(shared->specular.size(), 2u);
    EXPECT_NE(shared->specular.at("path").luminance,
              shared->specular.at("path:guide=on").luminance);
}

/// Passes of a Sobol' sequence have less noise together than as many independent ones. Pilots see a part of that, since they
/// have few passes.
TEST(Pilots, PredictWhatTheSamplerGains) {
    const Scene scene = scene_of_project("cornell.xml", 64, 64);
    constexpr uint64_t kSpp = 64;
    const std::atomic<bool> never{false};
    RenderSettings settings = settings_of(scene, "path", 1);
    settings.seconds = {};
    const auto predicted = [&] {
        PilotImages pilot = render_pilot(scene, settings, 0, kNoLimit, never).images;
        pilot.horizon = double(kSpp);
        return score_pilots({&pilot, 1}, 64, 64).front().error();
    };
    const auto measured = [&] {
        std::vector<Moments> pixels(64 * 64);
        for (uint64_t seed = 0; seed < 6; ++seed) {
            RenderSettings s = settings;
            s.seed = seed;
            s.spp = kSpp;
            Renderer r(scene, s);
            r.run(
                s, [](const Progress&) {}, never);
            const std::vector<Rgb> image = r.film().image();
            for (size_t i = 0; i < image.size(); ++i)
                pixels[i].add(double(image[i].r + image[i].g + image[i].b) / 3);
        }
        double mean = 0, error = 0;
        for (const Moments& m : pixels) mean += m.mean() / double(pixels.size());
        for (const Moments& m : pixels)
            error += m.variance() / (sqr(m.mean()) + 0.01 * sqr(mean)) / double(pixels.size());
        return error;
    };
    settings.sampler = SamplerKind::Independent;
    const double independent = predicted(), independent_error = measured();
    settings.sampler = SamplerKind::Sobol;
    const double sobol = predicted(), sobol_error = measured();
    EXPECT_NEAR(independent, independent_error, 0.4 * independent_error);
    const double gain = sobol_error / independent_error;
    EXPECT_LT(gain, 0.7);
    EXPECT_NEAR(sobol / independent, gain, 0.3 * gain);
}

/// Pilots end at once.
TEST(MethodChoice, CanBeInterrupted) {
    const Scene scene = scene_of_project("ring.xml", 480, 360);
    std::atomic<bool> drop{true};
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_THROW(with_chosen_method(scene, settings_of(scene, "auto", 1e5), drop), PassDropped);
    drop = false;
    std::thread interrupt([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        drop = true;
    });
    EXPECT_THROW(with_chosen_method(scene, settings_of(scene, "auto", 1e5), drop), PassDropped);
    interrupt.join();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
}

TEST(MethodChoice, MessageComparesWhatIsComparable) {
    MethodChoice c;
    c.chosen = "path";
    c.candidates = {{.method = "path", .pixels = 768, .images = 12, .noise = 0.1},
                    {.method = "bdpt", .pixels = 768, .images = 12, .noise = 0.2}};
    EXPECT_NE(c.message().find("0.5 of the time of bdpt"), std::string::npos);
    c.candidates[1].pixels = 3072;
    EXPECT_EQ(c.message().find("of the time"), std::string::npos);
    c.candidates[1].pixels = 768;
    c.candidates[0].noise = c.candidates[1].noise = 0;  // a black scene
    EXPECT_EQ(c.message(), "auto: path (pilots: 0.0 s)");
}

}  // namespace
}  // namespace etendue::test
