// Scenes whose image is known in closed form, rendered by every integrator that can.

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "bsdf/fresnel.h"
#include "math/vec3d.h"
#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr int kFurnaceSize = 8;
constexpr float kGlassEta = 1.5f;
const std::string kPlainGlass =
    "<float name=\"int_ior\" value=\"1.5\"/><float name=\"ext_ior\" value=\"1\"/></bsdf>";

std::string rgb_value(const char* name, Rgb v) {
    return fmt::format("<rgb name=\"{}\" value=\"{},{},{}\"/>", name, v.r, v.g, v.b);
}
std::string lambert(Rgb reflectance) {
    return "<bsdf type=\"diffuse\">" + rgb_value("reflectance", reflectance) + "</bsdf>";
}
/// Looks down on z = 0 from z = 2; a film of kSize² pixels shows [-half, half]² of it. x runs to the left.
std::string camera_above(const std::string& type, float half) {
    const std::string size = std::to_string(kFurnaceSize);
    const bool is_orthographic = type == "orthographic";
    std::string s = "<sensor type=\"" + type + "\">";
    if (!is_orthographic)
        s += fmt::format("<float name=\"fov\" value=\"{}\"/>",
                         2 * std::atan(double(half) / 2) * 180 / M_PI);
    if (type == "thinlens")
        s += "<float name=\"aperture_radius\" value=\"0.2\"/><float name=\"focus_distance\" "
             "value=\"2\"/>";
    s += "<transform name=\"to_world\">";
    if (is_orthographic) s += fmt::format("<scale value=\"{}\"/>", half);
    return s +
           "<lookat origin=\"0,0,2\" target=\"0,0,0\" up=\"0,1,0\"/></transform><film "
           "type=\"hdrfilm\"><integer name=\"width\" value=\"" +
           size + "\"/><integer name=\"height\" value=\"" + size +
           "\"/><rfilter type=\"box\"/></film></sensor>";
}
/// The point of z = 0 at a film point. With the view along -z and y up, x increases to the right of the film.
Vec3 on_plane(float half, float x, float y) {
    return {half * (2 * x / kFurnaceSize - 1), half * (1 - 2 * y / kFurnaceSize), 0};
}
std::string floor_of(Rgb reflectance, float half = 4) {
    return rectangle(fmt::format("<scale value=\"{}\"/>", half), lambert(reflectance));
}

void expect_image(const Scene& scene, const std::vector<std::string>& integrators, uint64_t passes,
                  const std::function<Rgb(float, float)>& radiance, double resolution = 0.02) {
    const Tiles exact = exact_tiles(scene.film(), 4, radiance);
    for (const std::string& i : integrators)
        expect_same_image(render_tiles(scene, i, {i.starts_with("light") ? 4 * passes : passes}),
                          exact, resolution, i);
}

// ---- Furnaces: inside a closed surface of albedo ρ that emits L_e, L = L_e / (1 - ρ) everywhere.

constexpr Rgb kAlbedo{0.7f, 0.5f, 0.2f}, kEmitted{1, 2, 3};

/// Camera inside, off the centre.
std::string furnace(const std::string& shape, const std::string& sensor_type = "perspective",
                    const std::string& extra = "", const std::string& bsdf = lambert(kAlbedo)) {
    return sensor("0.3,0.1,-0.2", "-1,-0.2,0.4", kFurnaceSize, "70", extra, sensor_type) +
           "<shape type=\"" + shape + "\"><boolean name=\"flip_normals\" value=\"true\"/>" + bsdf +
           "<emitter type=\"area\">" + rgb_value("radiance", kEmitted) + "</emitter></shape>";
}
/// A mixture with the albedo kAlbedo in all, of Lambert surfaces of one colour with these weights.
std::string mixture(const std::vector<float>& weights) {
    float sum = 0;
    std::string text, parts;
    for (const float w : weights) sum += w;
    for (const float w : weights) {
        text += fmt::format("{} ", w);
        parts += lambert(kAlbedo / Rgb(sum));
    }
    return "<bsdf type=\"mixturebsdf\"><boolean name=\"ensure_energy_conservation\" "
           "value=\"false\"/><string name=\"weights\" value=\"" +
           text + "\"/>" + parts + "</bsdf>";
}

/// Σ_{i<depth} ρ^i L_e: paths of at most `depth` edges.
Rgb furnace_radiance(int depth) {
    Rgb sum, term = kEmitted;
    for (int i = 0; i < depth; ++i, term *= kAlbedo) sum += term;
    return sum;
}

struct FurnaceCase {
    const char* name;
    std::string xml;
    bool light = true;  ///< Whether light paths see all of it.
};

/// Walks in the ball take many reflections: the depth of the furnace is enough for them.
const std::string kWhiteHalfGlass =
    "<bsdf type=\"openpbr\"><float name=\"base_color\" value=\"1\"/><float "
    "name=\"base_metalness\" value=\"0.2\"/><float name=\"transmission_weight\" value=\"0.5\"/>"
    "<float name=\"specular_roughness\" value=\"0.6\"/></bsdf>";

class Furnace : public ::testing::TestWithParam<FurnaceCase> {
protected:
    Furnace() : scene(build(GetParam().xml)) {}
    std::vector<std::string> integrators() const {
        return GetParam().light ? std::vector<std::string>{"path", "light", "bdpt"}
                                : std::vector<std::string>{"path", "bdpt"};
    }
    Scene scene;
};

