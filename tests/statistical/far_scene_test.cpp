// Images do not depend on where the scene lies: 10⁴ units from the origin, where positions are rounded to a thousandth of
// the scene's size; nor on an object at the origin, with which the bounds of the scene say nothing about what is seen.

#include "lit_room.h"
#include "render_tiles.h"

namespace etendue::test {
namespace {

class FarScene : public ::testing::TestWithParam<std::string> {};

/// Samples per pixel, and the relative error of the image's mean that the test sees.
struct Effort {
    uint64_t spp = 16;
    double resolution = 0.08;
};
Effort effort_for(const std::string& integrator) {
    if (integrator == "upg") return {.resolution = 0.5};
    if (integrator == "ppm" || integrator == "sppm") return {.spp = 128, .resolution = 0.2};
    if (integrator == "mlt") return {.spp = 24, .resolution = 0.12};
    return {};
}

/// Means of tiles over independent renderings.
Tiles render_independently(const Scene& scene, const std::string& integrator, uint64_t first_seed) {
    constexpr int kTiles = 2, kRenderings = 48;
    Tiles tiles(kTiles);
    for (int i = 0; i < kRenderings; ++i) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(integrator);
        settings.seed = first_seed + uint64_t(i);
        settings.spp = effort_for(integrator).spp;
        Renderer renderer(scene, settings);
        const std::atomic<bool> interrupted{false};
        renderer.run([](const Progress&) {}, interrupted);
        const std::vector<double> means = tile_means(renderer.film().image(), scene.film(), kTiles);
        for (size_t j = 0; j < means.size(); ++j) tiles.values[j].add(means[j]);
    }
    return tiles;
}

void expect_same_image_far_away(const std::string& integrator, bool has_sky,
                                bool has_object_at_origin) {
    const Scene near = lit_room({.has_sky = has_sky}),
                far = lit_room({.origin = {10000, -20000, 5000},
                                .has_object_at_origin = has_object_at_origin,
                                .has_sky = has_sky});
    expect_same_image(render_independently(far, integrator, 1000),
                      render_independently(near, integrator, 1), effort_for(integrator).resolution,
                      integrator);
}

TEST_P(FarScene, HasTheSameImage) {
    expect_same_image_far_away(GetParam(), true, false);
}

TEST_P(FarScene, HasTheSameImageWhateverIsAtTheOrigin) {
    expect_same_image_far_away(GetParam(), false, true);
}

INSTANTIATE_TEST_SUITE_P(Long, FarScene, ::testing::ValuesIn(all_integrators()),
                         name_of_integrator);

}  // namespace
}  // namespace etendue::test
