#include "color/spectrum.h"

#include <gtest/gtest.h>

#include <vector>

#include "expect_rgb.h"

namespace etendue {
namespace {

TEST(Spectrum, FlatSpectrumHasUnitLuminanceUnderBothIlluminants) {
    const std::vector<double> nm = {300, 900}, one = {1, 1};
    EXPECT_NEAR(luminance(spectrum_to_rgb(nm, one)), 1, 1e-4f);
    EXPECT_NEAR(luminance(spectrum_to_rgb(nm, one, Illuminant::D65)), 1, 1e-4f);
}

TEST(Spectrum, FlatReflectanceIsWhite) {
    const std::vector<double> nm = {300, 900}, half = {0.5, 0.5};
    expect_near_relative(spectrum_to_rgb(nm, half, Illuminant::D65), Rgb(0.5f), 1e-3f);
}

// Equal-energy white has the chromaticity (1/3, 1/3), hence X = Y = Z.
TEST(Spectrum, EqualEnergyHasEqualXyz) {
    const std::vector<double> nm = {300, 900}, one = {1, 1};
    expect_near_relative(spectrum_to_rgb(nm, one), xyz_to_rgb(1, 1, 1), 1e-3f);
}

TEST(Spectrum, D65WhitePointIsWhite) {
    // [ITU-R BT.709-6, §1.4]
    const double x = 0.3127, y = 0.3290;
    expect_near_relative(xyz_to_rgb(x / y, 1, (1 - x - y) / y), Rgb(1), 1e-3f);
}

struct MitsubaCase {
    std::vector<double> nm, values;
    Rgb equal_energy, d65;
};
// Colours that Mitsuba 3.9 gives these lists as radiance (equal energy) and as reflectance (D65).
TEST(Spectrum, AgreesWithMitsuba) {
    const MitsubaCase cases[] = {
        {{400, 700}, {1, 1}, {1.19969f, 0.949521f, 0.903443f}, {0.995341f, 0.999756f, 0.99491f}},
        {{400, 500, 600, 700},
         {0, 8, 15.6, 18.4},
         {20.7108f, 10.8546f, 2.77115f},
         {17.7147f, 11.3544f, 3.30451f}},
    };
    for (const MitsubaCase& c : cases) {
        expect_near_relative(spectrum_to_rgb(c.nm, c.values), c.equal_energy, 2e-3f);
        expect_near_relative(spectrum_to_rgb(c.nm, c.values, Illuminant::D65), c.d65, 2e-3f);
    }
}

TEST(Spectrum, ZeroOutsideItsRangeAndForDegenerateLists) {
    const std::vector<double> infrared = {800, 900}, one_knot = {500}, values = {1, 1}, value = {1};
    EXPECT_TRUE(spectrum_to_rgb(infrared, values).is_zero());
    EXPECT_TRUE(spectrum_to_rgb(one_knot, value).is_zero());
    EXPECT_TRUE(spectrum_to_rgb({}, {}).is_zero());
}

TEST(Spectrum, OutOfGamutComponentsAreZero) {
    const std::vector<double> nm = {500, 520}, one = {1, 1};
    const Rgb c = spectrum_to_rgb(nm, one);
    EXPECT_EQ(c.r, 0);
    EXPECT_GT(c.g, 0);
}

// Splitting a spectrum at extra collinear knots must not change it.
TEST(Spectrum, IsLinearBetweenKnots) {
    const std::vector<double> coarse_nm = {390, 710}, coarse = {1, 3};
    std::vector<double> fine_nm, fine;
    for (int i = 0; i <= 64; ++i) {
        fine_nm.push_back(390 + i * 5);
        fine.push_back(1 + i * 2.0 / 64);
    }
    expect_near_relative(spectrum_to_rgb(fine_nm, fine), spectrum_to_rgb(coarse_nm, coarse), 1e-5f);
}

// Planck's law integrated independently (1 nm trapezoids, 360 to 830 nm, CIE 1931 observer).
TEST(Blackbody, AgreesWithReference) {
    expect_near_relative(blackbody_rgb(2700), {314.192f, 130.499f, 31.1679f}, 2e-3f);
    expect_near_relative(blackbody_rgb(5000), {15263.1f, 12082.6f, 9592.58f}, 2e-3f);
    expect_near_relative(blackbody_rgb(6500), {43918.7f, 41407.3f, 43582.8f}, 2e-3f);
}

TEST(Blackbody, ExtremeTemperaturesAreFinite) {
    EXPECT_TRUE(blackbody_rgb(1).is_zero());
    EXPECT_TRUE(is_finite(blackbody_rgb(1e6)));
}

}  // namespace
}  // namespace etendue
