// Trials of unbiased photon gathering against the walk itself: the frequency with which a walk finds a partner, times
// the mean of r, is one. False-alarm rate: 0.1 % for all configurations of a case together.

#include "reuse/reciprocal.h"

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "random_guide.h"
#include "test_scenes.h"

namespace etendue {
namespace {

struct Case {
    const char* name;
    std::string bsdf, light;
};

const std::string kLamp = test::area_lamp();

std::vector<Case> cases() {
    const auto alpha = [](const char* type, const char* a, const char* more = "") {
        return std::string("<bsdf type=\"") + type + "\"><float name=\"alpha\" value=\"" + a +
               "\"/>" + more + "</bsdf>";
    };
    const std::string ggx = "<string name=\"distribution\" value=\"ggx\"/>";
    const auto two_sided = [](const std::string& b) {
        return "<bsdf type=\"twosided\">" + b + "</bsdf>";
    };
    return {
        {"diffuse", test::diffuse("0.7,0.6,0.5"), kLamp},
        {"beckmann", two_sided(alpha("roughconductor", "0.3")), kLamp},
        {"ggx", two_sided(alpha("roughconductor", "0.15", ggx.c_str())), kLamp},
        {"anisotropic",
         two_sided("<bsdf type=\"roughconductor\"><float name=\"alpha_u\" value=\"0.1\"/><float "
                   "name=\"alpha_v\" value=\"0.4\"/>" +
                   ggx + "</bsdf>"),
         kLamp},
        {"roughplastic", two_sided(alpha("roughplastic", "0.2")), kLamp},
        {"phong", two_sided("<bsdf type=\"phong\"><float name=\"exponent\" value=\"20\"/></bsdf>"),
         kLamp},
        {"plastic", two_sided("<bsdf type=\"plastic\"/>"), kLamp},
        {"principled",
         two_sided("<bsdf type=\"principled\"><float name=\"roughness\" value=\"0.5\"/></bsdf>"),
         kLamp},
        {"openpbr",
         two_sided("<bsdf type=\"openpbr\"><float name=\"coat_weight\" value=\"0.5\"/><float "
                   "name=\"fuzz_weight\" value=\"0.5\"/></bsdf>"),
         kLamp},
        {"openpbr_half_glass",
         "<bsdf type=\"openpbr\"><float name=\"specular_roughness\" value=\"0.5\"/><float "
         "name=\"transmission_weight\" value=\"0.5\"/></bsdf>",
         kLamp},
        {"roughdielectric", alpha("roughdielectric", "0.3"), kLamp},
        {"mirror_and_diffuse",
         two_sided("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.4\"/><bsdf "
                   "type=\"diffuse\"/><bsdf type=\"conductor\"/></bsdf>"),
         kLamp},
        {"lamp_with_two_sides", test::diffuse("0.5,0.5,0.5"),
         test::rectangle("<scale value=\"0.25\"/><rotate x=\"1\" angle=\"70\"/>",
                         test::diffuse("0.5,0.5,0.5") +
                             "<emitter type=\"area\"><boolean name=\"two_sided\" "
                             "value=\"true\"/></emitter>")},
        {"point", test::diffuse("0.5,0.5,0.5"),
         "<emitter type=\"point\"><point name=\"position\" value=\"0,0.6,0.3\"/></emitter>"},
        {"spot", test::diffuse("0.5,0.5,0.5"),
         "<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"50\"/><transform "
         "name=\"to_world\"><lookat origin=\"0,0.6,0.9\" target=\"0,-0.6,0\" "
         "up=\"0,0,1\"/></transform></emitter>"},
        {"directional", test::diffuse("0.5,0.5,0.5"),
         "<emitter type=\"directional\"><vector name=\"direction\" "
         "value=\"0.1,-0.4,-1\"/></emitter>"},
        {"constant", test::diffuse("0.5,0.5,0.5"), "<emitter type=\"constant\"/>"},
    };
}

enum class Guided { No, Wide, Narrow };

class Reciprocal : public ::testing::TestWithParam<std::tuple<Case, Guided>> {
protected:
    Reciprocal()
        : scene(test::build(test::front_camera(8) + test::room() + given().light +
                            test::sphere("-0.3,-0.5,0.3", "0.4", given().bsdf) +
                            test::sphere("0.5,0.3,-0.2", "0.45", given().bsdf))),
          film(scene.film(), scene.filter()), sampler(SamplerKind::Independent, 5) {
        if (const Guided guided = std::get<Guided>(GetParam()); guided != Guided::No)
            guide = test::random_guide({}, 1.7f, std::vector<double>(scene.emitters().size(), 1),
                                       {}, guided == Guided::Wide ? 20.0f : 1000.0f, 3);
        guide.has_roulette = std::get<Guided>(GetParam()) == Guided::Wide;
    }

