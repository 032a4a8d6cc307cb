// User paths: the file, what is refused and why, and the density of proposals.

#include "mcmc/user_paths.h"

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "mcmc/numbers.h"
#include "mcmc/path_density.h"
#include "mcmc/pick_paths.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

const std::string kMirror = "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>";

/// A room with a mirror on its left wall.
Scene mirror_room() {
    return build(front_camera(16) + room() + area_lamp() +
                 rectangle("<scale value=\"0.5\"/><rotate y=\"1\" angle=\"90\"/><translate "
                           "x=\"-0.95\"/>",
                           kMirror));
}

std::string problem(const Scene& scene, std::vector<Vec3> points) {
    const CheckedPath checked = check_user_path(
        scene, {.name = {}, .points = std::move(points), .cones = {1}, .radius = {}});
    return checked.path ? "" : std::to_string(checked.point + 1) + ": " + checked.problem;
}

TEST(UserPaths, AreRefusedWithAReason) {
    const Scene scene = mirror_room();
    const Vec3 lamp{0, 0.98f, 0};
    // Off the mirror, from the lamp to the floor: at half the height between them.
    EXPECT_EQ(problem(scene, {lamp, {0.3f, -1, 0.2f}}), "");
    EXPECT_EQ(problem(scene, {lamp, {-0.95f, -0.01f, 0}, {0, -1, 0}}), "");
    const auto expect = [&](const std::vector<Vec3>& points, const char* text) {
        EXPECT_NE(problem(scene, points).find(text), std::string::npos) << problem(scene, points);
    };
    expect({lamp, {0.3f, -0.8f, 0.2f}}, "2: is 0.2 from the nearest surface");
    expect({{0, -1, 0}, {0.3f, 1, 0.2f}}, "1: is on \"rectangle\", which emits nothing");
    expect({lamp, {0, 1, 0.1f}}, "1: its emitter emits nothing toward the next point");
    expect({lamp, {-1, 0, 0}}, "2: cannot be reached from the point before it");
    expect({lamp, {-0.95f, -0.01f, 0}}, "2: is on \"rectangle\", a mirror");
    expect({lamp, {-0.95f, 0.2f, 0}, {0, -1, 0}}, "degrees off the law of reflection");
}

TEST(UserPaths, DoNotDependOnDistantObjects) {
    const Scene scene = build(front_camera(16) + room() + area_lamp() +
                              rectangle("<translate x=\"100000\"/>", kMirror));
    EXPECT_EQ(problem(scene, {{0, 0.98f, 0}, {0.3f, -1, 0.2f}}), "");
    EXPECT_EQ(problem(scene, {{0, 0.98f, 0}, {0.3f, -0.985f, 0.2f}}), "");
    EXPECT_NE(problem(scene, {{0, 0.98f, 0}, {0.3f, -0.97f, 0.2f}}), "");
    const CheckedPath checked = check_user_path(
        scene,
        {.name = {}, .points = {{0, 0.98f, 0}, {0.3f, -1, 0.2f}}, .cones = {1}, .radius = {}});
    ASSERT_TRUE(checked.path);
    EXPECT_LT(checked.path->radius, 0.1f);
}

/// Where coordinates are rounded to 5e-4, for a path of 0.1.
TEST(UserPaths, MayBeFarFromTheOrigin) {
    const Vec3 far{5000, 4000, -3000};
    const Scene scene = build(transformed(
        front_camera(16) + room() + area_lamp() +
            rectangle("<scale value=\"0.2\"/><rotate x=\"1\" angle=\"-90\"/><translate y=\"0.9\"/>",
                      diffuse("0.7,0.7,0.7")),
        "<rotate z=\"1\" angle=\"30\"/><translate x=\"5000\" y=\"4000\" z=\"-3000\"/>"));
    const auto place = [&](double x, double y, double z) {
        const double cosine = std::sqrt(0.75), sine = 0.5;
        return Vec3{float(double(far.x) + x * cosine - y * sine),
                    float(double(far.y) + x * sine + y * cosine), float(double(far.z) + z)};
    };
    const TechniqueCounts none{};
    RenderStats stats;
    const WalkContext walk{scene, none, stats, {}};
    constexpr int kPaths = 40, kSamples = 50;
    int sampled = 0;
    for (int i = 0; i < kPaths; ++i) {
        const double s = 0.1 * i / kPaths;
        const CheckedPath checked = check_user_path(
            scene, {.name = {},
                    .points = {place(s, 0.98, 0.7 * s), place(0.06 - s / 2, 0.9, s - 0.05)},
                    .cones = {1},
                    .radius = {}});
        ASSERT_TRUE(checked.path) << i << ": " << checked.problem;
        const UserPaths paths(scene, {*checked.path});
        SubPath y;
        for (int k = 0; k < kSamples; ++k) {
            Sampler sampler(SamplerKind::Independent, uint64_t(i));
            sampler.start(0, uint64_t(k));
            sampled += paths.sample(walk, sampler, y);
        }
    }
    // Others leave the disc or the cone by rounding.
    EXPECT_GT(sampled, 0.3 * kPaths * kSamples);
}

