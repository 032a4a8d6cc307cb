// Density estimates: exact approximations, and the decrease of their bias with the radius.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr int kMapSize = 8;

// ---- Cases where the disc is exact.

/// A closed sphere of albedo ½ that emits L_e = 1. A ball around a point of a sphere cuts off a cap of area π r²; and
/// the density of a diffuse event is the same everywhere, so that even the disc's approximation of p_c is exact.
Scene furnace_scene() {
    return build(
        sensor("0.3,0.1,-0.2", "-1,-0.2,0.4", kMapSize, "70") +
        "<shape type=\"sphere\"><boolean name=\"flip_normals\" value=\"true\"/><bsdf "
        "type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.5,0.5,0.5\"/></bsdf>"
        "<emitter type=\"area\"><rgb name=\"radiance\" value=\"1,1,1\"/></emitter></shape>");
}

struct Method {
    const char *name, *spec;
    uint64_t passes;
};
void PrintTo(const Method& m, std::ostream* out) {
    *out << m.name;
}
const auto kMethodName = [](const ::testing::TestParamInfo<Method>& p) {
    return std::string(p.param.name);
};

class PhotonFurnace : public ::testing::TestWithParam<Method> {};

TEST_P(PhotonFurnace, IsEmissionOverOneMinusAlbedo) {
    const Scene scene = furnace_scene();
    const Tiles exact = exact_tiles(scene.film(), 2, [](float, float) { return Rgb(2); });
    expect_same_image(render_tiles(scene, GetParam().spec, {GetParam().passes, 2}), exact, 0.02,
                      GetParam().spec);
}

INSTANTIATE_TEST_SUITE_P(
    Methods, PhotonFurnace,
    ::testing::Values(
        Method{"sppm", "sppm:radius=0.15,alpha=1", 1024},
        Method{"sppm_photons_alone", "sppm:radius=0.15,alpha=1,next_event=false", 1024},
        Method{"ppm", "ppm:radius=0.15,alpha=1,eye_paths=3", 1024},
        Method{"vcm", "vcm:radius=0.07,alpha=1", 256},
        Method{"vcm_merges_alone", "vcm:radius=0.07,alpha=1,connections=false", 512},
        Method{"vcm_exact", "vcm:radius=0.15,alpha=1,exact=true", 256},
        Method{"vcm_exact_merges_alone", "vcm:radius=0.15,alpha=1,exact=true,connections=false",
               512},
        Method{"pm",
               "pm:light_paths=1000,retrace=true,nearest=12,radius=0.7,gather_rays=2,"
               "irradiance=0",
               256},
        Method{"pm_cache",
               "pm:light_paths=1000,retrace=true,nearest=12,radius=0.7,gather_rays=2,"
               "irradiance=0,cache_error=0.4,cache_rays=64",
               512},
        Method{"pm_fixed_radius",
               "pm:light_paths=500,retrace=true,nearest=512,radius=0.1,gather_rays=2,irradiance=0",
               256},
        Method{"mps_importons",
               "mps:mutations=2000,chains=16,precision=0.02,retrace=true,nearest=512,radius=0.1,"
               "gather_rays=2,irradiance=0",
               128},
        Method{"mps_path",
               "mps:target=path,mutations=500,chains=16,precision=0.05,retrace=true,nearest=512,"
               "radius=0.1,gather_rays=2,irradiance=0",
               128},
        Method{"pm_direct_view",
               "pm:light_paths=1000,retrace=true,nearest=12,radius=0.7,gather_rays=0", 256}),
    kMethodName);

/// The irradiance at the nearest photon is that of the point to first order: with 60 photons within 1 %, for any share of
/// the photons.
TEST(IrradianceAtPhotons, IsThatAroundThem) {
    const Scene scene = furnace_scene();
    for (const int step : {1, 4, 16}) {
        const Tiles tiles = render_tiles(
            scene,
            fmt::format("pm:light_paths=4000,retrace=true,nearest=60,radius=0.7,gather_rays=4,"
                        "irradiance={}",
                        step),
            {64, 1});
        EXPECT_NEAR(tiles.values.back().mean(), 2, 0.02) << step;
        EXPECT_LT(4 * std::sqrt(tiles.values.back().squared_error()), 0.02);
    }
}