TEST_P(Furnace, IsEmissionOverOneMinusAlbedo) {
    expect_image(
        scene, integrators(), 768, [](float, float) { return furnace_radiance(60); }, 0.03);
}

INSTANTIATE_TEST_SUITE_P(
    Closed, Furnace,
    ::testing::Values(
        FurnaceCase{"sphere", furnace("sphere")}, FurnaceCase{"cube", furnace("cube")},
        FurnaceCase{"thinlens", furnace("sphere", "thinlens",
                                        "<float name=\"aperture_radius\" value=\"0.2\"/><float "
                                        "name=\"focus_distance\" value=\"0.7\"/>")},
        // A lossless object that does not emit is invisible in a furnace.
        FurnaceCase{"glass", furnace("sphere") + sphere("-0.4,0,0.2", "0.3", kGlass), false},
        FurnaceCase{
            "mirror",
            furnace("sphere") +
                sphere(
                    "-0.4,0,0.2", "0.3",
                    "<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/></bsdf>"),
            false},
        FurnaceCase{"thin_glass",
                    furnace("cube") +
                        rectangle("<translate z=\"0.3\"/>", "<bsdf type=\"thindielectric\"/>"),
                    false},
        // Half of the light that enters the ball meets the opaque half from behind.
        FurnaceCase{"half_glass", furnace("sphere") + sphere("-0.4,0,0.2", "0.3", kWhiteHalfGlass)},
        FurnaceCase{"part_of_mixture", furnace("sphere", "perspective", "", mixture({0.75f}))},
        FurnaceCase{"mixture_above_one",
                    furnace("sphere", "perspective", "", mixture({0.9f, 0.7f}))},
        FurnaceCase{"white", furnace("sphere") + sphere("-0.4,0,0.2", "0.3", lambert(Rgb(1)))},
        FurnaceCase{
            "masked_white",
            furnace("sphere") +
                sphere("-0.4,0,0.2", "0.3",
                       "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.4\"/>" +
                           ("<bsdf type=\"twosided\">" + lambert(Rgb(1)) + "</bsdf></bsdf>"))}),
    [](const auto& p) { return std::string(p.param.name); });

/// Fewer light paths than pixels, and more, also not a multiple.
TEST(ClosedForm, FurnaceByNumberOfLightPaths) {
    for (const char* sensor_type : {"perspective", "thinlens"}) {
        const bool has_lens = sensor_type == std::string("thinlens");
        const Scene scene = build(furnace("sphere", sensor_type,
                                          has_lens ? "<float name=\"aperture_radius\" "
                                                     "value=\"0.2\"/><float "
                                                     "name=\"focus_distance\" value=\"0.7\"/>"
                                                   : ""));
        for (const int light_paths :
             {kFurnaceSize * kFurnaceSize / 4, 4 * kFurnaceSize * kFurnaceSize, 150})
            for (const char* integrator : {"bdpt", "vcm:merges=false"}) {
                IntegratorSpec with = IntegratorSpec::parse(integrator);
                with.params["light_paths"] = std::to_string(light_paths);
                const std::string spec = with.to_string();
                expect_image(
                    scene, {spec}, 512, [](float, float) { return furnace_radiance(60); }, 0.03);
            }
    }
}

TEST(ClosedForm, FurnaceByPathLength) {
    const Scene scene = build(furnace("sphere"));
    for (const int depth : {1, 2, 3, 5})
        for (const char* integrator : {"path", "light", "bdpt"}) {
            const std::string spec = fmt::format("{}:max_depth={},rr_depth=2", integrator, depth);
            expect_image(
                scene, {spec}, 512, [&](float, float) { return furnace_radiance(depth); }, 0.03);
        }
}

// ---- Emitters over a Lambertian floor.

constexpr Rgb kFloor{0.8f, 0.5f, 0.3f};

class OverFloor : public ::testing::TestWithParam<const char*> {};

TEST_P(OverFloor, PointLight) {
    const Vec3 light{0.3f, -0.2f, 2.3f};
    const Scene scene =
        build(camera_above(GetParam(), 1) + floor_of(kFloor) +
              "<emitter type=\"point\"><point name=\"position\" value=\"0.3,-0.2,2.3\"/><rgb "
              "name=\"intensity\" value=\"3,2,1\"/></emitter>");
    expect_image(
        scene, {"path", "light", "bdpt"}, 2048,
        [&](float x, float y) {
            const Vec3 v = light - on_plane(1, x, y);
            return kFloor * Rgb(3, 2, 1) * (v.z / std::pow(length(v), 3.0f) / kPi);
        },
        0.04);
}

TEST_P(OverFloor, DirectionalLight) {
    const Scene scene =
        build(camera_above(GetParam(), 1) + floor_of(kFloor) +
              "<emitter type=\"directional\"><vector name=\"direction\" value=\"0.3,0.4,-1\"/><rgb "
              "name=\"irradiance\" value=\"3,2,1\"/></emitter>");
    const float cosine = 1 / std::sqrt(1.25f);
    expect_image(scene, {"path", "light", "bdpt"}, 8192,
                 [&](float, float) { return kFloor * Rgb(3, 2, 1) * (cosine / kPi); });
}

