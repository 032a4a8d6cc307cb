// Russian roulette before shadow rays has an effect in every integrator that has the parameter.

#include <algorithm>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

uint64_t joins_skipped(const Scene& scene, const std::string& spec) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(spec);
    settings.spp = 6;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, false);
    return renderer.stats().joins_skipped;
}

TEST(Roulette, SkipsJoinsWhereItIsAParameter) {
    const Scene scene = build(sensor("0,0,3.4", "0,0,0", 16) + room() + area_lamp());
    for (const IntegratorEntry& entry : integrator_registry()) {
        const auto has = [&](std::string_view name) {
            return std::ranges::any_of(entry.info.params,
                                       [&](const ParamInfo& p) { return p.name == name; });
        };
        if (!has("eorr")) continue;
        const std::string name = entry.info.name,
                          few = has("light_paths") ? ",light_paths=256" : "";
        EXPECT_GT(joins_skipped(scene, name + ":roulette=0.2" + few), 0u) << name;
        EXPECT_GT(joins_skipped(scene, name + ":eorr=true" + few), 0u) << name;
        EXPECT_EQ(joins_skipped(scene, name + ":roulette=0" + few), 0u) << name;
    }
}

}  // namespace
}  // namespace etendue::test
