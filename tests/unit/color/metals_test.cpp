#include "color/metals.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "color/spectrum.h"
#include "expect_rgb.h"

namespace etendue {
namespace {

/// Reflectance at normal incidence.
float normal_reflectance(float eta, float k) {
    return ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
}

// An independent measurement of evaporated gold [Johnson & Christy 1972, table I]; samples differ
// by this much.
TEST(Metals, GoldAgreesWithAnotherMeasurement) {
    const double nm[] = {368, 382, 397, 413, 431, 451, 471, 496,
                         521, 549, 582, 617, 660, 705, 756, 821};
    const double n[] = {1.48, 1.46, 1.47, 1.46, 1.45, 1.38, 1.31, 1.04,
                        0.62, 0.43, 0.29, 0.21, 0.14, 0.13, 0.14, 0.16};
    const double k[] = {1.895, 1.933, 1.952, 1.958, 1.948, 1.914, 1.849, 1.833,
                        2.081, 2.455, 2.863, 3.272, 3.697, 4.103, 4.542, 5.083};
    const ConductorIor gold = *named_metal("Au");
    expect_near_relative(gold.eta, spectrum_to_rgb(nm, n), 0.25f);
    expect_near_relative(gold.k, spectrum_to_rgb(nm, k), 0.10f);
}

// What Mitsuba 3.9 (scalar_rgb) gives its conductors of the same name.
TEST(Metals, AgreeWithMitsuba) {
    const struct {
        const char* name;
        Rgb eta, k;
    } cases[] = {
        {"Au", {0.14304f, 0.37531f, 1.44205f}, {3.98300f, 2.38556f, 1.60336f}},
        {"Ag", {0.15528f, 0.11673f, 0.13839f}, {4.82835f, 3.12222f, 2.14690f}},
        {"Al", {1.65750f, 0.88040f, 0.52124f}, {9.22381f, 6.26950f, 4.83700f}},
        {"Cu", {0.20101f, 0.92375f, 1.10222f}, {3.91326f, 2.45305f, 2.14209f}},
        {"Cu_palik", {0.21323f, 0.91972f, 1.10241f}, {3.92187f, 2.45733f, 2.13658f}},
        {"Cr", {4.36967f, 2.91651f, 1.65490f}, {5.20655f, 4.23131f, 3.75470f}},
        {"W", {4.37082f, 3.30025f, 2.99841f}, {3.50064f, 2.60487f, 2.27323f}},
        {"TiN", {1.64845f, 1.15052f, 1.37982f}, {3.36833f, 1.94350f, 1.10207f}},
        {"Ni_palik", {2.36730f, 1.66337f, 1.46708f}, {4.49881f, 3.05015f, 2.34544f}},
    };
    for (const auto& c : cases) {
        SCOPED_TRACE(c.name);
        const auto ior = named_metal(c.name);
        ASSERT_TRUE(ior);
        expect_near_relative(ior->eta, c.eta, 2e-3f);
        expect_near_relative(ior->k, c.k, 2e-3f);
    }
}

TEST(Metals, TheNobleOnesHaveTheirColours) {
    auto reflectance = [](const char* name) {
        const ConductorIor m = *named_metal(name);
        return Rgb(normal_reflectance(m.eta.r, m.k.r), normal_reflectance(m.eta.g, m.k.g),
                   normal_reflectance(m.eta.b, m.k.b));
    };
    const Rgb gold = reflectance("Au"), copper = reflectance("Cu"), silver = reflectance("Ag");
    EXPECT_GT(gold.r, gold.g + 0.1f);
    EXPECT_GT(gold.g, gold.b + 0.2f);
    EXPECT_GT(copper.r, copper.g + 0.2f);
    EXPECT_GT(std::min({silver.r, silver.g, silver.b}), 0.85f);
}

TEST(Metals, EveryNameIsFoundAndPlausible) {
    const auto names = metal_names();
    EXPECT_GE(names.size(), 30u);
    for (const std::string& name : names) {
        SCOPED_TRACE(name);
        const auto ior = named_metal(name);
        ASSERT_TRUE(ior);
        for (int i = 0; i < 3; ++i) {
            EXPECT_GT(ior->eta[i], 0.03f);
            EXPECT_LT(ior->eta[i], 8);
            EXPECT_GE(ior->k[i], 0);
            EXPECT_LT(ior->k[i], 10);
        }
        EXPECT_EQ(std::count(names.begin(), names.end(), name), 1);
    }
}

TEST(Metals, UnknownNamesAreNotFound) {
    EXPECT_FALSE(named_metal("unobtainium"));
    EXPECT_FALSE(named_metal("au"));
    EXPECT_FALSE(named_metal("none"));
    EXPECT_FALSE(named_metal(""));
    EXPECT_FALSE(named_metal("_palik"));
}

}  // namespace
}  // namespace etendue