/// Beyond the range of double.
TEST(UserPaths, LongOnesInLargeScenesHaveADensity) {
    const Scene scene =
        build(transformed(front_camera(16) + room() + area_lamp(), "<scale value=\"1000000\"/>"));
    std::vector<Vec3> points{{0, 0.98f, 0}};
    for (int i = 0; i < 60; ++i)
        points.push_back({0.6f, i % 2 == 0 ? -1.0f : 1.0f, 0.1f * float(i % 3)});
    for (Vec3& p : points) p *= 1e6f;
    const CheckedPath checked =
        check_user_path(scene, {.name = {}, .points = points, .cones = {1}, .radius = {}});
    ASSERT_TRUE(checked.path) << checked.problem;
    const UserPaths paths(scene, {*checked.path});
    const TechniqueCounts none{};
    RenderStats stats;
    SubPath y;
    Sampler sampler(SamplerKind::Independent, 0);
    sampler.start(0, 1);
    ASSERT_TRUE(paths.sample({scene, none, stats, {}}, sampler, y));
    std::vector<const Vertex*> vertices;
    for (int k = 0; k < y.size(); ++k) vertices.push_back(&y[k]);
    EXPECT_GT(paths.density(vertices), 0);
}

TEST(UserPaths, FilesAreReadAndWritten) {
    const std::vector<GivenPath> paths{
        {.name = "a", .points = {{0.1f, 2, 3}, {4, 5, 6}}, .cones = {2}, .radius = 0.5f},
        {.name = {}, .points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}, .cones = {1, 3}, .radius = {}}};
    const std::vector<GivenPath> read = parse_user_paths(to_json(paths), "paths.json");
    ASSERT_EQ(read.size(), 2u);
    for (size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(read[i].name, paths[i].name);
        EXPECT_EQ(read[i].cones, paths[i].cones);
        EXPECT_EQ(read[i].radius, paths[i].radius);
        ASSERT_EQ(read[i].points.size(), paths[i].points.size());
        for (size_t k = 0; k < paths[i].points.size(); ++k)
            EXPECT_EQ(length2(read[i].points[k] - paths[i].points[k]), 0);
    }
}

TEST(UserPaths, BadFilesAreRefused) {
    const auto message = [](const std::string& text) -> std::string {
        try {
            parse_user_paths(text, "paths.json");
        } catch (const std::runtime_error& e) {
            return e.what();
        }
        return "";
    };
    EXPECT_NE(message("[\n{\n").find("paths.json:"), std::string::npos);
    EXPECT_NE(message("{}").find("must be a list of paths"), std::string::npos);
    EXPECT_NE(message("[{\"points\": [[0,0,0]]}]").find("at least two points"), std::string::npos);
    EXPECT_NE(message("[{\"points\": [[0,0,0],[1,0]]}]").find("point 2 must be [x, y, z]"),
              std::string::npos);
    EXPECT_NE(message("[{\"points\": [[0,0,0],[1e300,0,0]]}]")
                  .find("point 2 is [1e+300,0,0], which is beyond"),
              std::string::npos);
    EXPECT_NE(message("[{\"points\":" + std::string(1000, '[')).find("nested more than 64 deep"),
              std::string::npos);
    EXPECT_NE(message("[{\"points\": [[0,0,0],[1,0,0]], \"cones\": 1}]").find("\"cones\""),
              std::string::npos);
    EXPECT_NE(message("[{\"points\": [[0,0,0],[1,0,0]], \"cone\": -1}]").find("above 0"),
              std::string::npos);
    for (const char* radius : {"1e300", "1e-300", "0", "-1", "\"wide\""})
        EXPECT_NE(
            message("[{\"points\": [[0,0,0],[1,0,0]], \"radius\": " + std::string(radius) + "}]")
                .find("\"radius\" must be a number above 0"),
            std::string::npos)
            << radius;
    // Rays to an emitter start so far from it.
    EXPECT_NE(message("[{\"points\": [[0,0,0],[1,0,0]], \"radius\": 1e19}]")
                  .find("\"radius\" must be a number above 0, at most 1e+15, but is 1e+19"),
              std::string::npos);
    EXPECT_NE(message("[{\"points\": [[0,0,0],[1,0,0]], \"cone\": [1,2]}]").find("2 angles for 1"),
              std::string::npos);
}

