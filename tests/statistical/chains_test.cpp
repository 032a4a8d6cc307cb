// Markov chains: filters and crops, path lengths, and the same image from few groups as from many.

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lit_room.h"
#include "render_tiles.h"
#include "run_program.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

std::string part_of_film(const std::string& filter) {
    return "<sensor type=\"perspective\"><float name=\"fov\" value=\"45\"/><transform "
           "name=\"to_world\"><lookat origin=\"0,0,3.4\" target=\"0,0,0\" up=\"0,1,0\"/>"
           "</transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"12\"/><integer "
           "name=\"height\" value=\"12\"/><integer name=\"crop_offset_x\" value=\"3\"/><integer "
           "name=\"crop_offset_y\" value=\"2\"/><integer name=\"crop_width\" "
           "value=\"8\"/><integer name=\"crop_height\" value=\"8\"/><rfilter type=\"" +
           filter + "\"/></film></sensor>";
}

/// The mean of independent images.
Tiles mean_of(const std::vector<Tiles>& images) {
    Tiles mean = images.front();
    const auto n = double(images.size());
    for (size_t i = 0; i < mean.values.size(); ++i) {
        double sum = 0, squared_error = 0;
        int64_t count = 0;
        for (const Tiles& image : images) {
            sum += image.values[i].mean();
            squared_error += image.values[i].squared_error();
            count += image.values[i].count();
        }
        mean.values[i] = Moments::estimate(sum / n, squared_error / (n * n), count);
    }
    return mean;
}

class ChainFilms : public ::testing::TestWithParam<const char*> {};

/// The film point is drawn from the crop and what filters reach beyond it. Every pixel is a tile.
TEST_P(ChainFilms, AreThoseOfBidirectionalPathTracing) {
    const Scene scene = build(part_of_film(GetParam()) + room() + area_lamp() +
                              sphere("-0.4,-0.5,0", "0.4", kGlass));
    // The negative parts of a filter add noise.
    const uint64_t seeds = std::string(GetParam()) == "lanczos" ? 3 : 1;
    const Tiles bdpt = render_tiles(scene, "bdpt", {2048 * seeds, 8, 1});
    // Every pass has chains of its own, and so has every seed.
    const auto expect_bdpt = [&](const std::string& method, uint64_t passes) {
        const std::string spec = fmt::format("{}:chains=128,groups={}", method, passes);
        std::vector<Tiles> parts;
        for (uint64_t i = 0; i < seeds; ++i)
            parts.push_back(render_tiles(scene, spec, {passes, 8, 2 + i}));
        expect_same_image(mean_of(parts), bdpt, 0.15, spec);
    };
    expect_bdpt("pssmlt", 1024);
    expect_bdpt("mmlt", 512);
    expect_bdpt("mlt", 512);
}

INSTANTIATE_TEST_SUITE_P(LongFilters, ChainFilms, ::testing::Values("box", "tent", "lanczos"),
                         [](const auto& p) { return std::string(p.param); });

class ChainLengths : public ::testing::TestWithParam<const char*> {};

/// The longest path, whether or not it has a class of its own, and unlimited ones in one class.
TEST_P(ChainLengths, EndWhereTheyShould) {
    const Scene scene = build(front_camera(12) + room() + area_lamp());
    const std::string method = GetParam();
    const size_t at = method.find("max_depth");
    const std::string depth = at == std::string::npos ? "" : ":" + method.substr(at);
    // Without directly seen lamps, whose noise is far above that of the chains.
    expect_same_image(
        render_tiles(scene, method, {.passes = 256, .seed = 2, .shortest = 2}),
        render_tiles(scene, "bdpt" + depth, {.passes = 512, .seed = 1, .shortest = 2}), 0.1,
        method);
}

INSTANTIATE_TEST_SUITE_P(Depths, ChainLengths,
                         ::testing::Values("pssmlt:chains=16,groups=256,max_depth=2",
                                           "pssmlt:chains=16,groups=256,max_depth=4",
                                           "mmlt:chains=16,groups=256,max_depth=3",
                                           "mmlt:chains=16,groups=256,max_depth=5",
                                           "mmlt:chains=16,groups=256,lengths=2,max_depth=6",
                                           "mmlt:chains=16,groups=256,lengths=1",
                                           "mlt:chains=16,groups=256,max_depth=3",
                                           "mlt:chains=16,groups=256,max_depth=5"));

/// A scene, and methods with chains that go on for long there.
struct LongCase {
    const char* name;
    std::string xml;
    std::vector<std::string> methods{"mlt"};
    const char* user_paths = nullptr;  ///< Text of a file.
    uint64_t runs = 64;
};
void PrintTo(const LongCase& c, std::ostream* out) {
    *out << c.name;
}

