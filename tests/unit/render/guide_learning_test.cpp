// What guides learn in small rooms: behind mirrors and panes, from lamps in shades, and where nothing can be gained.

#include <atomic>
#include <map>

#include <gtest/gtest.h>

#include "pathspace/walk.h"
#include "random_guide.h"
#include "render/learned_guide.h"
#include "render/renderer.h"
#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr int kSize = 64;

LearnedGuide learn(const Scene& scene, const std::string& method) {
    return {scene, IntegratorSpec::parse(method), 1, 2};
}

/// A lamp of the same power as area_lamp() behind the room, whose light nobody sees.
std::string useless_lamp() {
    return test::rectangle("<scale value=\"0.25\"/><rotate y=\"1\" angle=\"180\"/>"
                           "<translate z=\"-3\"/>",
                           test::diffuse("0.5,0.5,0.5") +
                               "<emitter type=\"area\"><rgb name=\"radiance\" "
                               "value=\"12,11,9\"/></emitter>");
}

/// In front of a camera: a pane that covers all of the image.
std::string pane() {
    return test::rectangle("<scale value=\"3\"/><translate z=\"2\"/>",
                           "<bsdf type=\"thindielectric\"/>");
}

/// The room as front_camera() sees it, in a mirror.
std::string mirrored_camera() {
    return test::sensor("3.4,0,3.4", "0,0,3.4", kSize) +
           test::rectangle("<scale value=\"3\"/><rotate y=\"1\" angle=\"135\"/>"
                           "<translate z=\"3.4\"/>",
                           "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>");
}

/// Emission is learned by what the lens sees, by whatever delta events.
TEST(LearnedEmission, IsThatOfWhatIsSeenInMirrorsAndPanes) {
    const std::string lit = test::room() + test::area_lamp() + useless_lamp();
    const auto learned = [&](const std::string& camera) {
        const Scene scene = test::build(camera + lit);
        const LearnedGuide guide = learn(scene, "light");
        EXPECT_TRUE(guide.guide().chooses_emitters());
        const auto choices = guide.emitter_choices(1);
        return std::pair(choices.empty() ? 0.0f : choices[0].learned, guide.guide().emission_gain);
    };
    const auto [direct, direct_gain] = learned(test::front_camera(kSize));
    EXPECT_GT(direct, 0.8f);
    for (const std::string& camera : {test::front_camera(kSize) + pane(),
                                      test::lens_camera(kSize) + pane(), mirrored_camera()}) {
        const auto [choice, gain] = learned(camera);
        EXPECT_NEAR(choice, direct, 0.05f);
        EXPECT_NEAR(gain, direct_gain, 0.15f);
    }
}

/// Next events select the lamp that shines on the place, not one as strong behind a wall.
TEST(LearnedLights, AreThoseThatShineOnThePlace) {
    const Scene scene =
        test::build(test::front_camera(kSize) + test::room() + test::area_lamp() + useless_lamp());
    for (const char* method : {"path", "bdpt"}) {
        const LearnedGuide learned = learn(scene, method);
        EXPECT_GT(learned.guide().lights.gain(), 0.3f) << method;
        const GuidedPlace back = learned.at_pixel(kSize / 2, kSize / 2);
        ASSERT_FALSE(back.lights.empty()) << method;
        EXPECT_GT(back.lights[0].learned, 0.8f) << method;
        EXPECT_LT(back.lights[0].by_power, 0.6f) << method;
    }
    EXPECT_TRUE(learn(scene, "light").guide().lights.is_empty());
}

/// A floor under twenty spots, each of which shines on its own part: no walk learns a direction.
std::string floor_under_spots() {
    std::string scene = test::sensor("0,6,0.1", "0,0,0", kSize, "90") +
                        test::rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"5\"/>",
                                        test::diffuse("0.5,0.5,0.5"));
    for (int i = 0; i < 20; ++i) {
        const std::string at = std::to_string(i % 5 * 2 - 4) + ",",
                          z = std::to_string(i / 5 * 2 - 3);
        scene += "<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"30\"/><transform "
                 "name=\"to_world\"><lookat origin=\"" +
                 at + "1," + z + "\" target=\"" + at + "0," + z +
                 "\" up=\"1,0,0\"/></transform></emitter>";
    }
    return scene;
}