/// Cells of the floor, or of what the mirror shows of it: proposals in each against the integral of their density, from
/// samples whose own density is known.
TEST(UserPaths, DensityIsThatOfTheProposals) {
    const Scene scene = mirror_room();
    const auto path = [&](std::vector<Vec3> points, float cone) {
        return *check_user_path(
                    scene,
                    {.name = {}, .points = std::move(points), .cones = {cone}, .radius = 0.05f})
                    .path;
    };
    const std::vector<Vec3> direct{{0, 0.98f, 0}, {0.3f, -1, 0.2f}},
        mirrored{{0, 0.98f, 0}, {-0.95f, -0.01f, 0}, {0, -1, 0}};
    const UserPaths narrow(scene, {path(direct, 4), path(mirrored, 4)}),
        wide(scene, {path(direct, 8), path(mirrored, 8)});
    const TechniqueCounts none{};
    RenderStats stats;
    const WalkContext walk{scene, none, stats, {}};
    SubPath y;
    constexpr int kCells = 8, kSamples = 60000;
    const auto cell = [&](const SubPath& p) {
        const Vec3 at = p[p.size() - 1].p, from = p[0].p;
        return (p.size() == 3 ? 4 : 0) + (at.x > (p.size() == 3 ? 0.0f : 0.3f) ? 2 : 0) +
               (from.z > 0 ? 1 : 0);
    };
    std::array<Moments, kCells> sampled, integrated;
    int edges = 0;
    for (int i = 0; i < kSamples; ++i)
        for (const bool is_wide : {false, true}) {
            Sampler sampler(SamplerKind::Independent, is_wide);
            sampler.start(0, uint64_t(i));
            int at = -1;
            double value = 0;
            if ((is_wide ? wide : narrow).sample(walk, sampler, y)) {
                std::vector<const Vertex*> vertices;
                for (int k = 0; k < y.size(); ++k) vertices.push_back(&y[k]);
                at = cell(y);
                const PathDensity density = (is_wide ? wide : narrow).density(vertices);
                // Rounding must not put a proposal beyond the edge of its cone.
                edges += !(density > 0);
                if (!is_wide)
                    value = 1;
                else if (density > 0)
                    value = double(narrow.density(vertices) / density);
            }
            for (int k = 0; k < kCells; ++k)
                (is_wide ? integrated : sampled)[size_t(k)].add(k == at ? value : 0.0);
        }
    EXPECT_EQ(edges, 0);
    for (size_t k = 0; k < kCells; ++k) {
        EXPECT_GT(sampled[k].mean(), 0.02) << k;
        EXPECT_GT(welch_p(sampled[k], integrated[k], 1e-3 * sampled[k].mean()), sidak(1e-3, kCells))
            << k << ": " << sampled[k].mean() << " and " << integrated[k].mean();
    }
}

/// Light paths that begin near a user path and go on as traced ones, against traced ones weighted with the ratio of the
/// densities: number and flux of the vertices, by index, and by half of the room.
TEST(UserPaths, DensityRatiosAreThoseToTracedPaths) {
    const Scene scene = mirror_room();
    const auto path = [&](std::vector<Vec3> points) {
        return *check_user_path(
                    scene, {.name = {}, .points = std::move(points), .cones = {12}, .radius = 0.1f})
                    .path;
    };
    const UserPaths paths(scene, {path({{0, 0.98f, 0}, {0.3f, -1, 0.2f}}),
                                  path({{0, 0.98f, 0}, {-0.95f, -0.01f, 0}, {0, -1, 0}}),
                                  path({{0, 0.98f, 0}, {0.3f, -1, 0.2f}, {1, -0.2f, 0}})});
    EXPECT_EQ(paths.longest(), 3);
    const TechniqueCounts none{};
    RenderStats stats;
    const WalkContext walk{scene, none, stats, {.max_vertices = 5, .rr_depth = 2}};
    SubPath y;
    constexpr size_t kSums = 4 * 2 * 2;  // Vertices 1 to 4, halves of the room, number and flux.
    std::array<Moments, kSums> followed, traced;
    std::vector<double> ratios;
    for (int i = 0; i < 200000; ++i)
        for (const bool follows : {false, true}) {
            if (follows && i >= 40000) continue;
            Sampler sampler(SamplerKind::Independent, follows);
            sampler.start(0, uint64_t(i));
            std::array<double, kSums> sums{};
            bool goes_on = follows ? paths.sample(walk, sampler, y)
                                   : start_light_path(walk, sampler, y) && y.size() == 2;
            while (goes_on) goes_on = extend<TransportMode::Importance>(walk, sampler, y);
            if (!follows) paths.density_ratios(y, ratios);
            for (int k = 1; k < y.size(); ++k) {
                const double ratio = follows ? 1.0 : ratios[size_t(k)];
                const size_t at = size_t(4 * (k - 1) + 2 * (y[k].p.x > 0));
                sums[at] += ratio;
                sums[at + 1] += ratio * double(luminance(y[k].beta));
            }
            for (size_t k = 0; k < kSums; ++k) (follows ? followed : traced)[k].add(sums[k]);
        }
    for (size_t k = 0; k < kSums; ++k) {
        EXPECT_GT(followed[k].mean(), 0) << k;
        EXPECT_GT(welch_p(followed[k], traced[k], 1e-3 * followed[k].mean()), sidak(1e-3, kSums))
            << k << ": " << followed[k].mean() << " ± " << std::sqrt(followed[k].squared_error())
            << " and " << traced[k].mean() << " ± " << std::sqrt(traced[k].squared_error());
    }
}

