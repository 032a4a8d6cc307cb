// Images do not depend on the units of radiance and length: scaling all emitters by a power of two scales every pixel
// exactly, and scaling the scene by one changes nothing.

#include <cctype>
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// Factors, relative to the units of the scene below.
struct Units {
    float radiance = 1, length = 1;
};
void PrintTo(const Units& u, std::ostream* out) {
    *out << "radiance * " << u.radiance << ", length * " << u.length;
}

std::string rgb(const char* name, Rgb value, float factor) {
    return fmt::format("<rgb name=\"{}\" value=\"{:.9g},{:.9g},{:.9g}\"/>", name, value.r * factor,
                       value.g * factor, value.b * factor);
}
std::string vec(Vec3 v, float factor) {
    return fmt::format("{:.9g},{:.9g},{:.9g}", v.x * factor, v.y * factor, v.z * factor);
}

/// A room with glass, rough and smooth, seen through a lens: every technique has something to do. The tent makes splats
/// reach several pixels.
Scene lit_room(Units u) {
    const auto placed = [&](const std::string& transform) {
        return fmt::format("{}<scale value=\"{:.9g}\"/>", transform, u.length);
    };
    const auto ball = [&](Vec3 center, float radius, const std::string& bsdf) {
        return sphere(vec(center, u.length), fmt::format("{:.9g}", radius * u.length), bsdf);
    };
    const auto wall = [&](const std::string& transform, const char* reflectance) {
        return rectangle(placed(transform), diffuse(reflectance));
    };
    const std::string camera = fmt::format(
        "<sensor type=\"thinlens\"><float name=\"fov\" value=\"45\"/><float "
        "name=\"aperture_radius\" value=\"{:.9g}\"/><float name=\"focus_distance\" "
        "value=\"{:.9g}\"/><transform name=\"to_world\"><lookat origin=\"{}\" target=\"0,0,0\" "
        "up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" "
        "value=\"16\"/><integer name=\"height\" value=\"16\"/><rfilter type=\"tent\"/></film>"
        "</sensor>",
        0.3f * u.length, 3 * u.length, vec({0, 0, 3.4f}, u.length));
    const std::string lamp = rectangle(
        placed("<scale value=\"0.25\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.98\"/>"),
        diffuse("0.5,0.5,0.5") + "<emitter type=\"area\">" +
            rgb("radiance", {12, 11, 9}, u.radiance) + "</emitter>");
    return build(
        camera + wall("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>", "0.7,0.7,0.7") +
        wall("<rotate x=\"1\" angle=\"90\"/><translate y=\"1\"/>", "0.7,0.7,0.7") +
        wall("<translate z=\"-1\"/>", "0.7,0.7,0.7") +
        wall("<rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>", "0.6,0.1,0.1") +
        wall("<rotate y=\"1\" angle=\"-90\"/><translate x=\"1\"/>", "0.1,0.5,0.1") + lamp +
        ball({-0.5f, -0.6f, 0.2f}, 0.35f, kRoughMetal) +
        ball({0.4f, -0.65f, 0.3f}, 0.3f, kRoughGlass) + ball({0.1f, 0.2f, -0.1f}, 0.2f, kGlass) +
        "<emitter type=\"point\"><point name=\"position\" value=\"" +
        vec({0.3f, 0.1f, 0.7f}, u.length) + "\"/>" +
        rgb("intensity", {0.3f, 0.5f, 0.4f}, u.radiance * sqr(u.length)) +
        "</emitter><emitter type=\"constant\">" + rgb("radiance", {0.3f, 0.4f, 0.5f}, u.radiance) +
        "</emitter>");
}

struct Rendering {
    std::vector<Rgb> image, variance;
    ErrorEstimate error;
    RenderStats stats;
};

Rendering render(Units units, const std::string& integrator) {
    const Scene scene = lit_room(units);
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

class ScaledScene : public ::testing::TestWithParam<std::string> {};

/// Powers of two: of radiance, and of lengths about four orders of magnitude.
TEST_P(ScaledScene, HasTheSameBits) {
    const Rendering one = render({}, GetParam());
    ASSERT_TRUE(one.error.valid);
    for (const Units units : {Units{.radiance = 0x1p40f},
                              {.radiance = 0x1p-40f},
                              {.length = 0x1p13f},
                              {.length = 0x1p-13f}}) {
        SCOPED_TRACE(::testing::PrintToString(units));
        const float factor = units.radiance;
        const Rendering other = render(units, GetParam());
        EXPECT_EQ(different(other.image, one.image, factor), 0u) << "of " << 3 * one.image.size();
        EXPECT_EQ(different(other.variance, one.variance, factor * factor), 0u);
        EXPECT_EQ(other.error.relative_rms, one.error.relative_rms);
        // Values near the smallest floats may become 0, which saves a ray.
        EXPECT_NEAR(double(other.stats.rays()), double(one.stats.rays()),
                    1e-4 * double(one.stats.rays()));
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
    all.insert(all.end(), {"bdpt:eorr=true", "bdpt:connections=cache", "vcm:exact=true",
                           "pm:light_paths=2000,cache_error=0.3,cache_rays=32"});
    return all;
}

INSTANTIATE_TEST_SUITE_P(Integrators, ScaledScene, ::testing::ValuesIn(all_integrators()),
                         [](const auto& p) {
                             std::string name = p.param;
                             for (char& c : name)
                                 if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                             return name;
                         });

}  // namespace
}  // namespace etendue::test