TEST(LearnedLights, NeedNoDirections) {
    const Scene scene = test::build(floor_under_spots());
    const LearnedGuide learned = learn(scene, "path");
    EXPECT_TRUE(learned.guide().surfaces.is_empty());
    EXPECT_GT(learned.guide().lights.gain(), 1);
    const GuidedPlace below = learned.at_pixel(kSize / 2, kSize / 2);
    ASSERT_FALSE(below.lights.empty());
    EXPECT_GT(below.lights[0].learned, 0.15f);
    EXPECT_EQ(LearnedGuide::mean_shares(learned.shares())[0], 0);
}

/// They are learned from more walks as the image has more samples, whether or not directions gain.
TEST(LearnedLights, AreLearnedAgain) {
    const Scene scene = test::build(floor_under_spots());
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse("path:guide=on,guide_walks=3000");
    settings.threads = 2;
    const auto gain_after = [&](uint64_t passes) {
        settings.spp = passes;
        Renderer r(scene, settings);
        r.run([](const Progress&) {}, std::atomic<bool>{false});
        for (const auto& [name, value] : r.integrator().figures())
            if (name == "guide_gain_lights") return value;
        return 0.0;
    };
    EXPECT_NE(gain_after(1), gain_after(17));
}

std::map<std::string, double> figures_after(const Scene& scene, const std::string& integrator) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.threads = 2;
    settings.spp = 1;
    Renderer r(scene, settings);
    r.run([](const Progress&) {}, std::atomic<bool>{false});
    std::map<std::string, double> figures;
    for (const auto& [name, value] : r.integrator().figures()) figures[name] = value;
    return figures;
}

TEST(LearnedLights, NeedNoGuidedWalks) {
    const Scene scene = test::build(floor_under_spots());
    for (const std::string method :
         {"path", "bdpt", "vcm", "upg+bdpt", "pcbpt", "path:guide=auto", "bdpt:guide=auto"}) {
        const auto figures = figures_after(scene, method);
        ASSERT_TRUE(figures.count("guide_gain_lights")) << method;
        EXPECT_GT(figures.at("guide_gain_lights"), 1) << method;
        EXPECT_EQ(figures.at("guided"), 0) << method;
        const std::string by_power =
            method + (method.find(':') == std::string::npos ? ":" : ",") + "lights=power";
        const auto without = figures_after(scene, by_power);
        EXPECT_TRUE(!without.count("guide_gain_lights") || without.at("guide_gain_lights") == 0)
            << by_power;
    }
    for (const char* method :
         {"pcbpt:direct=stored", "vcm:connections=false", "bdpt:guide=on,lights=power"}) {
        const auto figures = figures_after(scene, method);
        EXPECT_TRUE(!figures.count("guide_gain_lights") || figures.at("guide_gain_lights") == 0)
            << method;
    }
    for (const char* method : {"light:lights=power", "upg:lights=power"})
        EXPECT_THROW(figures_after(scene, method), std::runtime_error) << method;
}

std::vector<Rgb> image_of(const Scene& scene, const std::string& integrator, int threads) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.threads = threads;
    settings.spp = 2;
    Renderer r(scene, settings);
    r.run([](const Progress&) {}, std::atomic<bool>{false});
    return r.film().image();
}

bool is_same(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    for (size_t i = 0; i < a.size(); ++i)
        for (int c = 0; c < 3; ++c)
            if (a[i][c] != b[i][c]) return false;
    return a.size() == b.size();
}

TEST(LearnedLights, DoNotDependOnThreads) {
    const Scene scene = test::build(floor_under_spots());
    for (const char* method : {"path", "bdpt"}) {
        EXPECT_TRUE(is_same(image_of(scene, method, 1), image_of(scene, method, 3))) << method;
        EXPECT_FALSE(is_same(image_of(scene, method, 1),
                             image_of(scene, std::string(method) + ":lights=power", 1)))
            << method;
    }
}

/// One emitter, and two whose light arrives everywhere alike.
TEST(LearnedLights, ChangeNothingWhereNothingIsGained) {
    const std::string room = test::front_camera(kSize) + test::room() + test::area_lamp();
    const Scene one = test::build(room);
    for (const char* method : {"path", "bdpt"}) {
        const std::string by_power = std::string(method) + ":lights=power";
        EXPECT_FALSE(figures_after(one, method).count("guide_gain_lights")) << method;
        EXPECT_TRUE(is_same(image_of(one, method, 1), image_of(one, by_power, 1))) << method;
    }
    const std::string above = "<emitter type=\"point\"><point name=\"position\" "
                              "value=\"0,0.5,0\"/></emitter>";
    const Scene two = test::build(test::front_camera(kSize) + test::room() + above + above);
    EXPECT_EQ(figures_after(two, "path").at("guide_gain_lights"), 0);
    EXPECT_TRUE(is_same(image_of(two, "path", 1), image_of(two, "path:lights=power", 1)));
}