/// Parallel light on a floor that ends at x = edge; the camera sees [-1, 1]². All light comes by photons.
Scene lit_floor_scene(float edge) {
    return build(
        "<sensor type=\"orthographic\"><transform name=\"to_world\"><lookat origin=\"0,0,2\" "
        "target=\"0,0,0\" up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer "
        "name=\"width\" value=\"8\"/><integer name=\"height\" value=\"8\"/><rfilter "
        "type=\"box\"/></film></sensor>" +
        rectangle(fmt::format("<scale value=\"2\"/><translate x=\"{}\"/>", edge - 2),
                  "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.8,0.5,0.3\"/>"
                  "</bsdf>") +
        "<emitter type=\"directional\"><vector name=\"direction\" value=\"0.3,0.4,-1\"/><rgb "
        "name=\"irradiance\" value=\"3,2,1\"/></emitter>");
}
/// ρ E cos θ / π.
Rgb floor_radiance() {
    return Rgb(0.8f, 0.5f, 0.3f) * Rgb(3, 2, 1) * (kInvPi / std::sqrt(1.25f));
}

class PhotonFloor : public ::testing::TestWithParam<Method> {};

TEST_P(PhotonFloor, IsLitUniformly) {
    const Scene scene = lit_floor_scene(1.5f);
    const Tiles exact = exact_tiles(scene.film(), 2, [](float, float) { return floor_radiance(); });
    expect_same_image(render_tiles(scene, GetParam().spec, {GetParam().passes, 2}), exact, 0.03,
                      GetParam().spec);
}

INSTANTIATE_TEST_SUITE_P(
    Methods, PhotonFloor,
    ::testing::Values(Method{"sppm", "sppm:radius=0.3,alpha=1,next_event=false", 2048},
                      Method{"sppm_shrinking", "sppm:radius=0.5,alpha=0.7,next_event=false", 2048},
                      Method{"vcm_merges_alone", "vcm:radius=0.3,alpha=1,connections=false", 2048}),
    kMethodName);

/// Near the edge the disc reaches beyond the floor. Averaged over a strip of the width w the estimate loses the first
/// moment of a half disc, 2 r³/3, over π r² w: the bias is proportional to the radius.
TEST(PhotonBias, OfAnEdgeIsProportionalToTheRadius) {
    const Scene scene = lit_floor_scene(1);
    for (const float radius : {0.4f, 0.2f, 0.1f})
        for (const char* method :
             {"sppm:next_event=false,alpha=1,", "vcm:connections=false,alpha=1,"}) {
            const float left = 1 - 2 * radius / (3 * kPi * 2);
            const Tiles exact =
                exact_tiles(scene.film(), 1, [&](float, float) { return floor_radiance() * left; });
            const std::string spec = fmt::format("{}radius={}", method, radius);
            expect_same_image(render_tiles(scene, spec, {8192, 1}), exact, 0.025, spec);
        }
}

// ---- Cases where the disc is an approximation.

struct ApproximationCase {
    const char *name, *reference;
    std::string xml;
    std::string options = "";          ///< Of all methods.
    std::string mapping_options = "";  ///< Of sppm and pm.
    uint64_t passes = 512;
    double resolution = 0.08;
};
void PrintTo(const ApproximationCase& c, std::ostream* out) {
    *out << c.name;
}