/// As states of chains, whose numbers each vertex has a few of: a path over three delta events in a scene with masks.
/// Steps that move all numbers but those of choices move the path within its disc and cones.
TEST(UserPaths, AreMovedByStepsOfChains) {
    const std::string veil = "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.5\"/>" +
                             diffuse("0.5,0.5,0.5") + "</bsdf>";
    const Scene scene =
        build(front_camera(16) + room() + area_lamp() +
              rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-0.9\"/>", kMirror) +
              rectangle("<rotate y=\"1\" angle=\"-90\"/><translate x=\"0.95\"/>", kMirror) +
              rectangle("<translate z=\"-0.95\"/>", kMirror) +
              rectangle("<scale value=\"0.1\"/><translate z=\"0.9\"/>", veil));
    // By the mirrors on the floor, the right and the back wall to the ceiling.
    std::vector<Vec3> points{{0.1f, 0.98f, 0.1f}};
    Vec3 d{0.4f, -1, -0.3f};
    const auto go_to = [&](float Vec3::*axis, float at) {
        const Vec3 from = points.back();
        points.push_back(from + d * ((at - from.*axis) / d.*axis));
        d.*axis = -(d.*axis);
    };
    go_to(&Vec3::y, -0.9f), go_to(&Vec3::x, 0.95f), go_to(&Vec3::z, -0.95f), go_to(&Vec3::y, 1);
    const CheckedPath checked =
        check_user_path(scene, {.name = {}, .points = points, .cones = {0.5f}, .radius = 0.05f});
    ASSERT_TRUE(checked.path) << checked.point + 1 << ": " << checked.problem;
    const UserPaths paths(scene, {*checked.path});

    const TechniqueCounts none{};
    RenderStats stats;
    const WalkContext walk{scene, none, stats, {}};
    SubPath y;
    int started = 0, followed = 0, moved = 0;
    for (uint64_t i = 0; i < 200; ++i) {
        NumberTable numbers, next;
        NumberSource fresh(NumberStep::Fresh, i, nullptr, &numbers);
        Sampler first(fresh);
        if (!paths.sample(walk, first, y)) continue;
        ++started;
        const Vec3 y0 = y[0].p, y4 = y[4].p;
        NumberSource wide(NumberStep::Wide, i, &numbers, &next);
        Sampler second(wide);
        if (!paths.sample(walk, second, y)) continue;
        ++followed;
        moved += length(y[0].p - y0) > 0 && length(y[4].p - y4) > 0;
    }
    EXPECT_GT(started, 100);
    EXPECT_GT(followed, started / 2);
    EXPECT_EQ(moved, followed);
}

TEST(UserPaths, PickedOnesPassTheirChecks) {
    const Scene scene = build(mixed_room(front_camera(16)));
    const auto picked =
        pick_paths(scene, {.count = 8, .x = 8, .y = 12, .length = 4, .samples = 20000, .seed = 1});
    EXPECT_GE(picked.size(), 4u);
    for (const GivenPath& path : picked) {
        const CheckedPath checked = check_user_path(scene, path);
        EXPECT_TRUE(checked.path) << path.name << ", point " << checked.point + 1 << ": "
                                  << checked.problem;
    }
    EXPECT_THROW(
        pick_paths(scene, {.count = 1, .x = 99, .y = 0, .length = 3, .samples = 1, .seed = 0}),
        std::runtime_error);
}

}  // namespace
}  // namespace etendue::test