TEST(LearnedLights, AreKeptWithAllThatIsLearned) {
    const Scene scene = test::build(floor_under_spots());
    RenderSettings settings;
    settings.spp = 1;
    for (const char* method : {"path", "bdpt", "vcm", "upg+bdpt", "pcbpt"}) {
        settings.integrator = IntegratorSpec::parse(method);
        Renderer r(scene, settings);
        r.run([](const Progress&) {}, std::atomic<bool>{false});
        LearnedState saved;
        r.integrator().save(saved);
        LearnedState read(saved.bytes());
        const auto again = make_integrator(settings.integrator);
        again->load(read);
        const uint64_t light_paths = again->light_paths(scene);
        const Guide *before = r.integrator().counts(scene, light_paths).guide,
                    *after = again->counts(scene, light_paths).guide;
        ASSERT_TRUE(before && after) << method;
        EXPECT_EQ(after->lights.gain(), before->lights.gain());
        for (const auto& e : scene.emitters())
            EXPECT_EQ(after->lights_at({}, {0, 1, 0})->pmf(e->index, 0.1f),
                      before->lights_at({}, {0, 1, 0})->pmf(e->index, 0.1f));
    }
}

/// Light walks learn the way to what the lens sees, not to the pane before it.
TEST(LearnedImportance, LeavesOutTheWayToTheLens) {
    const Scene scene = test::build(test::front_camera(kSize) + pane() + test::room() +
                                    test::area_lamp() + useless_lamp());
    const GuidedPlace back = learn(scene, "bdpt").at_pixel(kSize / 2, kSize / 2);
    ASSERT_EQ(back.delta_events, 1);
    for (const GuidedPlace::Lobe& lobe : back.light.lobes())
        EXPECT_FALSE(lobe.direction.z > 0.98f && lobe.kappa > 50 && lobe.share > 0.2f)
            << lobe.kappa << ", " << lobe.share;
}

/// The distance of a lobe is that of the lamp, and not that of the pane through which it is seen.
TEST(LearnedLobes, HaveTheDistanceOfALampBehindAPane) {
    const Scene scene = test::build(
        test::sensor("0,1.5,0.5", "0,0,0", kSize, "20") +
        test::rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"4\"/>",
                        test::diffuse("0.5,0.5,0.5")) +
        test::rectangle("<scale value=\"3\"/><translate z=\"-0.5\"/>",
                        "<bsdf type=\"thindielectric\"/>") +
        test::sphere(
            "0,1,-2.5", "0.15",
            "<emitter type=\"area\"><rgb name=\"radiance\" value=\"40,40,40\"/></emitter>"));
    const GuidedPlace place = learn(scene, "path").at_pixel(kSize / 2, kSize / 2);
    EXPECT_GT(place.eye.share, 0.2f);
    const auto lobes = place.eye.lobes();
    ASSERT_FALSE(lobes.empty());
    const float distance = length(Vec3{0, 1, -2.5f} - place.cell_center);
    EXPECT_NEAR(lobes[0].distance, distance, 0.2f * distance);
    EXPECT_GT(dot(lobes[0].direction, normalize(Vec3{0, 1, -2.5f} - place.p)), 0.999f);
    EXPECT_GT(lobes[0].kappa, 300);
}

/// Light reaches a frosted panel on one side, and the lens sees the other.
TEST(LearnedEmission, KnowsThatLightPassesThroughSheets) {
    const Scene scene = test::build(
        test::front_camera(kSize) +
        test::rectangle("<scale value=\"2\"/>",
                        "<bsdf type=\"diffusetransmission\"><rgb name=\"transmittance\" "
                        "value=\"0.6,0.6,0.6\"/></bsdf>") +
        test::rectangle(
            "<scale value=\"0.25\"/><translate z=\"-1\"/>",
            "<emitter type=\"area\"><rgb name=\"radiance\" value=\"12,11,9\"/></emitter>") +
        useless_lamp());
    const LearnedGuide learned = learn(scene, "light");
    ASSERT_TRUE(learned.guide().chooses_emitters());
    EXPECT_GT(learned.emitter_choices(1)[0].learned, 0.8f);
}

