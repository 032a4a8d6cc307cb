// The number of light paths in a pass changes the noise of a method, not its mean.

#include <algorithm>

#include <gtest/gtest.h>

#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr int kCountSize = 8, kPixels = kCountSize * kCountSize;

/// The methods with the parameter light_paths. Those that estimate densities have a fixed radius, so that all have the
/// same bias.
std::vector<std::string> methods() {
    std::vector<std::string> all;
    for (const IntegratorEntry& e : integrator_registry()) {
        const auto has = [&](const std::string& name) {
            return std::ranges::any_of(e.info.params,
                                       [&](const ParamInfo& p) { return p.name == name; });
        };
        if (!has("light_paths")) continue;
        IntegratorSpec spec{e.info.name, {{"max_depth", "6"}}};
        if (has("radius")) spec.params["radius"] = "0.3";
        if (has("alpha")) spec.params["alpha"] = "1";
        if (has("nearest")) spec.params["nearest"] = "512";
        if (has("retrace")) spec.params["retrace"] = "true";
        if (has("chains")) spec.params["chains"] = "4";
        if (has("groups")) spec.params["groups"] = "8";
        all.push_back(spec.to_string());
    }
    return all;
}

class NumberOfLightPaths : public ::testing::TestWithParam<std::string> {};

TEST_P(NumberOfLightPaths, KeepsTheMean) {
    // Lamp and lens are hit by both kinds of paths, so all techniques have a part.
    const Scene scene = build(sensor("0,0,3.4", "0,0,0", kCountSize, "45",
                                     "<float name=\"aperture_radius\" value=\"0.3\"/><float "
                                     "name=\"focus_distance\" value=\"3\"/>",
                                     "thinlens") +
                              room() + area_lamp() + sphere("0,-0.4,0", "0.4", kRoughMetal));
    const auto image = [&](int light_paths) {
        IntegratorSpec spec = IntegratorSpec::parse(GetParam());
        spec.params["light_paths"] = std::to_string(light_paths);
        return render_tiles(scene, spec.to_string(), {.passes = 512, .tiles = 2});
    };
    const Tiles usual = image(kPixels);
    for (const int light_paths : {kPixels / 4, 4 * kPixels})
        expect_same_image(image(light_paths), usual, 0.2,
                          GetParam() + ", " + std::to_string(light_paths) + " light paths");
}

INSTANTIATE_TEST_SUITE_P(Methods, NumberOfLightPaths, ::testing::ValuesIn(methods()),
                         [](const auto& p) {
                             std::string name = p.param.substr(0, p.param.find(':'));
                             std::ranges::replace(name, '+', '_');
                             return name + std::to_string(p.index);
                         });

}  // namespace
}  // namespace etendue::test
