#include "color/metallic_color.h"

#include <gtest/gtest.h>

namespace etendue {
namespace {

/// Diffuse reflectance, and reflectance at normal incidence, of `principled` with these parameters.
Rgb diffuse_of(const MetallicColor& m) {
    return m.base * (0.96f * (1 - m.metallic));
}
Rgb specular_of(const MetallicColor& m) {
    return Rgb(0.04f * m.specular_weight * (1 - m.metallic)) + m.base * m.metallic;
}

TEST(MetallicColor, KeepsBothColoursOfGreyMaterials) {
    for (const float d : {0.0f, 0.2f, 0.5f, 1.0f})
        for (const float s : {0.04f, 0.1f, 0.3f, 0.7f, 1.0f}) {
            const MetallicColor made = metallic_color(Rgb(d), Rgb(s));
            EXPECT_GE(made.metallic, 0);
            EXPECT_LE(made.metallic, 1);
            EXPECT_NEAR(diffuse_of(made).g, d * (1 - s), 1e-3) << d << " " << s;
            EXPECT_NEAR(specular_of(made).g, s, 1e-3) << d << " " << s;
        }
}

TEST(MetallicColor, KeepsTheHueOfMetal) {
    const MetallicColor gold = metallic_color(Rgb(0), {1, 0.75f, 0.3f});
    EXPECT_NEAR(gold.metallic, 1, 1e-5);
    EXPECT_NEAR(gold.base.g, 0.75f, 1e-4f);
    EXPECT_NEAR(gold.base.b, 0.3f, 1e-4f);
}

TEST(MetallicColor, ReflectsNoMoreThanTheDielectric) {
    const Rgb diffuse{0.5f, 0.25f, 1};
    for (const float s : {0.0f, 0.01f, 0.02f, 0.04f}) {
        const MetallicColor made = metallic_color(diffuse, Rgb(s));
        EXPECT_EQ(made.metallic, 0);
        EXPECT_NEAR(made.specular_weight, s / 0.04f, 1e-6);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(made.base[c], diffuse[c], 1e-6);
    }
}

TEST(MetallicColor, ReflectsNoMoreThanAllLight) {
    const MetallicColor made = metallic_color(Rgb(0.5f), Rgb(3));
    EXPECT_EQ(made.metallic, 1);
    EXPECT_EQ(made.base, Rgb(1));
}

}  // namespace
}  // namespace etendue