/// Where the walks of a training end at their first vertex, as most do outdoors, direct light is still learned.
TEST(LearnedLobes, AreThoseOfDirectLightInTheOpen) {
    const Scene scene = test::build(
        test::front_camera(kSize) +
        test::rectangle(
            "<rotate x=\"1\" angle=\"-90\"/><scale value=\"2\"/><translate y=\"-0.5\"/>",
            test::diffuse("0.5,0.5,0.5")) +
        "<emitter type=\"constant\"/>");
    const LearnedGuide learned = learn(scene, "path");
    EXPECT_GT(learned.guide().surfaces.cells().size(), 4u);
}

/// Guided directions replace those of smooth lobes alone, so that delta events beside them make nothing of a guide better. In
/// a cube of glowing walls, the light is the same from everywhere.
TEST(LearnedShares, AreThoseOfDirectionsWithoutDeltaEvents) {
    const auto learned = [](const std::string& bsdf) {
        const Scene scene =
            test::build(test::sensor("0,0,0.5", "0,0,-1", kSize, "70") +
                        "<shape type=\"cube\"><boolean name=\"flip_normals\" value=\"true\"/>"
                        "<bsdf type=\"twosided\">" +
                        bsdf + "</bsdf><emitter type=\"area\"/></shape>");
        const LearnedGuide guide = learn(scene, "path:guide_walks=40000");
        return std::pair(guide.guide().surfaces.gain(TransportMode::Radiance),
                         LearnedGuide::mean_shares(guide.shares())[0]);
    };
    const std::string diffuse = test::diffuse("0.5,0.5,0.5");
    for (const std::string& bsdf :
         {diffuse, test::kPlastic,
          "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.5\"/>" + diffuse +
              "<bsdf type=\"conductor\"/></bsdf>"}) {
        const auto [gain, share] = learned(bsdf);
        EXPECT_LT(gain, 0.02f) << bsdf;
        EXPECT_LT(share, 0.1) << bsdf;
    }
}

/// A quarter of the light paths: each is joined to four eye paths, and its splats have four times the factor. Splats have
/// smaller weights then.
TEST(LearnedContributions, AreThoseOfTheLightPathsOfAPass) {
    const Scene scene = test::build(test::front_camera(kSize) + test::room() + test::area_lamp());
    const float all = learn(scene, "bdpt").guide().light_contribution,
                quarter = learn(scene, "bdpt:light_paths=1024").guide().light_contribution;
    EXPECT_GT(quarter, 1.5f * all);
    EXPECT_LT(quarter, 4 * all);
}