    static const Case& given() { return std::get<Case>(GetParam()); }

    template <TransportMode mode>
    void trace(SubPath& path, uint32_t index) {
        const TechniqueCounts counts{.hit = 1,
                                     .next_event = 1,
                                     .connect = 1,
                                     .splat = 64,
                                     .gather = 64,
                                     .guide = guide.surfaces.is_empty() ? nullptr : &guide};
        // Roulette starts early, so that survival is included.
        const WalkContext walk{scene, counts, stats, {5, 2}};
        sampler.start(0, index);
        if (mode == TransportMode::Radiance)
            trace_eye_path(walk, film, index % 64, sampler, path);
        else
            trace_light_path(walk, sampler, path);
    }

    float u_guide(const Vertex& v) { return v.guide ? sampler.next_1d() : 0.0f; }

    /// A ray from y_0; at infinity from a point of the emitter's disc.
    std::optional<Ray> emitted(const Vertex& y0) {
        const Vec2 u = sampler.next_2d();
        if (y0.is_infinite) {
            const Emitter::Disc disc = y0.emitter->disc();
            const Frame frame = Frame::from_normal(y0.p);
            const Vec2 at = sample_uniform_disk(u);
            return Ray{disc.center + (frame.s * at.x + frame.t * at.y + y0.p) * disc.radius, -y0.p,
                       kInf};
        }
        const auto s = y0.sample(0, u, u_guide(y0), TransportMode::Importance);
        if (!s) return {};
        return Ray{y0.has_cosine ? offset_origin(y0.ray_end(), s->wi) : y0.p, s->wi, kInf};
    }

    /// Whether one walk from `e.from` finds a partner.
    bool walk_finds(const PairEvent& e) {
        Ray ray;
        if (e.from.kind == Vertex::Kind::Emitter) {
            const auto emission = emitted(e.from);
            if (!emission) return false;
            ray = *emission;
        } else {
            if (!(sampler.next_1d() < e.from.survival.value())) return false;
            const float u = sampler.next_1d();
            const Vec2 u_direction = sampler.next_2d();
            const auto s = e.from.sample(u, u_direction, u_guide(e.from), e.mode);
            if (!s || s->is_delta) return false;
            ray = {offset_origin(e.from.ray_end(), s->wi), s->wi, kInf};
        }
        SurfaceHit hit;
        if (!scene.intersect(ray, 0, hit)) return false;
        ComponentArena arena;
        scratch.set_surface(*hit.shape, hit.location, hit.geometry, -ray.d, arena);
        return scratch.is_connectible && e.near.contains(scratch.p, arrival_side(scratch));
    }

    template <TransportMode mode>
    void check(uint32_t paths, float radius) {
        SubPath path;
        for (uint32_t index = 0; index < paths; ++index) {
            trace<mode>(path, index);
            for (int i = mode == TransportMode::Radiance ? 1 : 0; i + 1 < path.size(); ++i) {
                const Vertex &from = path[i], &next = path[i + 1];
                if (from.is_delta || next.kind != Vertex::Kind::Surface || !next.is_connectible)
                    continue;
                // Offset from the surface, like other vertices near it.
                const Vec3 center = next.p + (next.p - path[0].p) * 0.01f;
                for (const auto& [bound, flatness] : kShapes)
                    compare({from,
                             mode,
                             {center, next.ng, arrival_side(next), radius, flatness * radius},
                             bound});
            }
        }
    }

