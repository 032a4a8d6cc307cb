// Scenes of pbrt as the builder makes them: which way normals point, where textures lie, that every plug-in can be built.

#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "readers/pbrt.h"
#include "scene/builder.h"

namespace etendue {
namespace {

Scene build4(const std::string& world) {
    return build_scene(parse_pbrt("WorldBegin LightSource \"infinite\"\n" + world, "s.pbrt"));
}
Scene build3(const std::string& world) {
    return build_scene(
        parse_pbrt("WorldBegin LightSource \"infinite\"\n" + world + "\nWorldEnd", "s.pbrt"));
}

/// Geometric normal where a ray along -z meets the scene above (0.2, 0.2).
Vec3 normal_of(const Scene& scene) {
    SurfaceHit hit;
    EXPECT_TRUE(scene.intersect(Ray{{0.2f, 0.2f, 5}, {0, 0, -1}}, 0.5f, hit));
    return hit.geometry.ng;
}

const std::string kUp =
    "Shape \"trianglemesh\" \"point P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2]";
const std::string kUpWithNormals = kUp + " \"normal N\" [0 0 1 0 0 1 0 0 1]";

TEST(PbrtScenes, NormalsOfMeshesFollowTheTransformNotItsHandedness) {
    EXPECT_GT(normal_of(build4(kUp)).z, 0);
    EXPECT_GT(normal_of(build4("Rotate 90 0 0 1 Scale 1 -1 1 " + kUp)).z, 0);
    EXPECT_GT(normal_of(build4("Rotate 90 0 0 1 Scale 1 -1 1 " + kUpWithNormals)).z, 0);
    EXPECT_LT(normal_of(build4("Translate 0 0.9 0 Rotate 180 1 0 0 " + kUp)).z, 0);
}

TEST(PbrtScenes, ReverseOrientationTurnsGivenNormalsInV4Only) {
    EXPECT_LT(normal_of(build4("ReverseOrientation " + kUp)).z, 0);
    EXPECT_LT(normal_of(build3("ReverseOrientation " + kUp)).z, 0);
    EXPECT_LT(normal_of(build4("ReverseOrientation " + kUpWithNormals)).z, 0);
    EXPECT_GT(normal_of(build3("ReverseOrientation " + kUpWithNormals)).z, 0);
}

TEST(PbrtScenes, MeshesWithoutNormalsAreFlat) {
    const std::string kRoof = "Shape \"trianglemesh\" \"point P\" [0 0 0 1 0 0 0 1 0 1 1 1]"
                              " \"integer indices\" [0 1 2 2 1 3]";
    SurfaceHit hit;
    const Scene scene = build4(kRoof);
    ASSERT_TRUE(scene.intersect(Ray{{0.45f, 0.45f, 5}, {0, 0, -1}}, 0.5f, hit));
    EXPECT_NEAR(hit.geometry.ns.z, 1, 1e-6);
}

/// A board of cubes that starts at x = 1/2, on the opacity and on the reflectance of an instanced square.
TEST(PbrtScenes, TexturesOfSpaceLieInTheWorld) {
    const std::string world =
        "Translate .5 0 0 Texture \"a\" \"float\" \"checkerboard\" \"integer dimension\" 3\n"
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"integer dimension\" 3\n"
        "Identity Translate 0 0 -.5 Material \"diffuse\" \"texture reflectance\" \"c\"\n"
        "ObjectBegin \"o\" Shape \"bilinearmesh\""
        " \"point3 P\" [-4 -4 0 4 -4 0 -4 4 0 4 4 0] ALPHA ObjectEnd\n"
        "Identity Translate 10 0 0 ObjectInstance \"o\"";
    const auto with_alpha = [&](const std::string& alpha) {
        std::string text = world;
        return build4(text.replace(text.find("ALPHA"), 5, alpha));
    };
    const Scene opaque = with_alpha(""), masked = with_alpha("\"texture alpha\" \"a\"");
    for (float x = 6.25f; x < 14; x += 0.5f)
        for (const float y : {-1.3f, 0.4f}) {
            SCOPED_TRACE(fmt::format("({}, {})", x, y));
            const int cube = int(std::floor(x - 0.5f)) + int(std::floor(y)) - 1;
            const bool is_first = cube % 2 == 0;
            SurfaceHit hit;
            EXPECT_EQ(masked.intersect(Ray{{x, y, 5}, {0, 0, -1}}, 0.5f, hit), is_first);
            ASSERT_TRUE(opaque.intersect(Ray{{x, y, 5}, {0, 0, -1}}, 0.5f, hit));
            const SurfaceGeometry& at = hit.geometry;
            const SurfacePoint point{.p = at.p,
                                     .ng = at.ng,
                                     .ns = at.ns,
                                     .dpdu = at.dpdu,
                                     .dpdv = at.dpdv,
                                     .uv = at.uv,
                                     .wo = {0, 0, 1},
                                     .color = at.color};
            ComponentArena arena;
            const Bsdf bsdf = hit.shape->material->bsdf(point, arena);
            EXPECT_EQ(bsdf.albedo_estimate(), Rgb(is_first ? 1 : 0));
        }
}

/// A material, texture or light for each line.
TEST(PbrtScenes, WhatTheReaderNamesTheBuilderKnows) {
    const std::string kTextures =
        "Texture \"t\" \"spectrum\" \"checkerboard\"\n"
        "Texture \"f\" \"float\" \"checkerboard\" \"float tex1\" .2 \"float tex2\" .4\n";
    const std::string kSphere = "\nShape \"sphere\"";
    for (const char* material :
         {"diffuse\" \"float sigma\" 20", "diffuse\" \"texture reflectance\" \"t\"",
          "diffuse\" \"texture displacement\" \"f\"", "coateddiffuse", "coatedconductor",
          "coatedconductor\" \"texture interface.roughness\" \"f\"",
          "coatedconductor\" \"float conductor.vroughness\" .1",
          "coatedconductor\" \"texture reflectance\" \"t\"",
          "coateddiffuse\" \"texture roughness\" \"f\"", "coateddiffuse\" \"float roughness\" .1",
          "conductor", "conductor\" \"texture roughness\" \"f\"",
          "conductor\" \"rgb reflectance\" [.2 .3 .4]", "dielectric",
          "dielectric\" \"float roughness\" .2", "thindielectric", "diffusetransmission",
          "interface"}) {
        SCOPED_TRACE(material);
        const std::string quote = std::string(material).find('"') == std::string::npos ? "\"" : "";
        EXPECT_NO_THROW(build4(kTextures + "Material \"" + material + quote + kSphere));
    }
    for (const char* material :
         {"matte", "mirror", "glass", "metal", "plastic", "substrate", "uber", "translucent",
          "disney", "uber\" \"rgb opacity\" [.5 .5 .5] \"rgb Kt\" [.1 .1 .1]",
          "metal\" \"texture roughness\" \"f\""}) {
        SCOPED_TRACE(material);
        const std::string quote = std::string(material).find('"') == std::string::npos ? "\"" : "";
        EXPECT_NO_THROW(build3(kTextures + "Material \"" + material + quote + kSphere));
    }
    for (const char* texture :
         {"mix\" \"rgb tex1\" [1 0 0] \"texture amount\" \"f\"", "bilerp\" \"rgb v00\" [1 0 0]",
          "scale\" \"rgb tex\" [.5 .5 .5] \"texture scale\" \"t\"", "marble\"",
          "checkerboard\" \"integer dimension\" 3", "dots\" \"texture inside\" \"t\"",
          "fbm\" \"integer octaves\" 3", "wrinkled\" \"float roughness\" .7", "windy\""}) {
        SCOPED_TRACE(texture);
        EXPECT_NO_THROW(build4(kTextures + "Texture \"x\" \"spectrum\" \"" + texture +
                               "\nMaterial \"diffuse\" \"texture reflectance\" \"x\"" + kSphere));
    }
    for (const char* light : {"point", "spot", "distant"}) {
        SCOPED_TRACE(light);
        EXPECT_NO_THROW(build4(std::string("LightSource \"") + light + "\"" + kSphere));
        EXPECT_NO_THROW(build3(std::string("LightSource \"") + light + "\"" + kSphere));
    }
    for (const char* shape :
         {"sphere\" \"float zmax\" .5", "sphere\" \"texture alpha\" \"f\"", "cylinder\"", "disk\"",
          "bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]"}) {
        SCOPED_TRACE(shape);
        EXPECT_NO_THROW(build4(kTextures + "Shape \"" + shape));
    }
}

}  // namespace
}  // namespace etendue
