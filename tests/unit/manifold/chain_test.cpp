// Chains of delta events: derivatives of rays through them, and Newton's method.

#include "manifold/seeds.h"

#include <algorithm>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "random.h"
#include "test_scenes.h"

namespace etendue {
namespace {

const SeedPhotons kNoPhotons;
const std::string kMirror = "<bsdf type=\"conductor\"/>";

std::string pane(const std::string& y, const std::string& bsdf = test::kGlass) {
    return test::rectangle(
        "<rotate x=\"1\" angle=\"-90\"/><scale value=\"3\"/><translate y=\"" + y + "\"/>", bsdf);
}
std::string smooth_mesh(const std::string& bsdf, const std::string& transform) {
    return "<shape type=\"obj\"><string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR
           "/tests/scenes/icosahedron.obj\"/><transform name=\"to_world\">" +
           transform + "</transform>" + bsdf + "</shape>";
}

struct ChainCase {
    const char* name;
    std::string objects;
};

/// Objects near the origin, between the floor y = -1 and a lamp above.
std::vector<ChainCase> cases() {
    return {
        {"pane", pane("0")},
        {"two_panes", pane("0") + pane("0.2")},
        {"glass_ball", test::sphere("0,0,0", "0.5", test::kGlass)},
        {"mirror_ball", test::sphere("1.1,0.6,0", "0.5", kMirror)},
        {"smooth_mesh", smooth_mesh(test::kGlass, "<scale value=\"0.6\"/>")},
        {"cylinder",
         "<shape type=\"cylinder\"><point name=\"p0\" x=\"-0.6\" y=\"0\" z=\"0\"/><point "
         "name=\"p1\" x=\"0.6\" y=\"0.1\" z=\"0.2\"/><float name=\"radius\" value=\"0.3\"/>" +
             test::kGlass + "</shape>"},
        {"normal_mapped_pane", pane("0", test::normal_mapped(test::kGlass, "0.7"))},
        {"bump_mapped_pane", pane("0", test::bump_mapped(test::kGlass, "0.5"))},
        {"normal_mapped_ball",
         test::sphere("0,0,0", "0.5", test::normal_mapped(test::kGlass, "0.1"))},
        {"bump_mapped_mirrors",
         test::sphere("1.1,0.6,0", "0.5", test::bump_mapped(kMirror, "0.02", "2")) +
             pane("1.9",
                  "<bsdf type=\"twosided\">" + test::bump_mapped(kMirror, "0.3") + "</bsdf>")},
        {"normal_mapped_mesh",
         smooth_mesh(test::normal_mapped(test::kGlass, "0.2"), "<scale value=\"0.6\"/>")},
        // A glass ball stretched to an ellipsoid.
        {"instance",
         "<shape type=\"shapegroup\" id=\"g\">" + test::sphere("0,0,0", "0.5", test::kGlass) +
             "</shape><shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\">"
             "<rotate z=\"1\" angle=\"20\"/><scale x=\"1.2\" y=\"0.8\" "
             "z=\"1\"/></transform></shape>"},
        {"mirrored_instance",
         "<shape type=\"shapegroup\" id=\"g\">" +
             test::sphere("0,0,0", "0.5", test::bump_mapped(test::kGlass, "0.02", "2")) +
             "</shape><shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\">"
             "<rotate z=\"1\" angle=\"20\"/><scale x=\"-1.2\" y=\"0.8\" "
             "z=\"1\"/></transform></shape>"},
    };
}

Scene scene_of(const std::string& objects) {
    return test::build(
        test::sensor("0,0,5", "0,0,0", 8) +
        test::rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"3\"/><translate y=\"-1\"/>",
                        test::diffuse("0.5,0.5,0.5")) +
        objects +
        "<emitter type=\"point\"><point name=\"position\" value=\"0.1,1.5,-0.2\"/></emitter>");
}

/// A vertex on the floor.
void set_floor_vertex(const Scene& scene, Vec3 at, Vertex& v, ComponentArena& arena) {
    SurfaceHit hit;
    // From below, where no object is.
    ASSERT_TRUE(scene.intersect({at - Vec3{0, 1, 0}, {0, 1, 0}, kInf}, 0.5f, hit));
    v.set_surface(*hit.shape, hit.location, hit.geometry, normalize(Vec3{0.2f, 1, 0.1f}), arena);
    v.beta = Rgb(1);
}

LampPoint lamp_of(const Scene& scene) {
    const Emitter& e = scene.emitter(0);
    const EmissionSample s = e.sample_emission({0.5, 0.5}, {0.5f, 0.5f});
    return {.emitter = &e, .p = s.p, .ng = s.ng, .uv = s.uv, .prim = s.prim, .pdf = 1};
}

class Chains : public ::testing::TestWithParam<ChainCase> {
protected:
    Chains()
        : scene(scene_of(GetParam().objects)), lamp(lamp_of(scene)),
          sampler(SamplerKind::Independent, 1) {
        sampler.start(0, 0);
        sampler.seek(Stream::Auxiliary, 0);
    }
    Vec3 random_point() { return {random.between(-0.7f, 0.7f), -1, random.between(-0.7f, 0.7f)}; }