/// A disc of radius a at height h, parallel to the floor and facing it [Howell, Catalogue of radiation heat transfer
/// configuration factors, B-12]. It hangs above the camera.
TEST_P(OverFloor, DiscLamp) {
    const double a = 0.8, h = 2.5;
    const Scene scene =
        build(camera_above(GetParam(), 1) + floor_of(kFloor) +
              "<shape type=\"disk\"><transform name=\"to_world\"><scale value=\"0.8\"/><rotate "
              "x=\"1\" angle=\"180\"/>"
              "<translate x=\"0.4\" z=\"2.5\"/></transform>" +
              lambert(Rgb(0)) +
              "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter></shape>");
    expect_image(
        scene, {"path", "light", "bdpt"}, 2000,
        [&](float x, float y) {
            const double r2 = double(length2(on_plane(1, x, y) - Vec3{0.4f, 0, 0})),
                         sum = r2 + h * h + a * a;
            const double factor =
                0.5 * (1 - (r2 + h * h - a * a) / std::sqrt(sum * sum - 4 * r2 * a * a));
            return kFloor * Rgb(3, 2, 1) * float(factor);
        },
        0.03);
}

/// A sphere of radius r at distance d, wholly above the horizon: E = π L (r/d)² cos θ.
TEST_P(OverFloor, SphereLamp) {
    const Scene scene = build(
        camera_above(GetParam(), 1) + floor_of(kFloor) +
        sphere("0.5,0.3,3", "0.5",
               lambert(Rgb(0)) +
                   "<emitter type=\"area\"><rgb name=\"radiance\" value=\"30,20,10\"/></emitter>"));
    expect_image(
        scene, {"path", "light", "bdpt"}, 8192,
        [&](float x, float y) {
            const Vec3 v = Vec3{0.5f, 0.3f, 3} - on_plane(1, x, y);
            return kFloor * Rgb(30, 20, 10) * (0.25f * v.z / std::pow(length(v), 3.0f));
        },
        0.03);
}

/// A strong light, and one with a hundredth of its power that is close enough to the floor to be noticeable.
TEST_P(OverFloor, PointLightsOfUnequalPower) {
    const auto light = [](const char* position, const char* intensity) {
        return fmt::format("<emitter type=\"point\"><point name=\"position\" value=\"{}\"/><rgb "
                           "name=\"intensity\" value=\"{}\"/></emitter>",
                           position, intensity);
    };
    const Scene scene =
        build(camera_above(GetParam(), 1) + floor_of(kFloor) + light("0.3,-0.2,2.3", "3,2,1") +
              light("-1.1,0.3,0.5", "0.03,0.02,0.01"));
    expect_image(
        scene, {"path", "light", "bdpt"}, 8192,
        [&](float x, float y) {
            const auto irradiance = [&](Vec3 from) {
                const Vec3 v = from - on_plane(1, x, y);
                return v.z / std::pow(length(v), 3.0f);
            };
            return kFloor * Rgb(3, 2, 1) *
                   ((irradiance({0.3f, -0.2f, 2.3f}) + 0.01f * irradiance({-1.1f, 0.3f, 0.5f})) /
                    kPi);
        },
        0.04);
}

INSTANTIATE_TEST_SUITE_P(Cameras, OverFloor,
                         ::testing::Values("perspective", "orthographic", "thinlens"),
                         [](const auto& p) { return std::string(p.param); });

// ---- Other units: the scene far from the origin, radiance far from 1.

class InOtherUnits : public ::testing::TestWithParam<const char*> {};

/// The same image 10⁴ units from the origin, where positions are rounded to 0.001.
TEST_P(InOtherUnits, FarFromTheOrigin) {
    const auto moved = [](float x, float y, float z) {
        return fmt::format("{},{},{}", 10000 + x, -20000 + y, 5000 + z);
    };
    const Scene scene = build(
        fmt::format(
            "<sensor type=\"perspective\"><float name=\"fov\" value=\"53.1301\"/><transform "
            "name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" up=\"0,1,0\"/></transform>"
            "<film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer "
            "name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor>",
            moved(0, 0, 2), moved(0, 0, 0)) +
        rectangle("<scale value=\"4\"/><translate x=\"10000\" y=\"-20000\" z=\"5000\"/>",
                  lambert(kFloor)) +
        sphere(moved(0.5f, 0.25f, 3), "0.5",
               lambert(Rgb(0)) +
                   "<emitter type=\"area\"><rgb name=\"radiance\" value=\"30,20,10\"/></emitter>"));
    expect_image(
        scene, {GetParam()}, 8192,
        [&](float x, float y) {
            const Vec3 v = Vec3{0.5f, 0.25f, 3} - on_plane(1, x, y);
            return kFloor * Rgb(30, 20, 10) * (0.25f * v.z / std::pow(length(v), 3.0f));
        },
        0.03);
}

TEST_P(InOtherUnits, RadianceFarFromOne) {
    for (const float unit : {1e-6f, 1e6f}) {
        SCOPED_TRACE(unit);
        const Scene scene = build(camera_above("perspective", 1) + floor_of(kFloor) +
                                  "<emitter type=\"directional\"><vector name=\"direction\" "
                                  "value=\"0.3,0.4,-1\"/>" +
                                  rgb_value("irradiance", Rgb(3, 2, 1) * unit) + "</emitter>");
        expect_image(
            scene, {GetParam()}, 2048,
            [&](float, float) { return kFloor * Rgb(3, 2, 1) * (unit / (std::sqrt(1.25f) * kPi)); },
            0.04);
    }
}

