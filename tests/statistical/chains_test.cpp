// Markov chains: filters and crops, path lengths, and the same image from few groups as from many.

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

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
        for (uint64_t run = 0; run < 64; ++run) {
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
        expect_same_image(tiles, bdpt, 0.1, method);
    }
}

INSTANTIATE_TEST_SUITE_P(Scenes, LongChains, ::testing::ValuesIn(long_cases()),
                         [](const auto& p) { return std::string(p.param.name); });

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
