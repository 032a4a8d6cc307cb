// The share of what arrives at a vertex that guided walks have to find, in closed form.

#include <gtest/gtest.h>

#include "film/film.h"
#include "integrator/guide_share.h"
#include "pathspace/walk.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr int kFilmSize = 8;
constexpr float kPathsOfLight = 64;
const TechniqueCounts kCompeting{.hit = 1, .next_event = 1, .connect = 1, .splat = kPathsOfLight};

/// G between two vertices on surfaces, each of which sends by the cosine: the density of either one from the other.
double cosine_pdf(const Vertex& from, const Vertex& to) {
    const Vec3 d = to.p - from.p;
    return double(abs_dot(from.ng, d)) * double(abs_dot(to.ng, d)) /
           (double(kPi) * sqr(double(length2(d))));
}

/// Calls `use` with walks in diffuse scenes.
template <TransportMode mode, class Use>
int for_each_walk(const Scene& scene, int vertices, const Use& use) {
    const Film film(scene.film(), scene.filter());
    RenderStats stats;
    const WalkContext context{scene, kCompeting, stats, {vertices, 100, false}};
    Sampler sampler(SamplerKind::Independent, 3);
    SubPath path;
    int long_enough = 0;
    for (uint32_t index = 0; index < 2000; ++index) {
        sampler.start(index, index % (kFilmSize * kFilmSize));
        if constexpr (mode == TransportMode::Importance)
            trace_light_path(context, sampler, path);
        else
            trace_eye_path(context, film, index % (kFilmSize * kFilmSize), sampler, path);
        if (path.size() < vertices) continue;
        ++long_enough;
        use(path);
    }
    return long_enough;
}

Scene lit_room() {
    return test::build(test::front_camera(kFilmSize) + test::room() + test::area_lamp());
}

void expect_share(float share, double walks, double join) {
    const double expected = walks / (walks + join);
    EXPECT_NEAR(share, expected, 1e-3 * expected + 1e-9);
}

/// At y_1, hits compete with next events.
TEST(GuideShare, OfDirectLightIsThatOfHits) {
    const Scene scene = lit_room();
    EXPECT_GT((for_each_walk<TransportMode::Importance>(
                  scene, 3,
                  [](const SubPath& y) {
                      const double hit = cosine_pdf(y[1], y[0]),
                                   next_event =
                                       double(y[0].pdf_fwd) * double(y[1].next_event_ratio);
                      expect_share(share_of_walks<TransportMode::Importance>(y, 1, kCompeting),
                                   sqr(hit), sqr(next_event));
                  })),
              500);
}

/// At y_2, next events at y_1 and hits of the emitter compete with the connection of y_1 and y_2.
TEST(GuideShare, OfIndirectLightIsThatOfEyeWalks) {
    const Scene scene = lit_room();
    EXPECT_GT((for_each_walk<TransportMode::Importance>(
                  scene, 4,
                  [](const SubPath& y) {
                      const double there = cosine_pdf(y[2], y[1]) / double(y[1].pdf_fwd),
                                   emitter = cosine_pdf(y[1], y[0]) / double(y[0].pdf_fwd),
                                   walks = sqr(there) *
                                           (sqr(double(y[1].next_event_ratio)) + sqr(emitter));
                      expect_share(share_of_walks<TransportMode::Importance>(y, 2, kCompeting),
                                   walks, 1);
                  })),
              300);
}

/// At z_2, splats of z_1 compete with the connection of z_1 and z_2.
TEST(GuideShare, OfImportanceIsThatOfSplats) {
    const Scene scene = lit_room();
    EXPECT_GT((for_each_walk<TransportMode::Radiance>(
                  scene, 4,
                  [](const SubPath& z) {
                      if (z[2].kind != Vertex::Kind::Surface || z[2].emitter || z[1].emitter)
                          return;
                      const double there = cosine_pdf(z[2], z[1]) / double(z[1].pdf_fwd);
                      expect_share(share_of_walks<TransportMode::Radiance>(z, 2, kCompeting),
                                   sqr(there * double(kPathsOfLight)), 1);
                  })),
              300);
}

/// Next events find all light of a point lamp, and none behind glass, where hits find that of an area lamp.
TEST(GuideShare, IsThatOfAllOrNothing) {
    const std::string floor = test::rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"2\"/>",
                                              test::diffuse("0.5,0.5,0.5"));
    const Scene point =
        test::build(test::front_camera(kFilmSize) + floor +
                    "<emitter type=\"point\"><point name=\"position\" value=\"0,1,0\"/></emitter>");
    const auto none = [](const SubPath& y) {
        EXPECT_EQ(share_of_walks<TransportMode::Importance>(y, 1, kCompeting), 0);
    };
    EXPECT_GT((for_each_walk<TransportMode::Importance>(point, 2, none)), 300);
    const Scene behind_glass = test::build(
        test::front_camera(kFilmSize) + floor +
        test::rectangle("<rotate x=\"1\" angle=\"-90\"/><scale value=\"2\"/><translate y=\"0.5\"/>",
                        "<bsdf type=\"thindielectric\"/>") +
        test::rectangle(
            "<rotate x=\"1\" angle=\"90\"/><scale value=\"0.3\"/><translate y=\"1\"/>",
            "<emitter type=\"area\"><rgb name=\"radiance\" value=\"12,11,9\"/></emitter>"));
    int behind = 0;
    for_each_walk<TransportMode::Importance>(behind_glass, 3, [&](const SubPath& y) {
        if (!y[1].is_delta || !y[2].is_connectible || y[2].emitter) return;
        ++behind;
        EXPECT_EQ(share_of_walks<TransportMode::Importance>(y, 2, kCompeting), 1);
    });
    EXPECT_GT(behind, 300);
}

}  // namespace
}  // namespace etendue