INSTANTIATE_TEST_SUITE_P(Methods, InOtherUnits, ::testing::Values("path", "light", "bdpt"),
                         [](const auto& p) { return std::string(p.param); });

// ---- Environments.

TEST(ClosedForm, EnvironmentOnDiffuseSphere) {
    const Scene scene =
        build(sensor("0,0,5", "0,0,0", kFurnaceSize, "8") + sphere("0,0,0", "1", lambert(kFloor)) +
              "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter>");
    expect_image(
        scene, {"path", "light", "bdpt"}, 2048, [](float, float) { return kFloor * Rgb(3, 2, 1); },
        0.07);
}

/// Only the environment, and a small sphere behind the camera. MIS weights must not count techniques that the sensor
/// does not support.
TEST(ClosedForm, EnvironmentSeenDirectly) {
    for (const char* type : {"perspective", "orthographic", "thinlens"}) {
        const Scene scene =
            build(camera_above(type, 0.5f) + sphere("0,0,4", "1", lambert(kFloor)) +
                  "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter>");
        expect_image(scene, {"path", "bdpt"}, 2000, [](float, float) { return Rgb(3, 2, 1); });
    }
}

TEST(ClosedForm, EnvironmentOnMirror) {
    const Scene scene =
        build(sensor("0,0,5", "0,0,0", kFurnaceSize, "8") +
              sphere("0,0,0", "1",
                     "<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/><rgb "
                     "name=\"specular_reflectance\" value=\"0.9,0.5,0.2\"/></bsdf>") +
              "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter>");
    expect_image(scene, {"path", "bdpt"}, 64,
                 [](float, float) { return Rgb(0.9f, 0.5f, 0.2f) * Rgb(3, 2, 1); });
}

// ---- Transmission.

/// exp(-σ d) through a medium without surfaces, (1-F)² e^{-σd} / (1 - F² e^{-2σd}) through a slab of glass.
TEST(ClosedForm, AbsorbingSlab) {
    const Vec3 sigma{0.2f, 1.0f, 3.0f};
    const Rgb Tr{std::exp(-0.5f * sigma.x), std::exp(-0.5f * sigma.y), std::exp(-0.5f * sigma.z)};
    for (const bool is_glass : {false, true}) {
        const Scene scene =
            build(camera_above("orthographic", 0.5f) +
                  "<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"10\" y=\"10\" "
                  "z=\"0.25\"/></transform>" +
                  "<bsdf type=\"dielectric\">" +
                  (is_glass ? kPlainGlass
                            : "<float name=\"int_ior\" value=\"1\"/><float name=\"ext_ior\" "
                              "value=\"1\"/></bsdf>") +
                  "<medium type=\"homogeneous\" name=\"interior\"><rgb name=\"sigma_t\" "
                  "value=\"0.2,1,3\"/><float name=\"albedo\" value=\"0\"/></medium></shape>"
                  "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter>");
        // Glass also shows the environment by reflection: at the first surface, and, attenuated, at the second.
        const float F = is_glass ? sqr((kGlassEta - 1) / (kGlassEta + 1)) : 0.0f;
        Rgb L;
        for (int c = 0; c < 3; ++c) {
            const float t = Tr[c], pass = sqr(1 - F) / (1 - sqr(F * t));
            L[c] = Rgb(3, 2, 1)[c] * (pass * t + F + pass * F * sqr(t));
        }
        expect_image(scene, {"path", "bdpt"}, 4096, [&](float, float) { return L; });
    }
}

TEST(ClosedForm, MaskBeforeEmitter) {
    const Scene scene = build(
        camera_above("perspective", 0.5f) +
        rectangle("<scale value=\"3\"/>",
                  lambert(Rgb(0)) +
                      "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter>") +
        rectangle("<scale value=\"2\"/><translate z=\"1\"/>",
                  "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.3\"/>" +
                      (lambert(Rgb(0)) + "</bsdf>")));
    expect_image(
        scene, {"path", "light", "bdpt"}, 2048, [](float, float) { return Rgb(3, 2, 1) * 0.7f; },
        0.045);
}

