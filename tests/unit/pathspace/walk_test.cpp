// Russian roulette of walks: the throughput of a surviving walk is that without roulette, divided by the probability of
// survival.
// Also: walks that meet a surface edge-on.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "math/statistics.h"
#include "math/warp.h"
#include "pathspace/walk.h"
#include "test_scenes.h"

namespace etendue {
namespace {

struct Walks : ::testing::Test {
    const Scene scene = test::build(test::mixed_room(test::front_camera(8)));
    const Film film{scene.film(), scene.filter()};
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .connect = 1, .splat = 64};
    RenderStats stats;

    /// A sub-path of the same numbers with any options.
    template <TransportMode mode>
    void walk(uint32_t index, const WalkOptions& options, SubPath& path) {
        Sampler sampler(SamplerKind::Independent, 3);
        sampler.start(index, index % 64);
        const WalkContext context{scene, counts, stats, options};
        if (mode == TransportMode::Radiance)
            trace_eye_path(context, film, index % 64, sampler, path);
        else
            trace_light_path(context, sampler, path);
    }

    template <TransportMode mode>
    void expect_expected_throughput() {
        constexpr int kFirst = 2, kVertices = 7;
        double survived = 0, expected = 0, variance = 0;
        SubPath with, without;
        for (uint32_t index = 0; index < 20000; ++index) {
            walk<mode>(index, {kVertices, kFirst}, with);
            walk<mode>(index, {kVertices, 1000}, without);
            ASSERT_LE(with.size(), without.size());
            double q = 1;
            for (int i = 0; i < with.size(); ++i) {
                const Rgb a = with[i].beta, b = without[i].beta;
                for (int c = 0; c < 3; ++c)
                    ASSERT_NEAR(a[c] * q, b[c], 1e-4 * std::fabs(b[c])) << "vertex " << i;
                if (i < kFirst || with[i].kind != Vertex::Kind::Surface) continue;
                q *= double(with[i].survival.value());
                // A walk that ends here is ended by roulette if the walk without roulette continues.
                if (i + 1 == without.size()) continue;
                const double survival = double(with[i].survival.value());
                survived += i + 1 < with.size();
                expected += survival;
                variance += survival * (1 - survival);
            }
        }
        EXPECT_GT(variance, 1000) << "roulette hardly plays";
        EXPECT_LT(std::fabs(survived - expected), 4 * std::sqrt(variance))
            << survived << " survived, expected " << expected;
    }
};

TEST_F(Walks, RouletteKeepsTheExpectedThroughputOfEyePaths) {
    expect_expected_throughput<TransportMode::Radiance>();
}

TEST_F(Walks, RouletteKeepsTheExpectedThroughputOfLightPaths) {
    expect_expected_throughput<TransportMode::Importance>();
}

/// What a walk meets is visible from where it left, behind masks, and out of and into glass as well: states of chains
/// trace the edges of walks again.
template <TransportMode mode>
void expect_visible_edges(const Scene& scene) {
    const Film film{scene.film(), scene.filter()};
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .connect = 1, .splat = 64};
    RenderStats stats;
    const WalkContext walk{scene, counts, stats, {12, 100}};
    SubPath path;
    int edges = 0, hidden = 0;
    for (uint32_t index = 0; index < 20000; ++index) {
        Sampler sampler(SamplerKind::Independent, 3);
        sampler.start(index, index % 64);
        if (mode == TransportMode::Radiance)
            trace_eye_path(walk, film, index % 64, sampler, path);
        else
            trace_light_path(walk, sampler, path);
        for (int i = 2; i < path.size(); ++i) {
            if (path[i].kind != Vertex::Kind::Surface) continue;
            ++edges;
            hidden += scene.transmittance(path[i - 1].ray_end(), path[i].ray_end()) == 0;
        }
    }
    EXPECT_GT(edges, 50000);
    EXPECT_EQ(hidden, 0);
}

TEST(EdgesOfWalks, AreVisible) {
    const std::string masked =
        "<bsdf type=\"mask\"><texture name=\"opacity\" type=\"checkerboard\"><float "
        "name=\"color0\" value=\"0.2\"/><float name=\"color1\" value=\"0.9\"/><transform "
        "name=\"to_uv\"><scale value=\"3\"/></transform></texture>" +
        test::diffuse("0.6,0.5,0.4") + "</bsdf>";
    for (const std::string& veil :
         {std::string(), test::rectangle("<scale value=\"0.9\"/><rotate x=\"1\" angle=\"-60\"/>"
                                         "<translate z=\"0.6\"/>",
                                         masked)}) {
        SCOPED_TRACE(veil.empty() ? "room" : "veil");
        const Scene scene = test::build(test::mixed_room(test::front_camera(8)) + veil);
        expect_visible_edges<TransportMode::Radiance>(scene);
        expect_visible_edges<TransportMode::Importance>(scene);
    }
}

TEST(Survival, IsAProbability) {
    EXPECT_EQ(Survival(1).value(), 1);
    EXPECT_EQ(Survival(0.5f).value(), 0.5f);
    for (const float q : {2.0f, kInf, std::nanf("")}) EXPECT_EQ(Survival(q).value(), 1) << q;
    for (const float q : {0.0f, -0.0f, -1.0f, -kInf, 1e-30f})
        EXPECT_EQ(Survival(q).value(), 0x1p-10f) << q;
    for (unsigned steps = 0; steps < 1024; ++steps)
        EXPECT_EQ(Survival(Survival::from_steps(steps).value()).steps(), steps);
}

/// Materials as walks sample them: the mean throughput of a step is the albedo, whatever numbers the walk reads.
class ScatteringOfWalks : public ::testing::TestWithParam<std::string> {};

