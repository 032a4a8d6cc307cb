// can_make() agrees with the paths that techniques make in renderings.

#include "verify/path_class.h"

#include <map>
#include <set>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// Contributions of a rendering, by class and s.
class ClassObserver final : public ContributionObserver {
public:
    explicit ClassObserver(const Scene& scene) : scene_(scene) {}
    void observe(const Join& join, Rgb, float, const FilmTarget&, const Workspace& paths) override {
        if (join.technique.vertices() > 5) return;
        const SubPath& y = paths.light_side(join.technique);
        const PathClass c = classify(scene_, join, y, paths.z, 0);
        EXPECT_EQ(PathClass::from_key(c.key()), c);
        EXPECT_TRUE(can_make(join.technique, c))
            << "s = " << join.technique.s << ", events " << c.delta_events;
        EXPECT_GT(shortest_edge(scene_, join, y, paths.z), 0);
        made[c].insert(join.technique.s);
    }
    std::map<PathClass, std::set<int>> made;

private:
    const Scene& scene_;
};

std::map<PathClass, std::set<int>> classes_made(const Scene& scene, const std::string& method) {
    ClassObserver observer(scene);
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(method);
    settings.threads = 1;
    settings.spp = 64;
    settings.observer = &observer;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    return observer.made;
}

const std::map<std::string, std::string> kScenes = {
    {"diffuse", front_camera(12) + room() + area_lamp()},
    {"mixed", mixed_room(front_camera(12))},
    {"lens", mixed_room(lens_camera(12))},
    {"point", front_camera(12) + room() + sphere("0,-0.4,0", "0.5", kGlass) +
                  "<emitter type=\"point\"><point name=\"position\" value=\"0.4,0.8,3.6\"/>"
                  "</emitter>"}};

class PathClasses : public ::testing::TestWithParam<const char*> {};

TEST_P(PathClasses, TellWhichTechniquesMakeThem) {
    const Scene scene = build(kScenes.at(GetParam()));
    const TechniqueCounts counts = make_integrator(IntegratorSpec::parse("bdpt"))->counts(scene, 1);
    int complete = 0;
    bool has_delta = false;
    for (const auto& [c, s] : classes_made(scene, "bdpt:max_depth=4,roulette=0")) {
        has_delta |= c.delta_events != 0;
        std::set<int> possible;
        for (const Technique& q : techniques_of_length(c.edges))
            if (counts.of(q) > 0 && can_make(q, c)) possible.insert(q.s);
        complete += s == possible;  // rare ones are not met in a short rendering
    }
    EXPECT_GE(complete, 4);
    EXPECT_EQ(has_delta, GetParam() != std::string("diffuse"));
    for (const char* method : {"path:max_depth=4", "light:max_depth=4"}) {
        const TechniqueCounts own =
            make_integrator(IntegratorSpec::parse(method))->counts(scene, 1);
        for (const auto& [c, s] : classes_made(scene, method)) EXPECT_TRUE(can_make(own, c));
    }
}

INSTANTIATE_TEST_SUITE_P(Scenes, PathClasses,
                         ::testing::Values("diffuse", "mixed", "lens", "point"),
                         [](const auto& p) { return std::string(p.param); });

/// Light tracing with a pinhole cannot make paths to mirrors; path tracing cannot make the reflection of a point light.
TEST(PathClass, SaysWhatAMethodCannotMake) {
    const TechniqueCounts path{.hit = 1, .next_event = 1}, light{.splat = 9};
    PathClass c{.edges = 3};
    EXPECT_TRUE(can_make(path, c) && can_make(light, c));
    c.delta_events = 1u << 2;
    EXPECT_TRUE(can_make(path, c));
    EXPECT_FALSE(can_make(light, c));
    c.delta_events = 1u << 1;
    EXPECT_TRUE(can_make(path, c) && can_make(light, c));
    c.delta_emitter = true;
    EXPECT_FALSE(can_make(path, c));
    EXPECT_TRUE(can_make(light, c));
    EXPECT_FALSE(can_make(connection_technique(2, 2), c));
    EXPECT_TRUE(can_make(connection_technique(3, 1), c));
}

/// A technique without light vertices has no last light vertex.
TEST(PathClass, KnowsTechniquesWithoutLightVertices) {
    for (int edges = 1; edges <= PathClass::kMostEdges; ++edges) {
        const Technique hit = connection_technique(0, edges + 1),
                        hit_lens = connection_technique(edges + 1, 0);
        PathClass c{.edges = uint8_t(edges)};
        EXPECT_TRUE(can_make(hit, c) && can_make(hit_lens, c)) << edges;
        EXPECT_EQ(times_made(hit, c, PairRule::Both), 1);
        c.delta_emitter = true;
        EXPECT_FALSE(can_make(hit, c));
        EXPECT_TRUE(can_make(hit_lens, c));
    }
}

TEST(PathClass, HasAName) {
    EXPECT_EQ(to_string(PathClass{.edges = 1}), "LE");
    EXPECT_EQ(to_string(PathClass{.edges = 4, .delta_events = 0b0110}), "LSSDE");
    EXPECT_EQ(to_string(PathClass{.edges = 3, .delta_emitter = true, .delta_events = 0b100}),
              "L*DSE");
}

/// A pair may drop either vertex, unless its neighbour cannot sample it again.
TEST(PathClass, SaysHowOftenAPairMakesAPath) {
    const Technique middle{Strategy::Gather, 3, 3}, at_lens{Strategy::Gather, 4, 2};
    const PathClass diffuse{.edges = 4}, by_mirror{.edges = 4, .delta_events = 1u << 1};
    EXPECT_EQ(times_made(middle, diffuse, PairRule::Both), 2);
    EXPECT_EQ(times_made(middle, diffuse, PairRule::Gloss), 1);
    EXPECT_EQ(times_made(at_lens, diffuse, PairRule::Both), 1);
    EXPECT_EQ(times_made(middle, by_mirror, PairRule::Both), 1);
    EXPECT_EQ(times_made(connection_technique(2, 3), diffuse, PairRule::Both), 1);
}

}  // namespace
}  // namespace etendue::test