std::vector<ApproximationCase> approximations() {
    const std::string front = front_camera(16);
    const std::string gloss =
        "<bsdf type=\"twosided\"><bsdf type=\"blendbsdf\"><float name=\"weight\" "
        "value=\"0.4\"/><bsdf type=\"diffuse\"/><bsdf type=\"conductor\"/></bsdf></bsdf>";
    const std::string polished =
        "<bsdf type=\"twosided\"><bsdf type=\"roughconductor\"><float name=\"alpha\" "
        "value=\"0.08\"/></bsdf></bsdf>";
    const std::string glossy =
        "<bsdf type=\"twosided\"><bsdf type=\"roughconductor\"><float name=\"alpha\" "
        "value=\"0.4\"/></bsdf></bsdf>";
    const std::string point = "<emitter type=\"point\"><point name=\"position\" "
                              "value=\"0.4,0.6,2\"/><rgb name=\"intensity\" value=\"9,8,7\"/>"
                              "</emitter>";
    return {
        {"room", "path", front + room() + area_lamp()},
        {"mixed_room", "bdpt", mixed_room(front)},
        {"gloss", "path", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", gloss)},
        {"polished", "path", front + room() + area_lamp() + sphere("0,-0.4,0", "0.5", polished)},
        {"several", "path",
         front + room() + area_lamp() + point + sphere("0,-0.4,0", "0.5", kRoughMetal) +
             "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.5\"/></emitter>",
         "", "", 512, 0.22},
        // Light from a point that reaches a glossy surface by delta events only.
        {"glossy_behind_glass", "light",
         front + rectangle("<scale value=\"2\"/><rotate x=\"1\" angle=\"-50\"/>", glossy) +
             rectangle("<scale value=\"1.4\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"2\"/>",
                       "<bsdf type=\"thindielectric\"/>") +
             "<emitter type=\"point\"><point name=\"position\" value=\"0,3,1\"/><rgb "
             "name=\"intensity\" value=\"9,8,7\"/></emitter>",
         ",max_depth=3", ",roughness=0.5", 2048, 0.2},
    };
}

class PhotonApproximation : public ::testing::TestWithParam<ApproximationCase> {
protected:
    PhotonApproximation() : scene(build(GetParam().xml)) {}
    Scene scene;
};

TEST_P(PhotonApproximation, IsCloseForASmallRadius) {
    const ApproximationCase& c = GetParam();
    const auto render = [&](const std::string& spec, uint64_t passes, uint64_t seed) {
        return render_tiles(scene, spec, {passes, 2, seed});
    };
    const Tiles reference = render(c.reference + (":rr_depth=5" + c.options), 2 * c.passes, 2);
    const std::string mapping = c.options + c.mapping_options;
    for (const std::string& spec :
         {"sppm:radius=0.05" + mapping, "sppm:radius=0.05,next_event=false" + mapping,
          "pm:light_paths=8000,retrace=true,radius=0.02,gather_rays=1" + mapping,
          "vcm:radius=0.05" + c.options, "vcm:radius=0.05,exact=true" + c.options})
        expect_same_image(render(spec, c.passes, 1), reference, c.resolution,
                          fmt::format("{}: {}", c.name, spec));
}

INSTANTIATE_TEST_SUITE_P(Long, PhotonApproximation, ::testing::ValuesIn(approximations()),
                         [](const auto& p) { return std::string(p.param.name); });

// ---- Progressive photon mapping.

std::vector<Rgb> image(const Scene& scene, const std::string& integrator, uint64_t passes,
                       bool variance = false) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.threads = 1;
    settings.spp = passes;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    return variance ? renderer.film().variance() : renderer.film().image();
}

/// Before the eye paths repeat, it is stochastic progressive photon mapping; afterwards contributions that need no
/// light paths stay the same.
TEST(ProgressivePhotonMapping, RepeatsItsEyePaths) {
    const Scene room_scene = build(front_camera(16) + room() + area_lamp());
    EXPECT_EQ(image(room_scene, "ppm:eye_paths=5", 5), image(room_scene, "sppm", 5));
    EXPECT_NE(image(room_scene, "ppm:eye_paths=4", 5), image(room_scene, "sppm", 5));
    // A wide filter spreads the contributions from film points that all pixels share.
    for (const char* filter : {"box", "gaussian"}) {
        SCOPED_TRACE(filter);
        std::string camera = front_camera(16);
        camera.replace(camera.find("box"), 3, filter);
        const Scene edge = build(camera + area_lamp());
        EXPECT_EQ(image(edge, "ppm:eye_paths=2", 2), image(edge, "ppm:eye_paths=2", 6));
        EXPECT_NE(image(edge, "sppm", 2), image(edge, "sppm", 6));
    }
}

}  // namespace
}  // namespace etendue::test