const std::string kBlack =
    "<bsdf type=\"lobesum\"><rgb name=\"diffuse_reflectance\" value=\"0\"/><rgb "
    "name=\"glossy_reflectance\" value=\"0\"/></bsdf>";
std::string mixed(const std::string& weights, const std::string& parts) {
    return "<bsdf type=\"mixturebsdf\"><boolean name=\"ensure_energy_conservation\" "
           "value=\"false\"/><string name=\"weights\" value=\"" +
           weights + "\"/>" + parts + "</bsdf>";
}

template <TransportMode mode>
void expect_albedo(const std::string& bsdf) {
    const Scene scene = test::build(
        test::sensor("1,0.5,3", "0,0,0", 1, "1") + test::rectangle("<scale value=\"5\"/>", bsdf) +
        "<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"1\"/><float "
        "name=\"beam_width\" value=\"0.9\"/><transform name=\"to_world\"><lookat "
        "origin=\"1,0.5,3\" "
        "target=\"0,0,0\" up=\"0,1,0\"/></transform></emitter>");
    const Film film(scene.film(), scene.filter());
    RenderStats stats;
    const TechniqueCounts counts;
    const WalkContext walk{scene, counts, stats, {3, 100}};
    SubPath path;
    Moments of_walks, of_values;
    for (uint32_t i = 0; i < 10000; ++i) {
        Sampler sampler(SamplerKind::Independent, 5);
        sampler.start(i, 0);
        if (mode == TransportMode::Radiance)
            start_eye_path(walk, film, 0, sampler, path);
        else
            ASSERT_TRUE(start_light_path(walk, sampler, path));
        ASSERT_EQ(path.size(), 2);
        const auto s = sample_scattering<mode>(walk, sampler, path);
        of_walks.add(s && !s->is_delta ? double(luminance(s->weight)) : 0);
        sampler.seek(Stream::Auxiliary, 0);
        const Vec3 w = sample_uniform_sphere(sampler.next_2d());
        of_values.add(4 * M_PI * double(luminance(path[1].eval(w, mode).f)));
    }
    EXPECT_LT(std::fabs(of_walks.mean() - of_values.mean()),
              5 * std::sqrt(of_walks.squared_error() + of_values.squared_error()) + 1e-6)
        << of_walks.mean() << " and " << of_values.mean() << ", " << bsdf;
    EXPECT_LT(std::sqrt(of_values.squared_error()), 0.03 * of_values.mean() + 1e-6) << bsdf;
}

TEST_P(ScatteringOfWalks, HasTheMeanOfItsValues) {
    const std::string part = GetParam(), diffuse = test::diffuse("0.8,0.6,0.4");
    for (const std::string& bsdf :
         {part, mixed("0.5", part), mixed("0.5, 0", part + diffuse),
          mixed("0.3, 0.5", part + diffuse), mixed("1.4", part), mixed("0.9, 0.7", part + diffuse),
          mixed("0.6, 0.4", kBlack + part),
          "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.3\"/>" + kBlack + part +
              "</bsdf>"}) {
        expect_albedo<TransportMode::Radiance>(bsdf);
        expect_albedo<TransportMode::Importance>(bsdf);
    }
}

/// As broad as the uniform directions that measure the values.
std::vector<std::string> broad_materials() {
    std::vector<std::string> all;
    for (const auto& [type, alpha] :
         std::vector<std::pair<const char*, const char*>>{{"diffuse", ""},
                                                          {"orennayar", ""},
                                                          {"diffusetransmission", ""},
                                                          {"roughconductor", "alpha"},
                                                          {"plastic", ""},
                                                          {"roughplastic", "alpha"},
                                                          {"phong", ""},
                                                          {"principled", ""},
                                                          {"openpbr", "specular_roughness"},
                                                          {"coatedconductor", "alpha"},
                                                          {"fresnelblend", "alpha"}})
        all.push_back(
            fmt::format("<bsdf type=\"{}\">{}</bsdf>", type,
                        *alpha ? fmt::format("<float name=\"{}\" value=\"0.6\"/>", alpha) : ""));
    return all;
}

INSTANTIATE_TEST_SUITE_P(Materials, ScatteringOfWalks, ::testing::ValuesIn(broad_materials()));

/// A unit sphere before a sky, which a ray along -x meets at the height `z`.
struct Grazing : ::testing::Test {
    const Scene scene = test::build(
        test::front_camera(8) + test::sphere("0,0,0", "1", test::diffuse("0.5,0.5,0.5")) +
        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1,1,1\"/></emitter>");
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .connect = 1, .splat = 64};
    RenderStats stats;
    SubPath path;

    bool append_at(float z) {
        path.clear();
        Vertex& v = path.append();
        v.kind = Vertex::Kind::Sensor;
        v.p = {5, 0, z};
        v.ng = {-1, 0, 0};
        v.beta = Rgb(1);
        Sampler sampler(SamplerKind::Independent, 1);
        sampler.start(0, 0);
        return append<TransportMode::Radiance>({scene, counts, stats, {}}, sampler,
                                               {.wi = {-1, 0, 0}, .weight = Rgb(1), .pdf = 1},
                                               path);
    }
};

TEST_F(Grazing, ASurfaceMetEdgeOnEndsTheWalk) {
    ASSERT_TRUE(append_at(0.5f));
    EXPECT_EQ(path[1].kind, Vertex::Kind::Surface);
    EXPECT_GT(path[1].pdf_fwd, 0);

    EXPECT_FALSE(append_at(1)) << "the density of a vertex there is 0";
    EXPECT_EQ(path.size(), 1);
    EXPECT_LT(path.flight.length, kInf) << "the sky does not shine through";

    ASSERT_TRUE(append_at(1.5f));
    EXPECT_TRUE(path[1].is_infinite);
}

}  // namespace
}  // namespace etendue