/// Chains make no direct light. Roulette of their eye walks compares what may come with the light that they make at z_1.
TEST(LearnedContributions, OfChainsAreWithoutDirectLight) {
    const std::string dark = test::diffuse("0.25,0.25,0.25");
    const Scene scene =
        test::build(test::front_camera(kSize) + test::area_lamp() +
                    test::rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>", dark) +
                    test::rectangle("<translate z=\"-1\"/>", dark) +
                    test::rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>", dark));
    const Film film(scene.film(), scene.filter());
    // Of the mean of a pixel, by what is expected at z_1.
    const auto expected = [&](const std::string& method) {
        const LearnedGuide learned = learn(scene, method);
        const TechniqueCounts counts;
        RenderStats stats;
        const WalkContext walk{scene, counts, stats, {2, 2}};
        SubPath z;
        double sum = 0;
        const uint64_t pixels = scene.film().pixel_count();
        for (uint64_t i = 0; i < pixels; ++i) {
            Sampler sampler(SamplerKind::Independent, 3);
            sampler.start(0, i);
            trace_eye_path(walk, film, i, sampler, z);
            if (z.size() < 2) continue;
            const WalkContribution c = expected_contribution(
                z[1], learned.guide().surfaces.cell(z[1].p), TransportMode::Radiance);
            sum += double(luminance(z[1].beta) * std::max(0.0f, c.here)) / double(pixels);
        }
        return sum;
    };
    const auto rendered = [&](int shortest) {
        const test::Tiles image =
            test::render_tiles(scene, "bdpt", {.passes = 32, .tiles = 1, .shortest = shortest});
        return double(luminance(Rgb(float(image.values[0].mean()), float(image.values[1].mean()),
                                    float(image.values[2].mean()))));
    };
    const double all = rendered(2), indirect = rendered(3);
    ASSERT_LT(indirect, 0.2 * all);
    // Light walks splat the rest of either.
    const double with_direct = expected("bdpt"), without = expected("pssmlt");
    EXPECT_GT(with_direct, 0.3 * all);
    EXPECT_GT(without, 0.3 * indirect);
    EXPECT_LT(without, indirect);
    // Light walks, too, have what chains splat.
    EXPECT_LT(learn(scene, "pssmlt").guide().light_contribution,
              0.8f * learn(scene, "bdpt").guide().light_contribution);
}

/// What is shown of a guide is what a rendering learns before its first pass.
TEST(LearnedGuides, AreThoseOfARendering) {
    constexpr uint64_t kSeed = 3;
    // With a filter that is wider than a pixel, the film points of a pass depend on the film's mode.
    const Scene scene = test::build(test::with_filter(test::front_camera(kSize), "gaussian") +
                                    test::room() + test::area_lamp());
    for (const auto& [method, mode] :
         {std::pair("bdpt:guide=on,guide_walks=20000", FilterMode::Spread),
          {"bdpt:guide=on,guide_walks=20000", FilterMode::Sample},
          {"path:guide=on,guide_walks=20000", FilterMode::Spread},
          {"pssmlt:guide=on,guide_walks=20000", FilterMode::Spread},
          {"mlt:guide=on,guide_walks=20000", FilterMode::Spread}}) {
        RenderSettings settings;
        settings.filter_mode = mode;
        settings.integrator = IntegratorSpec::parse(method);
        settings.sampler = SamplerKind::Sobol;
        settings.seed = kSeed;
        settings.spp = 1;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>{false});
        std::map<std::string, double> figures;
        for (const auto& [name, value] : renderer.integrator().figures()) figures[name] = value;
        const LearnedGuide learned(scene, settings.integrator, kSeed, 2);
        const GuideTree& surfaces = learned.guide().surfaces;
        EXPECT_EQ(figures["guide_cells"], double(surfaces.cells().size())) << method;
        EXPECT_EQ(figures["guide_gain_eye"], double(surfaces.gain(TransportMode::Radiance)))
            << method;
        EXPECT_EQ(figures["guide_gain_light"], double(surfaces.gain(TransportMode::Importance)))
            << method;
        EXPECT_EQ(figures["guide_gain_emission"], double(learned.guide().emission_gain)) << method;
    }
}

std::map<std::string, double> figures_of(const Scene& scene, const IntegratorSpec& integrator) {
    RenderSettings settings;
    settings.integrator = integrator;
    settings.spp = 1;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>{false});
    std::map<std::string, double> figures;
    for (const auto& [name, value] : renderer.integrator().figures()) figures[name] = value;
    return figures;
}

/// A guide that is given, as to the pilots of `auto`, guides what it guides in the rendering for which it was learned.
TEST(LearnedGuides, AreUsedAsTheyAreGiven) {
    const Scene scene = test::build(test::front_camera(16) + test::room() + test::area_lamp());
    Guide guide = learn(scene, "bdpt:guide_walks=4000").guide();
    for (const bool at_surfaces : {false, true})
        for (const char* method : {"bdpt:guide=on", "path:guide=on", "upg+bdpt:guide=on"}) {
            guide.uses_surfaces = at_surfaces;
            IntegratorSpec spec = IntegratorSpec::parse(method);
            spec.guide = std::make_shared<const Guide>(guide);
            EXPECT_EQ(figures_of(scene, spec)["guided_surfaces"], double(at_surfaces)) << method;
        }
}

/// States of `mmlt` have no roulette, not even that of a guide. With this one, it would end nine of ten walks at each vertex.
TEST(LearnedGuides, EndNoStatesOfMmlt) {
    const Scene scene = test::build(test::front_camera(16) + test::room() + test::area_lamp());
    Guide guide = test::random_guide(scene, 20, 1);
    guide.uses_surfaces = false;
    GuideCell cell = guide.surfaces.cells()[0];
    for (GuideCell::Field& field : cell.fields) field.contribution.fill({1, 1e-6f});
    guide.surfaces = GuideTree(cell);
    const auto zero = [&](const std::string& roulette) {
        IntegratorSpec spec = IntegratorSpec::parse(
            "mmlt:groups=2,chains=16,p_large=1,mutations=32,max_depth=5,guide=on,guide_roulette=" +
            roulette);
        spec.guide = std::make_shared<const Guide>(guide);
        return figures_of(scene, spec)["large_zero"];
    };
    const double without = zero("false");
    EXPECT_LT(without, 0.8);
    EXPECT_NEAR(zero("true"), without, 0.1);
}