/// A medium in a box with a `null` or half-opaque `mask` surface, in front of an emitter and over a lit floor.
TEST(ClosedForm, AbsorptionBehindOpenBoundaries) {
    const Rgb sigma{0.2f, 1, 3};
    const auto absorbed = [&](float distance) { return exp(sigma * -distance); };
    const auto matter = [](const char* side) {
        return fmt::format("<medium type=\"homogeneous\" name=\"{}\"><rgb name=\"sigma_t\" "
                           "value=\"0.2,1,3\"/><float name=\"albedo\" value=\"0\"/></medium>",
                           side);
    };
    const auto box = [&](const std::string& bsdf) {
        return "<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"2.5\" y=\"2.5\" "
               "z=\"0.25\"/><translate z=\"1\"/></transform>" +
               bsdf + matter("interior") + "</shape>";
    };
    const struct {
        std::string bsdf;
        float opacity;
    } boundaries[] = {{"<bsdf type=\"null\"/>", 0},
                      {"<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.3\"/>" +
                           lambert(Rgb(0)) + "</bsdf>",
                       0.3f}};
    const std::vector<std::string> all{"path", "light", "bdpt"};
    for (const auto& b : boundaries) {
        const float pass = sqr(1 - b.opacity);
        const Scene emitter =
            build(camera_above("orthographic", 0.5f) + box(b.bsdf) +
                  rectangle("<scale value=\"3\"/>",
                            lambert(Rgb(0)) + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                              "value=\"3,2,1\"/></emitter>"));
        expect_image(
            emitter, all, 2048, [&](float, float) { return Rgb(3, 2, 1) * absorbed(0.5f) * pass; },
            0.045);
        // Inside the medium, which is its exterior.
        const Scene inside = build(camera_above("orthographic", 0.5f) + box(b.bsdf) +
                                   rectangle("<scale value=\"3\"/><translate z=\"1\"/>",
                                             lambert(Rgb(0)) + matter("exterior") +
                                                 "<emitter type=\"area\"><rgb name=\"radiance\" "
                                                 "value=\"3,2,1\"/></emitter>"));
        expect_image(
            inside, all, 2048,
            [&](float, float) { return Rgb(3, 2, 1) * absorbed(0.25f) * (1 - b.opacity); }, 0.045);
        const Scene floor =
            build(camera_above("orthographic", 0.5f) + box(b.bsdf) + floor_of(kFloor, 2) +
                  "<emitter type=\"directional\"><vector name=\"direction\" "
                  "value=\"0.6,0,-0.8\"/><rgb name=\"irradiance\" value=\"3,2,1\"/></emitter>");
        expect_image(
            floor, all, 4096,
            [&](float, float) {
                return kFloor * Rgb(3, 2, 1) * absorbed(0.5f + 0.5f / 0.8f) *
                       (0.8f / kPi * sqr(pass));
            },
            0.045);
    }
}

const std::string kSpecular = ",specular_connections=on";

/// Directional light through a glass plate onto the floor, seen from below the plate: only light paths sample it. Path
/// lengths are limited to the shortest, without interreflection.
TEST(ClosedForm, DirectionalLightThroughGlass) {
    const std::string light =
        "<emitter type=\"directional\"><vector name=\"direction\" value=\"0.6,0,-0.8\"/><rgb "
        "name=\"irradiance\" value=\"3,2,1\"/></emitter>";
    const float F = fresnel_dielectric(0.8f, kGlassEta).R;
    const struct {
        std::string plate;
        const char* depth;
        float transmittance;
    } cases[] = {{"<shape type=\"rectangle\"><transform name=\"to_world\"><scale "
                  "value=\"6\"/><translate z=\"3\"/></transform><bsdf type=\"thindielectric\">" +
                      kPlainGlass + "</shape>",
                  ":max_depth=3", 1 - 2 * F / (1 + F)},
                 {"<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"6\" y=\"6\" "
                  "z=\"0.25\"/><translate z=\"3\"/></transform><bsdf type=\"dielectric\">" +
                      kPlainGlass + "</shape>",
                  ":max_depth=4", sqr(1 - F)}};
    for (const auto& c : cases) {
        const Scene scene =
            build(camera_above("perspective", 1) + floor_of(kFloor) + c.plate + light);
        expect_image(
            scene, {std::string("light") + c.depth, std::string("bdpt") + c.depth}, 3000,
            [&](float, float) { return kFloor * Rgb(3, 2, 1) * (0.8f * c.transmittance / kPi); },
            0.09);
        expect_image(
            scene, {std::string("path") + c.depth + kSpecular}, 1000,
            [&](float, float) { return kFloor * Rgb(3, 2, 1) * (0.8f * c.transmittance / kPi); },
            0.03);
    }
}

// ---- Point lights behind delta events, which path tracing finds by specular connections alone.

std::string point_light(const std::string& position) {
    return "<emitter type=\"point\"><point name=\"position\" value=\"" + position +
           "\"/><rgb name=\"intensity\" value=\"3,2,1\"/></emitter>";
}

/// The irradiance of a floor at a distance `aside` from an axis, by a point light of unit intensity on the axis whose light
/// arrives at the distance reach(θ), which grows with the angle θ between its direction and the axis. `theta` becomes the
/// angle.
template <class Reach>
double irradiance(const Reach& reach, double aside, double& theta) {
    double low = 0, high = 1.5;
    for (int i = 0; i < 100; ++i) (reach((low + high) / 2) < aside ? low : high) = (low + high) / 2;
    theta = std::max(low, 1e-6);
    const double step = 1e-7, slope = (reach(theta + step) - reach(theta - step)) / (2 * step);
    return std::sin(theta) / (reach(theta) * slope);  // dω/dA
}

/// Below horizontal glass panes that have this width together. The light is at height `above`.
double irradiance_below_panes(double aside, double above, double width, double& cos) {
    const auto theta_in_glass = [](double theta) {
        return std::asin(std::sin(theta) / double(kGlassEta));
    };
    const auto reach = [&](double theta) {
        return (above - width) * std::tan(theta) + width * std::tan(theta_in_glass(theta));
    };
    double theta;
    const double E = irradiance(reach, aside, theta);
    cos = std::cos(theta);
    return E;
}

std::string pane(float half_width, float height) {
    return fmt::format("<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"9\" "
                       "y=\"9\" z=\"{}\"/><translate z=\"{}\"/></transform>"
                       "<bsdf type=\"dielectric\">{}</shape>",
                       half_width, height, kPlainGlass);
}

