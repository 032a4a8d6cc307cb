// Images do not depend on the unit of radiance: scaling all emitters by a power of two scales every pixel exactly.

#include <cctype>
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

std::string scaled_rgb(const char* name, Rgb value, float factor) {
    return fmt::format("<rgb name=\"{}\" value=\"{:.9g},{:.9g},{:.9g}\"/>", name, value.r * factor,
                       value.g * factor, value.b * factor);
}

/// A room with glass, rough and smooth, seen through a lens: every technique has something to do. The tent makes splats
/// reach several pixels.
Scene lit_room(float factor) {
    std::string camera = lens_camera(16);
    const std::string box = "<rfilter type=\"box\"/>";
    camera.replace(camera.find(box), box.size(), "<rfilter type=\"tent\"/>");
    const std::string lamp =
        rectangle("<scale value=\"0.25\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.98\"/>",
                  diffuse("0.5,0.5,0.5") + "<emitter type=\"area\">" +
                      scaled_rgb("radiance", {12, 11, 9}, factor) + "</emitter>");
    return build(camera + room() + lamp + sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) +
                 sphere("0.4,-0.65,0.3", "0.3", kRoughGlass) +
                 sphere("0.1,0.2,-0.1", "0.2", kGlass) +
                 "<emitter type=\"point\"><point name=\"position\" value=\"0.3,0.1,0.7\"/>" +
                 scaled_rgb("intensity", {0.3f, 0.5f, 0.4f}, factor) +
                 "</emitter><emitter type=\"constant\">" +
                 scaled_rgb("radiance", {0.3f, 0.4f, 0.5f}, factor) + "</emitter>");
}

struct Rendering {
    std::vector<Rgb> image, variance;
    ErrorEstimate error;
    RenderStats stats;
};

Rendering render(float factor, const std::string& integrator) {
    const Scene scene = lit_room(factor);
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.sampler = SamplerKind::Sobol;
    settings.spp = 16;  // enough for an estimate of the error, from groups of chains too
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    return {renderer.film().image(), renderer.film().variance(), renderer.film().error(),
            renderer.stats()};
}

/// Of a against b · factor.
size_t different(const std::vector<Rgb>& a, const std::vector<Rgb>& b, float factor) {
    size_t count = 0;
    for (size_t i = 0; i < a.size(); ++i)
        for (int c = 0; c < 3; ++c) count += a[i][c] != b[i][c] * factor;
    return count;
}

class UnitOfRadiance : public ::testing::TestWithParam<std::string> {};

TEST_P(UnitOfRadiance, ChangesNoBit) {
    const Rendering one = render(1, GetParam());
    ASSERT_TRUE(one.error.valid);
    for (const float factor : {0x1p40f, 0x1p-40f}) {
        SCOPED_TRACE(factor);
        const Rendering other = render(factor, GetParam());
        EXPECT_EQ(different(other.image, one.image, factor), 0u) << "of " << 3 * one.image.size();
        EXPECT_EQ(different(other.variance, one.variance, factor * factor), 0u);
        EXPECT_EQ(other.error.relative_rms, one.error.relative_rms);
        EXPECT_EQ(other.stats.rays(), one.stats.rays());
        EXPECT_EQ(other.stats.joins_skipped, one.stats.joins_skipped);
    }
}

std::vector<std::string> all_integrators() {
    std::vector<std::string> all;
    for (const IntegratorEntry& e : integrator_registry()) {
        const std::string name = e.info.name;
        all.push_back(name == "pm"    ? "pm:light_paths=2000"
                      : name == "mps" ? "mps:mutations=2000,precision=0.2"
                                      : name);
    }
    all.insert(all.end(),
               {"bdpt:eorr=true", "bdpt:connections=cache", "vcm:radius=0.3",
                "vcm:radius=0.3,exact=true", "pm:light_paths=2000,cache_error=0.3,cache_rays=32"});
    return all;
}

INSTANTIATE_TEST_SUITE_P(Integrators, UnitOfRadiance, ::testing::ValuesIn(all_integrators()),
                         [](const auto& p) {
                             std::string name = p.param;
                             for (char& c : name)
                                 if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                             return name;
                         });

}  // namespace
}  // namespace etendue::test