std::vector<LongCase> long_cases() {
    constexpr int kSize = 12;
    const std::string front = front_camera(kSize);
    const std::string kMasked =
        "<bsdf type=\"mask\"><texture name=\"opacity\" type=\"checkerboard\"><float "
        "name=\"color0\" value=\"0.2\"/><float name=\"color1\" value=\"0.9\"/><transform "
        "name=\"to_uv\"><scale value=\"2\"/></transform></texture>" +
        diffuse("0.6,0.5,0.4") + "</bsdf>";
    const std::string kTinted =
        "<bsdf type=\"roughdielectric\"><float name=\"alpha\" value=\"0.3\"/></bsdf><medium "
        "type=\"homogeneous\" name=\"interior\"><rgb name=\"sigma_t\" value=\"0.5,1.5,4\"/>"
        "<float name=\"albedo\" value=\"0\"/></medium>";
    const std::string kGloss =
        "<bsdf type=\"twosided\"><bsdf type=\"blendbsdf\"><float name=\"weight\" "
        "value=\"0.4\"/><bsdf type=\"diffuse\"/><bsdf type=\"conductor\"/></bsdf></bsdf>";
    const std::string veil =
        front + room() + area_lamp() +
        rectangle("<scale value=\"0.8\"/><rotate x=\"1\" angle=\"-60\"/><translate z=\"0.3\"/>",
                  kMasked);
    return {
        {"mixed", mixed_room(front), {"pssmlt", "mmlt", "mlt"}},
        {"veil", veil, {"pssmlt", "mmlt", "mlt"}},
        {"thinlens", mixed_room(lens_camera(kSize))},
        {"orthographic", mixed_room(sensor("0,0,3.4", "0,0,0", kSize, "", "", "orthographic"))},
        {"gloss", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", kGloss)},
        {"medium", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", kTinted)},
        {"several",
         front + room() + area_lamp() + sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) +
             "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.5\"/></emitter>"
             "<emitter type=\"point\"><point name=\"position\" value=\"0.4,0.8,0.6\"/></emitter>"},
        {"lantern", front + room() + area_lamp("1,1,1") + sphere("-0.2,-0.3,0.1", "0.4", kGlass) +
                        sphere("-0.15,-0.3,0.15", "0.1",
                               "<emitter type=\"area\"><rgb name=\"radiance\" value=\"20\"/>"
                               "</emitter>")},
        {"user_paths",
         mixed_room(front),
         {"mlt"},
         R"([{"points": [[0, 0.98, 0], [-1, 0, 0.3]], "cone": 20, "radius": 0.2},
             {"points": [[0, 0.98, 0], [0.1, -1, 0.8]], "cone": 15, "radius": 0.2}])"},
    };
}

class LongChains : public ::testing::TestWithParam<LongCase> {};

/// A few chains that go on for long, with hardly a large step, agree with bidirectional path tracing: a wrong density of a
/// mutation shows in proportion to the number of steps. By runs with seeds of their own.
TEST_P(LongChains, GoOnAsTheyBegan) {
    const Scene scene = build(GetParam().xml);
    const TemporaryFolder folder;
    std::string options;
    if (GetParam().user_paths) {
        const std::filesystem::path file = folder.path() / "paths.json";
        std::ofstream(file) << GetParam().user_paths;
        options = ",user_paths=" + file.string();
    }
    const Tiles bdpt = render_tiles(scene, "bdpt", {4096, 4, 1});
    for (const std::string& method : GetParam().methods) {
        Tiles tiles(4);
        for (uint64_t run = 0; run < GetParam().runs; ++run) {
            RenderSettings settings;
            settings.integrator = IntegratorSpec::parse(
                fmt::format("{}:chains=48,groups=2,p_large=0.01,mutations=4{}", method, options));
            settings.seed = 2 + run;
            settings.threads = 1;
            settings.spp = 48;
            Renderer renderer(scene, settings);
            renderer.run([](const Progress&) {}, std::atomic<bool>{false});
            const auto means = tile_means(renderer.film().image(), scene.film(), 4);
            for (size_t k = 0; k < means.size(); ++k) tiles.values[k].add(means[k]);
        }
        expect_same_image(tiles, bdpt, GetParam().runs < 64 ? 0.2 : 0.1, method);
    }
}