    Scene scene;
    LampPoint lamp;
    Sampler sampler;
    RenderStats stats;
    testing::Random random{1};
};

TEST_P(Chains, DerivativesAreLimitsOfDifferences) {
    constexpr double kStep = 1e-5;
    struct Difference {
        Vec3d p, d;
    };
    int compared = 0;
    for (int i = 0; i < 20; ++i) {
        Vertex v;
        ComponentArena arena;
        set_floor_vertex(scene, random_point(), v, arena);
        ChainTracer tracer(scene, v, stats);
        ChainSeeds seeds(scene, v, lamp, 4, kNoPhotons, tracer, stats);
        const auto difference = [&](const ChainSeed& seed, Vec3d axis,
                                    double step) -> std::optional<Difference> {
            if (!tracer.follow(normalize(seed.w + axis * step), seed.events)) return {};
            const ChainRay plus = tracer.ray();
            if (!tracer.follow(normalize(seed.w - axis * step), seed.events)) return {};
            const ChainRay minus = tracer.ray();
            return Difference{(plus.o - minus.o) / (2 * step), (plus.d - minus.d) / (2 * step)};
        };
        for (int k = 0; k < 200; ++k) {
            const auto seed = seeds.draw(sampler);
            if (!seed || !tracer.follow(seed->w, seed->events)) continue;
            const ChainRay at = tracer.ray();
            const TangentBasis basis(seed->w);
            for (const auto& [axis, dp, dd] :
                 {std::tuple(basis.s, at.o1, at.d1), {basis.t, at.o2, at.d2}}) {
                const auto d = difference(*seed, axis, kStep),
                           smaller = difference(*seed, axis, kStep / 10);
                if (!d || !smaller) continue;
                // Where refraction begins, differences have other limits.
                const double size = 1 + length(dp) + length(dd), error = 1e-5 * size * size * size;
                if (size > 50) continue;
                // They have none where an edge of a mesh lies between the rays.
                if (length(d->d - smaller->d) > error) continue;
                EXPECT_LT(length(d->p - dp), 1e-5 * size * size);
                EXPECT_LT(length(d->d - dd), error);
                ++compared;
            }
        }
    }
    EXPECT_GT(compared, 80);
}

// What is found is a solution; seeds that lead to one find it to much less than the angle by which solutions are told apart,
// and different ones are much farther from each other.
TEST_P(Chains, SolutionsAreIsolated) {
    struct Found {
        Vec3d w;
        ChainEvents events;
        int times = 1;
    };
    double widest = 0, closest = kInf;
    int solutions = 0, repeated = 0;
    for (int i = 0; i < 30; ++i) {
        Vertex v;
        ComponentArena arena;
        set_floor_vertex(scene, random_point(), v, arena);
        ChainTracer tracer(scene, v, stats);
        ChainSeeds seeds(scene, v, lamp, 4, kNoPhotons, tracer, stats);
        std::vector<Found> found;
        for (int k = 0; k < 1500; ++k) {
            const auto seed = seeds.draw(sampler);
            if (!seed) continue;
            const auto w = tracer.solve(seed->w, seed->events, seed->ray, lamp.target());
            if (!w) continue;
            ASSERT_TRUE(tracer.follow(*w, seed->events));
            EXPECT_LT(lamp.passed_by(tracer.ray()).miss(), kMissOfSolutions);
            bool is_new = true;
            for (Found& f : found) {
                if (!(f.events == seed->events)) continue;
                const double angle = length(f.w - *w);
                if (is_same_solution(f.w, *w)) {
                    widest = std::max(widest, angle);
                    is_new = false;
                    ++f.times;
                    break;
                }
                closest = std::min(closest, angle);
            }
            if (is_new) found.push_back({*w, seed->events});
        }
        for (const Found& f : found) repeated += f.times > 1;
        solutions += int(found.size());
    }
    EXPECT_GT(solutions, 10);
    EXPECT_GT(repeated, 0.7 * solutions);
    EXPECT_LT(widest, 1e-8);
    EXPECT_GT(closest, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Objects, Chains, ::testing::ValuesIn(cases()),
                         [](const auto& p) { return std::string(p.param.name); });

// At the edge of a caustic two solutions meet, and Newton's method converges slowly. All seeds must still end at one of the
// solutions: else each of their ends would count as a solution of its own.
TEST(CausticEdge, SeedsEndAtSolutions) {
    const Scene scene = scene_of(test::sphere("0,0,0", "0.5", test::kGlass));
    Vertex v;
    ComponentArena arena;
    RenderStats stats;
    set_floor_vertex(scene, {0, -1, 0}, v, arena);
    ChainTracer tracer(scene, v, stats);
    Sampler sampler(SamplerKind::Independent, 3);
    sampler.start(0, 0);
    sampler.seek(Stream::Auxiliary, 0);
    ChainEvents through;
    LampPoint lamp = lamp_of(scene);
    const auto direction = [](double theta) { return Vec3d{std::sin(theta), std::cos(theta), 0}; };
    // Where the ray leaves through the ball, and crosses the lamp's height.
    const auto crossing = [&](double theta) {
        tracer.follow(direction(theta), through);
        const ChainRay& r = tracer.ray();
        return r.o.x + r.d.x * (double(lamp.p.y) - r.o.y) / r.d.y;
    };
    for (ChainSeeds seeds(scene, v, lamp, 4, kNoPhotons, tracer, stats); through.count != 2;)
        if (const auto seed = seeds.draw(sampler)) through = seed->events;
    int ends = 0;
    for (int i = 0; i < 12; ++i) {
        lamp.p = {0, 1.2f + 0.01f * float(i), 0};
        // The edge: the largest crossing of rays that were refracted to the other side of the axis and back.
        double low = 0.1, high = 0.4;
        for (int k = 0; k < 100; ++k) {
            const double a = low + (high - low) / 3, b = high - (high - low) / 3;
            (crossing(a) < crossing(b) ? low : high) = crossing(a) < crossing(b) ? a : b;
        }
        // Around it, by steps of single precision.
        const auto edge = float(crossing(low));
        for (const float inward : {1e-7f, 3e-7f, 1e-6f, 1e-5f}) {
            lamp.p.x = edge - inward;
            ChainSeeds seeds(scene, v, lamp, 4, kNoPhotons, tracer, stats);
            std::vector<Vec3d> found;
            for (int k = 0; k < 2000; ++k) {
                const auto seed = seeds.draw(sampler);
                if (!seed || !(seed->events == through)) continue;
                const auto w = tracer.solve(seed->w, seed->events, seed->ray, lamp.target());
                if (!w) continue;
                ++ends;
                ASSERT_TRUE(tracer.follow(*w, through));
                EXPECT_LT(lamp.passed_by(tracer.ray()).miss(), kMissOfSolutions);
                if (std::none_of(found.begin(), found.end(),
                                 [&](Vec3d o) { return is_same_solution(o, *w); }))
                    found.push_back(*w);
            }
            EXPECT_LE(found.size(), 3u) << lamp.p.y << ' ' << inward;
        }
    }
    EXPECT_GT(ends, 1000);
}

/// Jacobian of the chain from a point of the floor to `lamp`, from the first seed that leads there with `count` events.
double jacobian(const Scene& scene, Vec3 at, const LampPoint& lamp, int count) {
    Vertex v;
    ComponentArena arena;
    RenderStats stats;
    set_floor_vertex(scene, at, v, arena);
    ChainTracer tracer(scene, v, stats);
    ChainSeeds seeds(scene, v, lamp, 4, kNoPhotons, tracer, stats);
    Sampler sampler(SamplerKind::Independent, 2);
    sampler.start(0, 0);
    sampler.seek(Stream::Auxiliary, 0);
    for (int k = 0; k < 10000; ++k) {
        const auto seed = seeds.draw(sampler);
        if (!seed || seed->events.count != count) continue;
        const auto w = tracer.solve(seed->w, seed->events, seed->ray, lamp.target());
        if (w && tracer.follow(*w, seed->events)) return lamp.passed_by(tracer.ray()).jacobian();
    }
    return 0;
}

// A point above a plane between air and glass, seen from below.
TEST(Jacobian, OfOneInterface) {
    const Scene scene = scene_of(pane("0"));
    const LampPoint lamp = lamp_of(scene);
    const double eta = 1.5046 / 1.000277;
    for (const float x : {-0.6f, 0.0f, 0.8f}) {
        const double aside = std::hypot(double(lamp.p.x - x), double(lamp.p.z) - 0.1), below = 1,
                     above = lamp.p.y;
        // The path from the floor, in glass, refracts into air.
        double low = 0, high = std::asin(1 / eta);
        const auto reach = [&](double theta) {
            return below * std::tan(theta) + above * std::tan(std::asin(eta * std::sin(theta)));
        };
        for (int i = 0; i < 200; ++i)
            (reach((low + high) / 2) < aside ? low : high) = (low + high) / 2;
        const double a = low, b = std::asin(eta * std::sin(a));
        const double slope =
            below / sqr(std::cos(a)) + above / sqr(std::cos(b)) * eta * std::cos(a) / std::cos(b);
        // dω = sin θ dθ dφ, and the area normal to the ray is cos θ' times that of the plane.
        const double exact = std::sin(a) / (aside * slope * std::cos(b));
        EXPECT_NEAR(jacobian(scene, {x, -1, 0.1f}, lamp, 1) / exact, 1, 1e-4) << x;
    }
}

// Behind a pane of two interfaces, light is spread as by one that lets it pass straight, up to its width.
TEST(Jacobian, OfTwoInterfacesTendsToNone) {
    const Scene scene = scene_of(
        pane("0.0001") +
        test::rectangle("<rotate x=\"1\" angle=\"90\"/><scale value=\"3\"/>", test::kGlass));
    const LampPoint lamp = lamp_of(scene);
    const Vec3 at{0.5f, -1, 0.3f};
    EXPECT_NEAR(jacobian(scene, at, lamp, 2) * double(length2(lamp.p - at)), 1, 1e-3);
}

// Reflected at the nearest point of a mirror ball, light from a point at distance a covers (a + b + 2ab/R)² at distance b.
TEST(Jacobian, OfMirrorBall) {
    const Scene scene = test::build(
        test::sensor("0,0,5", "0,0,0", 8) +
        test::rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"3\"/><translate y=\"-1\"/>",
                        test::diffuse("0.5,0.5,0.5")) +
        test::sphere("0,0.9,0", "0.5", kMirror) +
        "<emitter type=\"point\"><point name=\"position\" value=\"0,-0.5,0\"/></emitter>");
    const double a = 1.4, b = 0.9, R = 0.5;
    EXPECT_NEAR(jacobian(scene, {0, -1, 0}, lamp_of(scene), 1) * sqr(a + b + 2 * a * b / R), 1,
                1e-4);
}

}  // namespace
}  // namespace etendue
