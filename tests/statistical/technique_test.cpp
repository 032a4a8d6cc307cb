// Every technique alone. In a closed diffuse sphere that emits L_e, paths of k edges contribute L_e ρ^(k-1) to every
// pixel for every technique; G is constant there, so that no connection has infinite variance.

#include <map>
#include <tuple>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr int kTechniqueSize = 8, kLongest = 6;

struct TechniqueCase {
    const char *name, *sensor, *integrator;
    int min_pair_edges = 0;  ///< Of the paths that are made from pairs; 0: none.
    int least_s = 2;         ///< Of pairs.
};

class Techniques : public ::testing::TestWithParam<TechniqueCase> {
protected:
    /// Camera in an emitting sphere of albedo ½.
    static Scene furnace(const std::string& type) {
        const std::string lens = type == "thinlens"
                                     ? "<float name=\"aperture_radius\" value=\"0.3\"/><float "
                                       "name=\"focus_distance\" value=\"0.7\"/>"
                                     : "";
        return build(
            sensor("0.3,0.1,-0.2", "-1,-0.2,0.4", kTechniqueSize, "70", lens, type) +
            "<shape type=\"sphere\"><boolean name=\"flip_normals\" value=\"true\"/><bsdf "
            "type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.5,0.5,0.5\"/></bsdf>"
            "<emitter type=\"area\"><rgb name=\"radiance\" value=\"1,1,1\"/></emitter></shape>");
    }
    static double mean(const std::vector<Rgb>& pixels) {
        double sum = 0;
        for (Rgb c : pixels) sum += c.g;
        return sum / double(pixels.size());
    }
};

TEST_P(Techniques, AloneHaveTheMeanOfTheirLength) {
    const Scene scene = furnace(GetParam().sensor);
    constexpr int kRuns = 32;
    std::map<std::tuple<Strategy, int, int>, Moments> alone;
    std::map<int, Moments> together;  // by length
    for (int run = 0; run < kRuns; ++run) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(
            fmt::format("{}max_depth={},rr_depth=3,roulette=0", GetParam().integrator, kLongest));
        settings.seed = uint64_t(run);
        settings.threads = 1;
        settings.spp = scene.sensor().has_finite_lens() ? 64 : 32;
        settings.technique_depth = kLongest;
        Renderer renderer(scene, settings);
        const std::atomic<bool> interrupted{false};
        renderer.run([](const Progress&) {}, interrupted);
        std::map<int, double> length_sum;
        std::vector<Rgb> sum(scene.film().pixel_count());
        for (const TechniqueImages::Entry& e : renderer.techniques()->images()) {
            const Technique& q = e.technique;
            Moments& m = alone[{q.strategy, q.s, q.t}];
            while (m.count() < run) m.add(0);  // runs without contributions
            m.add(mean(e.unweighted));
            length_sum[q.vertices() - 1] += mean(e.weighted);
            for (size_t i = 0; i < sum.size(); ++i) sum[i] += e.weighted[i];
        }
        for (const auto& [length, value] : length_sum) together[length].add(value);
        // The weighted images sum to the image.
        const std::vector<Rgb> image = renderer.film().image();
        for (size_t i = 0; i < sum.size(); ++i)
            ASSERT_NEAR(sum[i].g, image[i].g, 1e-4f * image[i].g) << "pixel " << i;
    }
    for (auto& [q, m] : alone)
        while (m.count() < kRuns) m.add(0);
    const bool lens = scene.sensor().has_finite_lens();
    size_t expected_count = 0;
    const int pairs_from = GetParam().min_pair_edges;
    const bool both = std::string(GetParam().integrator).find("both") != std::string::npos;
    for (int k = 1; k <= kLongest; ++k)
        expected_count +=
            size_t(k + (k > 1) + lens) +  // no splats of paths of one edge
            (pairs_from > 0 && k >= pairs_from ? size_t(k + 1 - GetParam().least_s) : 0) +
            (both && k >= 2);
    EXPECT_EQ(alone.size(), expected_count) << "a technique made nothing";
    const double level = sidak(0.01, int(alone.size() + together.size()));
    // Few light paths hit the lens.
    const auto expect_mean = [&](const Moments& m, int length, bool is_rare,
                                 const std::string& what) {
        const double exact = std::pow(0.5, length - 1);
        EXPECT_GE(welch_p(m, Moments::exact(exact), kRounding * exact), level)
            << what << ": " << m.mean() << " against " << exact << ", ratio " << m.mean() / exact
            << " ± " << std::sqrt(m.squared_error()) / exact;
        EXPECT_LT(4 * std::sqrt(m.squared_error()), (is_rare ? 0.9 : 0.2) * exact)
            << what << ": too few samples";
    };
    for (const auto& [q, m] : alone) {
        const auto [strategy, s, t] = q;
        expect_mean(m, s + t - 1 - is_pair(strategy), t == 0,
                    fmt::format("strategy {}, s = {}, t = {}", int(strategy), s, t));
    }
    for (const auto& [length, m] : together)
        expect_mean(m, length, false, fmt::format("length {}, weighted", length));
}