/// All methods that have the parameter, chains among them.
TEST(LearnedGuides, ExistForEachMethodThatHasOne) {
    const Scene scene = test::build(test::front_camera(8) + test::room() + test::area_lamp());
    int methods = 0;
    for (const IntegratorEntry& entry : integrator_registry()) {
        const std::vector<ParamInfo>& params = entry.info.params;
        if (std::none_of(params.begin(), params.end(),
                         [](const ParamInfo& p) { return std::string(p.name) == "guide"; }))
            continue;
        ++methods;
        EXPECT_NO_THROW(learn(scene, std::string(entry.info.name) + ":guide_walks=1000"))
            << entry.info.name;
    }
    EXPECT_GE(methods, 10);
}

std::vector<float> numbers_of(const GuideCell& cell) {
    std::vector<float> all;
    for (const GuideCell::Field& field : cell.fields) {
        for (int k = 0; k < field.mixture.size(); ++k) {
            const GuideMixture::Lobe l = field.mixture.lobe(k);
            all.insert(all.end(), {l.mean.x, l.mean.y, l.mean.z, l.inv_r, l.kappa, l.weight});
        }
        all.insert(all.end(), field.training_share.begin(), field.training_share.end());
    }
    return all;
}

/// Most of the light of its lamp at the open front is lost.
std::string room_with_lamp_at_front() {
    return test::front_camera(kSize) + test::room() +
           "<emitter type=\"point\"><point name=\"position\" value=\"0,0,1.5\"/></emitter>";
}

float most_emission_share(const LearnedGuide& learned) {
    float most = 0;
    for (const GuideCell& cell : learned.guide().emission.cells())
        most = std::max(most, cell.field(TransportMode::Importance).share[0]);
    return most;
}

/// Walks that train have to find the light, whatever share of guided directions pays in a method: methods that join both
/// walks learn from the same walks.
TEST(LearnedGuides, DoNotDependOnTheSharesOfAMethod) {
    const Scene scene = test::build(room_with_lamp_at_front());
    const std::string options = ":guide_walks=20000,guide_roulette=false,max_depth=8,rr_depth=2";
    const LearnedGuide one = learn(scene, "bdpt" + options),
                       other = learn(scene, "upg+bdpt" + options);
    const auto &cells = one.guide().surfaces.cells(), &others = other.guide().surfaces.cells();
    ASSERT_EQ(cells.size(), others.size());
    for (size_t i = 0; i < cells.size(); ++i)
        ASSERT_EQ(numbers_of(cells[i]), numbers_of(others[i])) << i;
    // By its own shares, the second one would have had other walks.
    EXPECT_GT(most_emission_share(one), 0.4f);
    EXPECT_LT(most_emission_share(other), 0.31f);
}

/// Connections find much of the light in a room. Where there are none, as much as before is left to directions.
TEST(LearnedGuides, LeaveToConnectionsWhatTheyFind) {
    const Scene scene = test::build(test::front_camera(kSize) + test::room() + test::area_lamp());
    const auto share = [&](const std::string& method) {
        const LearnedGuide learned =
            learn(scene, method + ":guide_walks=20000,guide_roulette=false,rr_depth=2");
        return LearnedGuide::mean_shares(learned.shares())[0];
    };
    const double of_path = share("path");
    EXPECT_GT(of_path, 0.1);
    EXPECT_LT(share("bdpt"), 0.8 * of_path);
}

/// Where emission alone gains, a method that joins both walks has no guide at surfaces.
TEST(LearnedGuides, AreUsedWhereTheyGain) {
    const Scene scene = test::build(room_with_lamp_at_front());
    const LearnedGuide learned = learn(scene, "bdpt");
    EXPECT_GT(learned.guide().emission_gain, 0.5f);
    EXPECT_FALSE(learned.guide().guides_surfaces());
}

}  // namespace
}  // namespace etendue