/// `mlt` with a quarter of the runs, in seconds: enough to see that a mask is missing in the density of the mutations.
std::vector<LongCase> few_runs() {
    std::vector<LongCase> cases = long_cases();
    // Its noise needs all runs; and the others have what `mixed` has.
    std::erase_if(cases, [](const LongCase& c) {
        return c.name == std::string("orthographic") || c.name == std::string("mixed");
    });
    for (LongCase& c : cases) c.methods = {"mlt"}, c.runs = 16;
    return cases;
}
INSTANTIATE_TEST_SUITE_P(FewRuns, LongChains, ::testing::ValuesIn(few_runs()),
                         [](const auto& p) { return std::string(p.param.name); });
INSTANTIATE_TEST_SUITE_P(Scenes, LongChains, ::testing::ValuesIn(long_cases()),
                         [](const auto& p) { return std::string(p.param.name); });

/// An octahedron of a glass of high index, turned about the vertical, over a board below a bright panel and a sky: most of
/// its light comes after several inner reflections. `folder`: where its mesh is written.
Scene gem(int size, const std::filesystem::path& folder) {
    const std::filesystem::path file = folder / "gem.obj";
    std::ofstream(file)
        << "v 0 0.8 0\nv 0.8 0 0\nv 0 0 0.8\nv -0.8 0 0\nv 0 0 -0.8\nv 0 -0.8 0\n"
           "f 1 3 2\nf 1 4 3\nf 1 5 4\nf 1 2 5\nf 6 2 3\nf 6 3 4\nf 6 4 5\nf 6 5 2\n";
    return build(
        sensor("0,1.2,4", "0,0.3,0", size, "36") +
        "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.6\"/></emitter>" +
        rectangle("<scale value=\"0.75,1,1\"/><rotate x=\"1\" angle=\"90\"/>"
                  "<translate value=\"-1.2,3,0\"/>",
                  diffuse("0") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                 "value=\"12,11,9\"/></emitter>") +
        rectangle("<scale value=\"4\"/><rotate x=\"1\" angle=\"-90\"/><translate y=\"-0.3\"/>",
                  "<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"checkerboard\">"
                  "<rgb name=\"color0\" value=\"0.7,0.7,0.7\"/><rgb name=\"color1\" "
                  "value=\"0.1,0.2,0.1\"/><transform name=\"to_uv\"><scale value=\"8\"/>"
                  "</transform></texture></bsdf>") +
        "<shape type=\"obj\"><string name=\"filename\" value=\"" + file.string() +
        "\"/><boolean name=\"face_normals\" value=\"true\"/><transform name=\"to_world\"><rotate "
        "y=\"1\" angle=\"20\"/><translate y=\"0.55\"/></transform><bsdf type=\"dielectric\"><float "
        "name=\"int_ior\" value=\"2.4\"/></bsdf></shape>");
}

/// A method in the gem, and the number of its seeds. Its states are single paths, or all paths of two sub-paths.
struct SeedCase {
    std::string method;
    uint64_t seeds;
    double spread = 1;  ///< Largest relative standard deviation of the means of seeds.
};
void PrintTo(const SeedCase& c, std::ostream* out) {
    *out << c.method;
}

/// Renderings with other seeds have the mean of bidirectional path tracing, and differ by no more than by the errors that
/// they state: none settles in a part of the paths, and none finds too few of them. Rare paths make the distribution skew, so
/// that many seeds are needed.
class ChainSeeds : public ::testing::TestWithParam<SeedCase> {};

TEST_P(ChainSeeds, AgreeWithinTheErrorsThatTheyState) {
    const auto& [method, seeds, spread] = GetParam();
    const TemporaryFolder folder;
    const Scene scene = gem(12, folder.path());
    const size_t at = method.find("max_depth");
    const std::string depth = at == std::string::npos ? "" : ":" + method.substr(at);
    Tiles tiles(1);
    Moments means;
    double stated = 0;
    for (uint64_t seed = 0; seed < seeds; ++seed) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(method);
        settings.seed = 20 + seed;
        settings.threads = 1;
        settings.spp = 64;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>{false});
        const auto values = tile_means(renderer.film().image(), scene.film(), 1);
        for (size_t k = 0; k < values.size(); ++k) tiles.values[k].add(values[k]);
        const Film::MeanEstimate mean = renderer.film().mean_luminance();
        means.add(mean.mean);
        stated += sqr(mean.standard_error.value()) / double(seeds);
    }
    expect_same_image(tiles, render_tiles(scene, "bdpt" + depth, {2048, 1, 1}), 0.1, method);
    const double ratio = means.variance() / stated;
    EXPECT_LT(ratio, 2.5) << method;
    EXPECT_GT(ratio, 0.3) << method;
    EXPECT_LT(std::sqrt(means.variance()) / means.mean(), spread) << method;
    RecordProperty("variance_over_stated", std::to_string(ratio));
    RecordProperty("relative_error", std::to_string(std::sqrt(means.variance()) / means.mean()));
}