/// An image of selected paths is the sum of the weighted images of their techniques.
TEST(PathSelection, ImagesAreTheSumOfTheirTechniques) {
    const Scene scene = build(front_camera(kTechniqueSize) + room() + area_lamp());
    const auto render = [&](const PathSelection& shown) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse("bdpt:max_depth=4,roulette=0");
        settings.spp = 4;
        settings.technique_depth = 4;
        settings.shown = shown;
        auto renderer = std::make_unique<Renderer>(scene, settings);
        const std::atomic<bool> interrupted{false};
        renderer->run([](const Progress&) {}, interrupted);
        return renderer;
    };
    const auto all = render({})->techniques()->images();
    const auto expect_sum = [&](const PathSelection& shown, const auto& is_shown) {
        const std::vector<Rgb> image = render(shown)->film().image();
        std::vector<Rgb> sum(image.size());
        for (const TechniqueImages::Entry& e : all)
            if (is_shown(e.technique.s, e.technique.t))
                for (size_t i = 0; i < sum.size(); ++i) sum[i] += e.weighted[i];
        for (size_t i = 0; i < sum.size(); ++i) EXPECT_NEAR(image[i].g, sum[i].g, 1e-4f * sum[i].g);
    };
    expect_sum({.inner_only = true}, [](int s, int t) { return s >= 1 && t >= 2; });
    expect_sum({.shortest = 2, .longest = 3},
               [](int s, int t) { return s + t - 1 == 2 || s + t - 1 == 3; });
    expect_sum({.inner_only = true, .shortest = 3},
               [](int s, int t) { return s >= 1 && t >= 2 && s + t - 1 >= 3; });
}

INSTANTIATE_TEST_SUITE_P(
    Sensors, Techniques,
    ::testing::Values(TechniqueCase{"perspective", "perspective", "bdpt:"},
                      TechniqueCase{"thinlens", "thinlens", "bdpt:"},
                      TechniqueCase{"gathers", "perspective", "upg+bdpt:radius=0.4,", 3},
                      TechniqueCase{"merges", "perspective", "vcm:radius=0.35,", 3, 3},
                      TechniqueCase{"exact_merges", "perspective", "vcm:exact=true,radius=0.2,", 2},
                      TechniqueCase{"stored", "perspective",
                                    "pcbpt:direct=stored,uniform=0.1,connections=1.5,"},
                      TechniqueCase{"stored_standard", "thinlens",
                                    "pcbpt:weights=standard,connections=10,"
                                    "light_paths=20,direct=both,"},
                      TechniqueCase{"stored_exact", "perspective",
                                    "pcbpt:cache=false,pmf=weighted,"
                                    "light_paths=10,direct=next_event,"}),
    [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace etendue::test