TEST(SpecularConnections, PointLightBehindAPane) {
    // Below the pane, nothing, or a mask that half of the light passes.
    const std::string mask =
        rectangle("<scale value=\"9\"/><translate z=\"2.4\"/>",
                  "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.5\"/>" + lambert(Rgb(0)) +
                      "</bsdf>");
    for (const auto& [below, share] : {std::pair(std::string(), 1.0f), {mask, 0.5f}}) {
        const Scene scene = build(camera_above("perspective", 1) + floor_of(kFloor) +
                                  pane(0.25f, 3) + below + point_light("0.3,-0.2,4"));
        expect_image(
            scene, {"path:max_depth=4" + kSpecular}, 8192,
            [&, share = share](float x, float y) {
                const Vec3 p = on_plane(1, x, y);
                double cos;
                const double E =
                    irradiance_below_panes(std::hypot(p.x - 0.3, p.y + 0.2), 4, 0.5, cos);
                const float T = 1 - fresnel_dielectric(float(cos), kGlassEta).R;
                return kFloor * Rgb(3, 2, 1) * (share * float(E) * sqr(T) * kInvPi);
            },
            0.03);
    }
}

/// Light that passes both panes does so with four events.
TEST(SpecularConnections, PointLightBehindTwoPanes) {
    const Scene scene = build(camera_above("perspective", 1) + floor_of(kFloor) +
                              pane(0.15f, 2.6f) + pane(0.25f, 3.3f) + point_light("0.3,-0.2,4"));
    expect_image(
        scene, {"path:max_depth=6" + kSpecular}, 8192,
        [&](float x, float y) {
            const Vec3 p = on_plane(1, x, y);
            double cos;
            const double E = irradiance_below_panes(std::hypot(p.x - 0.3, p.y + 0.2), 4, 0.8, cos);
            const float T = 1 - fresnel_dielectric(float(cos), kGlassEta).R;
            return kFloor * Rgb(3, 2, 1) * (float(E) * sqr(sqr(T)) * kInvPi);
        },
        0.03);
}

/// A ball above the light spreads what it reflects. The light itself arrives, too.
TEST(SpecularConnections, PointLightBelowAMirrorBall) {
    constexpr double kLight = 2, kCenter = 3, kRadius = 0.5;  // heights on the axis
    const Scene scene =
        build(camera_above("perspective", 1) + floor_of(kFloor, 1.5f) +
              "<shape type=\"sphere\"><point name=\"center\" value=\"0.3,-0.2,3\"/>"
              "<float name=\"radius\" value=\"0.5\"/><bsdf type=\"conductor\"><string "
              "name=\"material\" value=\"none\"/></bsdf></shape>" +
              point_light("0.3,-0.2,2"));
    const auto reach = [](double theta) {
        const double d = kCenter - kLight, along = d * std::cos(theta),
                     root = sqr(along) - sqr(d) + sqr(kRadius);
        if (root < 0) return 1e9;
        const double t = along - std::sqrt(root);  // to the ball
        const double x = t * std::sin(theta), z = t * std::cos(theta) - d;
        // Reflected about the normal (x, z) / r.
        const double projected = 2 * (std::sin(theta) * x + std::cos(theta) * z) / sqr(kRadius),
                     wx = std::sin(theta) - projected * x, wz = std::cos(theta) - projected * z;
        return wz < 0 ? x + wx * (kCenter + z) / -wz : 1e9;
    };
    expect_image(
        scene, {"path:max_depth=3" + kSpecular}, 4096,
        [&](float x, float y) {
            const Vec3 p = on_plane(1, x, y);
            const double aside = std::hypot(p.x - 0.3, p.y + 0.2);
            double theta;
            const double reflected = irradiance(reach, aside, theta),
                         direct = kLight / std::pow(sqr(aside) + sqr(kLight), 1.5);
            return kFloor * Rgb(3, 2, 1) * (float(reflected + direct) * kInvPi);
        },
        0.03);
}

/// The image of the light in a mirror, and the light itself.
TEST(SpecularConnections, PointLightBelowAMirror) {
    const Scene scene = build(
        camera_above("perspective", 1) + floor_of(kFloor, 1.5f) +
        rectangle("<scale value=\"9\"/><rotate x=\"1\" angle=\"180\"/><translate z=\"3\"/>",
                  "<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/></bsdf>") +
        point_light("0.3,-0.2,2.5"));
    expect_image(
        scene, {"path:max_depth=3" + kSpecular}, 1024,
        [](float x, float y) {
            float E = 0;
            for (const float height : {2.5f, 3.5f}) {
                const Vec3 v = Vec3{0.3f, -0.2f, height} - on_plane(1, x, y);
                E += height / std::pow(length(v), 3.0f);
            }
            return kFloor * Rgb(3, 2, 1) * (E * kInvPi);
        },
        0.03);
}

