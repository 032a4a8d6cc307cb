// Markov chains: filters and crops, path lengths, and the same image from few groups as from many.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render_tiles.h"
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

/// A few chains that go on for long agree with many that only start, by runs with seeds of their own.
TEST(LongChains, GoOnAsTheyBegan) {
    const Scene scene = build(mixed_room(front_camera(12)));
    for (const char* name : {"pssmlt", "mmlt", "mlt"}) {
        std::array<Tiles, 2> tiles{Tiles(4), Tiles(4)};
        for (uint64_t run = 0; run < 40; ++run)
            for (size_t i = 0; i < 2; ++i) {
                RenderSettings settings;
                settings.integrator = IntegratorSpec::parse(
                    fmt::format("{}:chains={},groups={}", name, i == 0 ? 24 : 48, i == 0 ? 2 : 16));
                settings.seed = 2 * run + i;
                settings.threads = 1;
                settings.spp = i == 0 ? 64 : 16;
                Renderer renderer(scene, settings);
                renderer.run([](const Progress&) {}, std::atomic<bool>{false});
                const auto means = tile_means(renderer.film().image(), scene.film(), 4);
                for (size_t k = 0; k < means.size(); ++k) tiles[i].values[k].add(means[k]);
            }
        expect_same_image(tiles[0], tiles[1], 0.1, name);
    }
}

}  // namespace
}  // namespace etendue::test