const auto name_of_seeds = [](const ::testing::TestParamInfo<SeedCase>& p) {
    return name_of_integrator({p.param.method, p.index});
};
INSTANTIATE_TEST_SUITE_P(Gem, ChainSeeds,
                         ::testing::Values(SeedCase{"mmlt", 16, 0.035}, SeedCase{"mlt", 16, 0.035},
                                           SeedCase{"pssmlt", 16},
                                           SeedCase{"pssmlt:chains=32,groups=4", 24}),
                         name_of_seeds);
// Longer paths of `mmlt` and `mlt` are found so rarely that the mean of a hundred seeds is not normal.
INSTANTIATE_TEST_SUITE_P(LongGem, ChainSeeds,
                         ::testing::Values(SeedCase{"mmlt:max_depth=10", 200},
                                           SeedCase{"mlt:max_depth=10", 200},
                                           SeedCase{"mmlt:chains=32,groups=4,max_depth=10", 200},
                                           SeedCase{"mlt:chains=32,groups=4,max_depth=10", 200}),
                         name_of_seeds);

/// In a closed room of albedo 0.95, 54 % of the light has more than ten edges, those of the last class. Paths of all
/// lengths are found, with weights that do not grow without a limit.
TEST(MmltInABrightRoom, FindsLongPaths) {
    const Scene scene =
        build(sensor("0,0,0.2", "0,0,-1", 2) +
              "<shape type=\"sphere\"><boolean name=\"flip_normals\" value=\"true\"/><bsdf "
              "type=\"diffuse\"><float name=\"reflectance\" value=\"0.95\"/></bsdf><emitter "
              "type=\"area\"><float name=\"radiance\" value=\"0.05\"/></emitter></shape>");
    constexpr uint64_t kSeeds = 24;
    Moments means;
    for (uint64_t seed = 0; seed < kSeeds; ++seed) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse("mmlt:chains=32,groups=4");
        settings.seed = seed;
        settings.threads = 1;
        settings.spp = 32;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>{false});
        means.add(renderer.film().mean_luminance().mean);
    }
    EXPECT_GT(welch_p(means, Moments::exact(1), 1e-4), 1e-4)
        << means.mean() << " ± " << std::sqrt(means.squared_error());
    EXPECT_LT(std::sqrt(means.variance()), 0.05);
    RecordProperty("spread", std::to_string(std::sqrt(means.variance())));
}

/// Mean over the pixels of the variance that a rendering states, divided by that of the spread between seeds.
double stated_over_true_variance(const Scene& scene, const std::string& method,
                                 SamplerKind sampler) {
    const uint64_t pixels = scene.film().pixel_count();
    std::vector<Moments> values(pixels);
    double stated = 0, spread = 0;
    constexpr uint64_t kSeeds = 48;
    for (uint64_t seed = 0; seed < kSeeds; ++seed) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(method);
        settings.sampler = sampler;
        settings.seed = 100 + seed;
        settings.threads = 1;
        settings.spp = 64;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>{false});
        const std::vector<Rgb> image = renderer.film().image(),
                               variance = renderer.film().variance();
        for (uint64_t i = 0; i < pixels; ++i) {
            const double y = double(luminance(image[i]));
            values[i].add(y);
            // Channels have the relative variance of the luminance.
            stated += double(variance[i].g) * sqr(y / double(image[i].g)) / kSeeds;
        }
    }
    for (const Moments& m : values) spread += m.variance();
    return stated / spread;
}

/// The groups of chains are independent of each other. Their samples of direct light are so with independent numbers. With
/// Sobol' points they are negatively correlated, as passes are with other methods, and the variance is an upper bound.
class ChainErrors : public ::testing::TestWithParam<const char*> {};

TEST_P(ChainErrors, AreThoseOfSeeds) {
    const Scene scene = build(front_camera(12) + room() + area_lamp());
    const std::string method = fmt::format("{}:mutations=1", GetParam());
    const double independent = stated_over_true_variance(scene, method, SamplerKind::Independent);
    EXPECT_GT(independent, 0.8);
    EXPECT_LT(independent, 1.25);
    EXPECT_GT(stated_over_true_variance(scene, method, SamplerKind::Sobol), 0.9);
}
INSTANTIATE_TEST_SUITE_P(Quick, ChainErrors, ::testing::Values("pssmlt"));
INSTANTIATE_TEST_SUITE_P(Long, ChainErrors, ::testing::Values("mlt"));

}  // namespace
}  // namespace etendue::test