/// Light paths find the light, too, where the floor is seen directly.
TEST(SpecularConnections, PointLightBehindMapsIsThatOfLightPaths) {
    const std::string plain = "<bsdf type=\"dielectric\">" + kPlainGlass,
                      mirror = "<bsdf type=\"conductor\"/>", above = point_light("0.3,-0.2,4"),
                      down = "<rotate x=\"1\" angle=\"180\"/>";
    const auto plate = [](const std::string& turn, const std::string& bsdf) {
        return rectangle("<scale value=\"6\"/>" + turn + "<translate z=\"3\"/>", bsdf);
    };
    const struct {
        const char* name;
        std::string objects;
        int depth;
    } cases[] = {
        {"normal_map_of_an_interface", plate("", normal_mapped(plain, "0.5")) + above, 3},
        {"bump_map_of_an_interface", plate("", bump_mapped(plain, "1")) + above, 3},
        {"normal_map_of_a_mirror",
         plate(down, normal_mapped(mirror, "0.3", "2")) + point_light("0.3,-0.2,2.5"), 3},
        {"bump_maps_of_a_pane",
         "<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"6\" y=\"6\" "
         "z=\"0.25\"/><translate z=\"3\"/></transform>" +
             bump_mapped(plain, "1") + "</shape>" + above,
         4},
    };
    for (const auto& c : cases) {
        const Scene scene = build(camera_above("perspective", 1) + floor_of(kFloor) + c.objects);
        const std::string depth = fmt::format(":max_depth={}", c.depth);
        expect_same_image(render_tiles(scene, "path" + depth + kSpecular, {4096}),
                          render_tiles(scene, "light" + depth, {32768}), 0.05, c.name);
    }
}

/// Water above the floor, in air: its surface is z = 3 + a sin(k x). A point light above it reaches a point of the floor by
/// way of every point of the surface at which the optical length of the way is stationary.
class SineWater {
public:
    static constexpr double kEta = 1.33, kSize = 2;

    /// How much of a unit intensity arrives at a point of the floor, per area. `ways` becomes the number of roots.
    double irradiance(double X, double Y, int& ways) const {
        constexpr double kStep = kPi / 12 / kWaves, kFar = 1.2;
        const auto f = [&](double x) { return slope_of_length(x, X, Y); };
        double E = 0;
        ways = 0;
        const auto add = [&](double low, double high) {
            const bool rises = f(low) < f(high);
            for (int i = 0; i < 50; ++i) {
                const double x = (low + high) / 2;
                ((f(x) < 0) == rises ? low : high) = x;
            }
            ++ways;
            E += irradiance_by(low, y_at(low, X, Y), X, Y);
        };
        std::array<double, 3> last{f(-kFar - kStep), f(-kFar), 0};
        for (double x = -kFar; x < kFar; x += kStep, last[0] = last[1], last[1] = last[2]) {
            last[2] = f(x + kStep);
            if ((last[1] < 0) != (last[2] < 0)) add(x, x + kStep);
            // Two roots between the steps, near the extremum of values with one sign.
            const double sign = last[1] < 0 ? -1 : 1;
            if (sign * last[0] < 0 || sign * last[2] < 0 ||
                sign * last[1] > std::min(sign * last[0], sign * last[2]))
                continue;
            double low = x - kStep, high = x + kStep;
            for (int i = 0; i < 60; ++i) {
                const double a = low + (high - low) / 3, b = high - (high - low) / 3;
                (sign * f(a) < sign * f(b) ? high : low) = sign * f(a) < sign * f(b) ? b : a;
            }
            if (sign * f(low) > 0) continue;
            add(x - kStep, low);
            add(low, x + kStep);
        }
        return E;
    }

    /// The scene's objects: light, floor, and the surface as a mesh whose normals are those of the sine at its vertices. Between
    /// these, 1/256 of a wave apart, the interpolated normals differ from those of the sine by at most 3e-5 radians.
    SceneDescription scene(const std::string& others) const {
        SceneDescription d = parse_mitsuba_xml(
            "<scene version=\"3.0.0\">" + others + floor_of(kFloor) +
                fmt::format("<emitter type=\"point\"><point name=\"position\" value=\"{},{},{}\"/>"
                            "<rgb name=\"intensity\" value=\"3,2,1\"/></emitter></scene>",
                            kLight.x, kLight.y, kLight.z),
            "test.xml");
        MeshData mesh;
        constexpr double kWidth = 2 * kPi / kWaves / 256;
        const auto strips = uint32_t(2 * kSize / kWidth);
        for (uint32_t i = 0; i <= strips; ++i) {
            const double x = -kSize + kWidth * double(i);
            for (const double y : {-kSize, kSize}) {
                mesh.positions.push_back(to_float(Vec3d{x, y, height(x)}));
                mesh.normals.push_back(to_float(normal(x)));
            }
            if (i == strips) break;
            mesh.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1});
            mesh.triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
        }
        d.meshes.emplace_back(std::move(mesh));
        const int water = int(d.objects.size());
        SceneObject bsdf, surface;
        bsdf.category = "bsdf";
        bsdf.type = "dielectric";
        bsdf.params = {{"int_ior", kEta, {}}, {"ext_ior", 1.0, {}}};
        surface.category = "shape";
        surface.type = "mesh";
        surface.params = {{"mesh", int64_t(0), {}}};
        surface.children = {{"", water, {}}};
        d.objects.push_back(bsdf);
        d.objects.push_back(surface);
        d.roots.push_back(water + 1);
        return d;
    }