    void compare(const PairEvent& event) {
        sampler.seek(Stream::Auxiliary, ++number);
        Moments found, r;
        for (int i = 0; i < kWalks / 20; ++i) found.add(walk_finds(event));
        if (found.mean() < 0.04) return;
        found = {};
        for (int i = 0; i < kWalks; ++i) found.add(walk_finds(event));
        for (int i = 0; i < kWalks / 8; ++i)
            r.add(reciprocal_probability(scene, event, sampler, scratch, stats));
        const double product = found.mean() * r.mean();
        const double spread = std::sqrt(found.squared_error() / sqr(found.mean()) +
                                        r.squared_error() / sqr(r.mean()));
        deviations.push_back((product - 1) / spread);
        weighted += (product - 1) / sqr(spread);
        weights += 1 / sqr(spread);
    }

    /// Bounds and the shapes of neighbourhoods that they are for: a ball, or a flat one.
    static constexpr std::pair<TrialBound, float> kShapes[] = {{TrialBound::Box, 1},
                                                               {TrialBound::Cone, 1},
                                                               {TrialBound::Slab, 0.1f},
                                                               {TrialBound::Slab, 0.02f}};
    static constexpr int kWalks = 10000;
    Scene scene;
    Film film;
    Sampler sampler;
    Guide guide;  ///< Empty without one.
    RenderStats stats;
    Vertex scratch;
    uint32_t number = 0;
    std::vector<double> deviations;
    double weighted = 0, weights = 0;  ///< Inverse-variance mean of product - 1.
};

TEST_P(Reciprocal, IsThatOfTheWalk) {
    const uint32_t more = guide.has_roulette ? 2 : 0;  // Since the paths are shorter.
    for (const float radius : {0.1f, 0.3f, 0.9f}) {
        check<TransportMode::Radiance>(5 + more, radius);
        check<TransportMode::Importance>(7 + more, radius);
    }
    ASSERT_GT(deviations.size(), 10u);
    double squares = 0;
    for (double d : deviations) {
        squares += sqr(d);
        EXPECT_LT(std::fabs(d), 5);
    }
    // About χ² with as many degrees of freedom; normal for so many.
    const double n = double(deviations.size());
    EXPECT_LT((squares - n) / std::sqrt(2 * n), 4);
    const double spread = 1 / std::sqrt(weights);
    EXPECT_NEAR(weighted / weights, 0, 3.9 * spread);
    EXPECT_LT(spread, 0.007) << "too few samples";
    EXPECT_EQ(stats.bounds_exceeded, 0u);
    EXPECT_EQ(stats.runaways, 0u);
    RecordProperty("trials_per_pair", std::to_string(double(stats.trials) / (kWalks / 8 * n)));
}

/// Two grey planes, z = 0 and z = 2, that face each other.
std::string floor_and_ceiling() {
    return test::front_camera(8) + test::area_lamp() +
           test::rectangle(
               "<scale value=\"4\"/><rotate x=\"1\" angle=\"180\"/><translate z=\"2\"/>",
               test::diffuse("0.5,0.5,0.5")) +
           test::rectangle("<scale value=\"4\"/>", test::diffuse("0.5,0.5,0.5"));
}
/// The origin, which a walk reaches from `wo`.
Vertex on_floor(const Scene& scene, Vec3 wo, ComponentArena& arena) {
    SurfaceHit hit;
    EXPECT_TRUE(scene.intersect({{0, 0, 0.5f}, {0, 0, -1}, kInf}, 0, hit));
    Vertex floor;
    floor.set_surface(*hit.shape, hit.location, hit.geometry, wo, arena);
    return floor;
}

/// Only a strip of 2w × 2d of the neighbourhood is seen through a slit of width w half way: about one trial of a
/// hundred hits, and a cap on their number shows. p_c = ∫ cos²θ / (π |v|²) = ∫ H² / (π |v|⁴) over the strip.
TEST(ReciprocalThroughASlit, EqualsTheIntegral) {
    constexpr double w = 0.0016, d = 0.2, H = 2;
    const auto plate = [](const char* x) {
        return test::rectangle(std::string("<scale x=\"2\" y=\"4\"/><translate x=\"") + x +
                                   "\" z=\"1\"/>",
                               test::diffuse("0,0,0"));
    };
    const Scene scene = test::build(floor_and_ceiling() + plate("2.0008") + plate("-2.0008"));
    ComponentArena arena;
    Vertex scratch;
    const Vertex floor = on_floor(scene, {0, 0, 1}, arena);

    double p_c = 0;
    constexpr int kSteps = 4000;
    for (int i = 0; i < kSteps; ++i) {
        // The strip is so narrow that x² does not matter.
        const double y = d * ((i + 0.5) * 2 / kSteps - 1);
        p_c += 2 * w * (2 * d / kSteps) * sqr(H) / (M_PI * sqr(sqr(y) + sqr(H)));
    }
    Sampler sampler(SamplerKind::Independent, 3);
    sampler.start(0, 0);
    sampler.seek(Stream::Auxiliary, 1);
    RenderStats stats;
    for (const auto& [bound, flatness] :
         {std::pair{TrialBound::Slab, 0.05f}, {TrialBound::Cone, 1}}) {
        const PairEvent event{floor,
                              TransportMode::Radiance,
                              {{0, 0, 2}, {0, 0, -1}, {{0, 0, -1}, false}, d, flatness * float(d)},
                              bound};
        Moments r;
        for (int i = 0; i < 20000; ++i)
            r.add(reciprocal_probability(scene, event, sampler, scratch, stats) * p_c);
        EXPECT_GE(welch_p(r, Moments::exact(1), 0.005), 1e-4)
            << r.mean() << " ± " << std::sqrt(r.squared_error());
    }
    EXPECT_GT(stats.trials, 50 * 40000u) << "the slit is too wide for what this tests";
    EXPECT_EQ(stats.runaways, 0u);
}

constexpr int kEstimates = 40000;
/// Checks that the mean of r is 1/p_c.
RenderStats expect_reciprocal(const Scene& scene, const PairEvent& event, double p_c) {
    Sampler sampler(SamplerKind::Independent, 3);
    sampler.start(0, 0);
    sampler.seek(Stream::Auxiliary, 1);
    RenderStats stats;
    Vertex scratch;
    Moments r;
    for (int i = 0; i < kEstimates; ++i)
        r.add(reciprocal_probability(scene, event, sampler, scratch, stats) * p_c);
    EXPECT_GE(welch_p(r, Moments::exact(1), 0.002), 1e-4)
        << r.mean() << " ± " << std::sqrt(r.squared_error());
    return stats;
}

/// Where the guide is for walks in the other mode alone, a cosine density keeps its proposals in closed form.
TEST(ReciprocalOfAWalkWithoutGuide, IsThatWithoutGuide) {
    const Scene scene = test::build(floor_and_ceiling());
    ComponentArena arena;
    Vertex floor = on_floor(scene, normalize(Vec3{0.2f, 0, 1}), arena);
    GuideCell cell;
    auto& field = cell.fields[size_t(TransportMode::Importance)];
    field.share.fill(0.9f);
    field.mixture.add({{0, 0, 1}, 0, 20, 1});
    const auto trials = [&](TrialBound bound) {
        Sampler sampler(SamplerKind::Independent, 3);
        sampler.start(0, 0);
        sampler.seek(Stream::Auxiliary, 1);
        RenderStats stats;
        Vertex scratch;
        const Vec3 n{0, 0, -1};
        double sum = 0;
        for (int i = 0; i < 1000; ++i)
            sum += reciprocal_probability(
                scene,
                {floor, TransportMode::Radiance, {{1.5f, 0, 2}, n, {n, false}, 0.5f, 0.05f}, bound},
                sampler, scratch, stats);
        return std::pair(stats.trials, sum);
    };
    for (const TrialBound bound : {TrialBound::Box, TrialBound::Cone, TrialBound::Slab}) {
        floor.guide = nullptr;
        const auto without = trials(bound);
        floor.set_guide(cell, TransportMode::Radiance, true);
        ASSERT_NE(floor.guide, nullptr);
        EXPECT_EQ(trials(bound), without);
    }
}

/// A floor seen from a wall, close above its plane. p_c = ∫ cosθ H / (π |v|³) over the disc, with cosθ = x / |v|.
TEST(ReciprocalSeenEdgeOn, EqualsTheIntegral) {
    constexpr double kDistance = 1, H = 0.012, kRadius = 0.4;
    const Scene scene =
        test::build(test::front_camera(8) + test::area_lamp() +
                    test::rectangle("<scale value=\"4\"/>", test::diffuse("0.5,0.5,0.5")) +
                    test::rectangle("<scale value=\"4\"/><rotate y=\"1\" angle=\"90\"/><translate "
                                    "x=\"-1\" z=\"4.001\"/>",
                                    test::diffuse("0.5,0.5,0.5")));
    SurfaceHit hit;
    ASSERT_TRUE(scene.intersect({{0, 0, float(H)}, {-1, 0, 0}, kInf}, 0, hit));
    ComponentArena arena;
    Vertex wall;
    wall.set_surface(*hit.shape, hit.location, hit.geometry, {1, 0, 0}, arena);
    ASSERT_NEAR(double(wall.p.x), -kDistance, 1e-5);

    double p_c = 0;
    constexpr int kSteps = 1000;
    for (int i = 0; i < kSteps; ++i)
        for (int j = 0; j < kSteps; ++j) {
            const double x = kRadius * ((i + 0.5) * 2 / kSteps - 1),
                         y = kRadius * ((j + 0.5) * 2 / kSteps - 1);
            if (x * x + y * y > sqr(kRadius)) continue;
            const double dist2 = sqr(x + kDistance) + sqr(y) + sqr(H);
            p_c += sqr(2 * kRadius / kSteps) * (x + kDistance) * H / (M_PI * sqr(dist2));
        }
    const PairEvent event{
        wall,
        TransportMode::Radiance,
        {{0, 0, 0}, {0, 0, 1}, {{0, 0, 1}, false}, kRadius, 0.02f * float(kRadius)},
        TrialBound::Slab};
    const RenderStats stats = expect_reciprocal(scene, event, p_c);
    EXPECT_LT(double(stats.trials) / kEstimates, 10) << "the ball's cone would need a hundred";
    EXPECT_EQ(stats.bounds_exceeded, 0u);
}

/// A wall, half of which lies below the floor's plane, but all above the horizon of a shading normal that leans to it.
TEST(ReciprocalUnderALeaningNormal, EqualsTheIntegral) {
    constexpr double kDistance = 2, kRadius = 0.4;
    const Scene scene = test::build(
        test::front_camera(8) + test::area_lamp() +
        test::rectangle("<scale value=\"0.1\"/>", test::diffuse("0.5,0.5,0.5")) +
        test::rectangle("<scale value=\"4\"/><rotate y=\"1\" angle=\"-90\"/><translate x=\"2\"/>",
                        test::diffuse("0.5,0.5,0.5")));
    SurfaceHit hit;
    ASSERT_TRUE(scene.intersect({{0, 0, 0.5f}, {0, 0, -1}, kInf}, 0, hit));
    const double leaning = std::sqrt(0.5);
    hit.geometry.ns = {float(leaning), 0, float(leaning)};
    ComponentArena arena;
    Vertex floor;
    floor.set_surface(*hit.shape, hit.location, hit.geometry, normalize(Vec3{0.2f, 0, 1}), arena);

    double p_c = 0;
    constexpr int kSteps = 1000;
    for (int i = 0; i < kSteps; ++i)
        for (int j = 0; j < kSteps; ++j) {
            const double y = kRadius * ((i + 0.5) * 2 / kSteps - 1),
                         z = kRadius * (j + 0.5) / kSteps;
            if (y * y + z * z > sqr(kRadius)) continue;
            const double dist2 = sqr(kDistance) + sqr(y) + sqr(z);
            p_c += 2 * sqr(kRadius / kSteps) * leaning * (kDistance + z) * kDistance /
                   (M_PI * sqr(dist2));
        }
    const Vec3 n{-1, 0, 0};
    const PairEvent event{
        floor,
        TransportMode::Radiance,
        {{float(kDistance), 0, 0}, n, {n, false}, kRadius, 0.02f * float(kRadius)},
        TrialBound::Slab};
    expect_reciprocal(scene, event, p_c);
}

const auto kName = [](const ::testing::TestParamInfo<std::tuple<Case, Guided>>& given) {
    const char* suffix[] = {"", "_guided", "_narrowly_guided"};
    return std::get<Case>(given.param).name +
           std::string(suffix[int(std::get<Guided>(given.param))]);
};
INSTANTIATE_TEST_SUITE_P(Starts, Reciprocal,
                         ::testing::Combine(::testing::ValuesIn(cases()),
                                            ::testing::Values(Guided::No, Guided::Wide,
                                                              Guided::Narrow)),
                         kName);

}  // namespace
}  // namespace etendue