private:
    static constexpr double kWaves = 30, kAmplitude = 0.013;  // k and a
    static constexpr Vec3d kLight{0.3, -0.2, 6};

    static double height(double x) { return 3 + kAmplitude * std::sin(kWaves * x); }
    static double slope(double x) { return kAmplitude * kWaves * std::cos(kWaves * x); }
    static Vec3d normal(double x) { return normalize(Vec3d{-slope(x), 0, 1}); }

    /// Of the way by the surface at x that is shortest in y.
    static double y_at(double x, double X, double Y) {
        const double a2 = sqr(x - kLight.x) + sqr(height(x) - kLight.z),
                     b2 = sqr(x - X) + sqr(height(x));
        double y = (kLight.y + Y) / 2;
        for (int i = 0; i < 4; ++i) {
            const double a = y - kLight.y, b = y - Y, d1 = std::sqrt(a2 + a * a),
                         d2 = std::sqrt(b2 + b * b);
            y -= (a / d1 + kEta * b / d2) / (a2 / (d1 * d1 * d1) + kEta * b2 / (d2 * d2 * d2));
        }
        return y;
    }
    /// Derivative by x of the optical length of the way.
    static double slope_of_length(double x, double X, double Y) {
        const double y = y_at(x, X, Y), z = height(x), dz = slope(x);
        const double d1 = std::hypot(x - kLight.x, y - kLight.y, z - kLight.z),
                     d2 = std::hypot(x - X, y - Y, z);
        return (x - kLight.x + (z - kLight.z) * dz) / d1 + kEta * (x - X + z * dz) / d2;
    }
    /// Where the light that arrives at a point of the surface meets the floor; its cosine there.
    static std::array<double, 2> floor_by(double x, double y, double& cosine) {
        const Vec3d p{x, y, height(x)}, n = normal(x), d = normalize(p - kLight);
        cosine = -dot(d, n);
        const double C = std::sqrt(1 - (1 - sqr(cosine)) / sqr(kEta));
        const Vec3d t = d * (1 / kEta) + n * (cosine / kEta - C);
        return {p.x - t.x * p.z / t.z, p.y - t.y * p.z / t.z};
    }
    /// What arrives by one way: solid angle at the light over area of the floor, from differences, and what is transmitted.
    static double irradiance_by(double x, double y, double X, double Y) {
        constexpr double kDelta = 1e-6;
        double cosine, other;
        const auto at = floor_by(x, y, cosine);
        EXPECT_NEAR(at[0], X, 1e-8);
        EXPECT_NEAR(at[1], Y, 1e-8);
        const auto x0 = floor_by(x - kDelta, y, other), x1 = floor_by(x + kDelta, y, other),
                   y0 = floor_by(x, y - kDelta, other), y1 = floor_by(x, y + kDelta, other);
        const double det = ((x1[0] - x0[0]) * (y1[1] - y0[1]) - (x1[1] - x0[1]) * (y1[0] - y0[0])) /
                           sqr(2 * kDelta);
        const Vec3d p{x, y, height(x)};
        const double d2 = dot(p - kLight, p - kLight), area = std::sqrt(1 + sqr(slope(x)));
        return cosine * area / d2 / std::fabs(det) *
               (1 - double(fresnel_dielectric(float(cosine), float(kEta)).R));
    }
};

/// Three to five ways, and at caustics two that are nearly one. Seen through a pane at the camera, so that bdpt has no other
/// technique.
TEST(SpecularConnections, PointLightAboveSineWater) {
    const SineWater water;
    const Scene scene =
        build_scene(water.scene(camera_above("perspective", 1) +
                                rectangle("<scale value=\"0.011\"/><translate z=\"1.98\"/>",
                                          "<bsdf type=\"thindielectric\">" + kPlainGlass)));
    int points = 0, all_ways = 0;
    const auto radiance = [&](float x, float y) {
        const Vec3 p = on_plane(1, x, y);
        constexpr int kParts = 4;  // of the distance of two points in x
        double E = 0;
        for (int i = 0; i < kParts; ++i) {
            int ways;
            E += water.irradiance(double(p.x) + ((i + 0.5) / kParts - 0.5) / 32, double(p.y), ways);
            ++points, all_ways += ways;
        }
        const float F = fresnel_dielectric(2 / std::hypot(p.x, p.y, 2.0f), kGlassEta).R;
        return kFloor * Rgb(3, 2, 1) * ((1 - 2 * F / (1 + F)) * float(E / kParts) * kInvPi);
    };
    expect_image(scene, {"path:max_depth=4" + kSpecular, "bdpt:max_depth=4" + kSpecular}, 2048,
                 radiance, 0.045);
    EXPECT_GT(double(all_ways) / points, 3);
}

/// At the centre of a glass ball, light leaves straight, or returns to the centre and leaves on the other side.
TEST(SpecularConnections, PointLightInAGlassBall) {
    const Scene scene = build(camera_above("perspective", 1) + floor_of(kFloor, 1.5f) +
                              "<shape type=\"sphere\"><point name=\"center\" value=\"0.2,0.1,3\"/>"
                              "<float name=\"radius\" value=\"0.4\"/><bsdf type=\"dielectric\">" +
                              kPlainGlass + "</shape>" + point_light("0.2,0.1,3"));
    const float R = fresnel_dielectric(1, kGlassEta).R;
    float returning = 0;
    for (const int events : {1, 2}) {
        returning += std::pow(R, float(events - 1));
        expect_image(
            scene, {fmt::format("path:max_depth={}{}", events + 2, kSpecular)}, 4096,
            [&](float x, float y) {
                const Vec3 v = Vec3{0.2f, 0.1f, 3} - on_plane(1, x, y);
                return kFloor * Rgb(3, 2, 1) *
                       ((1 - R) * returning * v.z / std::pow(length(v), 3.0f) * kInvPi);
            },
            0.03);
    }
}

}  // namespace
}  // namespace etendue::test
