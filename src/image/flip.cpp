// FLIP [Andersson et al. 2020: "FLIP: A Difference Evaluator for Alternating Images"; Andersson et al. 2021:
// "Visualizing and Communicating Errors in Rendered Images"]. Both images are filtered by the contrast sensitivity of
// the eye. The error of a pixel is its colour difference to the power of 1 − (difference of edges and points).
// Constants are those of the papers.

#include "image/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "image/tonemap.h"

namespace etendue {
namespace {

constexpr double kPi = 3.14159265358979323846;

// ------------------------------------------------------------------------------------------------------- colours

using Triple = std::array<float, 3>;
using Matrix3 = std::array<Triple, 3>;

// Linear sRGB to XYZ and back, from the primaries and the white point (0.3127, 0.3290) of [IEC 61966-2-1].
constexpr Matrix3 kXyzFromRgb = {{{0.412390799f, 0.357584339f, 0.180480788f},
                                  {0.212639006f, 0.715168679f, 0.072192315f},
                                  {0.019330819f, 0.119194780f, 0.950532152f}}};
constexpr Matrix3 kRgbFromXyz = {{{3.240969942f, -1.537383178f, -0.498610760f},
                                  {-0.969243636f, 1.875967502f, 0.041555057f},
                                  {0.055630080f, -0.203976959f, 1.056971514f}}};
constexpr Triple kWhite = {0.950455927f, 1.0f, 1.089057751f};

Triple operator*(const Matrix3& m, const Triple& v) {
    Triple r;
    for (int i = 0; i < 3; ++i) r[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    return r;
}

/// XYZ divided by that of the white point.
Triple relative_xyz(Rgb c) {
    Triple t = kXyzFromRgb * Triple{c.r, c.g, c.b};
    for (int i = 0; i < 3; ++i) t[i] /= kWhite[i];
    return t;
}

/// The linear opponent space YCxCz, where the eye's contrast sensitivity is known.
Triple ycxcz(Rgb c) {
    const auto [x, y, z] = relative_xyz(c);
    return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}
Rgb rgb_from_ycxcz(const Triple& t) {
    const float y = (t[0] + 16) / 116, x = y + t[1] / 500, z = y - t[2] / 200;
    const Triple c = kRgbFromXyz * Triple{x * kWhite[0], y * kWhite[1], z * kWhite[2]};
    return {std::clamp(c[0], 0.0f, 1.0f), std::clamp(c[1], 0.0f, 1.0f),
            std::clamp(c[2], 0.0f, 1.0f)};
}

/// L*a*b* with the Hunt effect: a* and b* are scaled by 0.01 L*.
Triple hunt_lab(Rgb c) {
    Triple f = relative_xyz(c);
    constexpr float kDelta = 6.0f / 29;
    for (float& v : f)
        v = v > kDelta * kDelta * kDelta ? std::cbrt(v) : v / (3 * kDelta * kDelta) + 4.0f / 29;
    const float L = 116 * f[1] - 16;
    return {L, 0.01f * L * 500 * (f[0] - f[1]), 0.01f * L * 200 * (f[1] - f[2])};
}

float hyab(const Triple& a, const Triple& b) {
    return std::fabs(a[0] - b[0]) + std::hypot(a[1] - b[1], a[2] - b[2]);
}

// ------------------------------------------------------------------------------------------------------- filters

struct Plane {
    int width, height;
    std::vector<float> data;

    Plane(int width, int height) : width(width), height(height), data(size_t(width) * height) {}
};

/// Coefficients at −radius, …, radius; always an odd number.
using Kernel = std::vector<float>;

/// `rows` along x, then `columns` along y; the border is repeated.
Plane convolve(const Plane& in, const Kernel& rows, const Kernel& columns) {
    const int radius_x = int(rows.size() / 2), radius_y = int(columns.size() / 2);
    Plane along_x(in.width, in.height), out(in.width, in.height);
    std::vector<float> padded(size_t(in.width) + 2 * radius_x);
    for (int y = 0; y < in.height; ++y) {
        const float* from = in.data.data() + size_t(y) * in.width;
        for (int i = 0; i < int(padded.size()); ++i)
            padded[i] = from[std::clamp(i - radius_x, 0, in.width - 1)];
        float* to = along_x.data.data() + size_t(y) * in.width;
        for (size_t k = 0; k < rows.size(); ++k)
            for (int x = 0; x < in.width; ++x) to[x] += rows[k] * padded[x + k];
    }
    for (int y = 0; y < in.height; ++y) {
        float* to = out.data.data() + size_t(y) * in.width;
        for (int k = -radius_y; k <= radius_y; ++k) {
            const float* from =
                along_x.data.data() + size_t(std::clamp(y + k, 0, in.height - 1)) * in.width;
            for (int x = 0; x < in.width; ++x) to[x] += columns[k + radius_y] * from[x];
        }
    }
    return out;
}

template <class F>
Kernel sampled(int radius, F&& f) {
    Kernel k;
    for (int i = -radius; i <= radius; ++i) k.push_back(float(f(double(i))));
    return k;
}

double sum(const Kernel& k) {
    double s = 0;
    for (float v : k) s += v;
    return s;
}

/// Gaussian terms a √(π/b) exp(−π² r²/b) of a contrast sensitivity's point spread, r in degrees.
struct Sensitivity {
    double a1, b1, a2, b2;
};
constexpr Sensitivity kAchromatic = {1, 0.0047, 0, 1e-5}, kRedGreen = {1, 0.0053, 0, 1e-5},
                      kBlueYellow = {34.1, 0.04, 13.5, 0.025};

Plane filter_by_sensitivity(const Plane& in, const Sensitivity& s, double ppd) {
    const int radius = int(std::ceil(3 * std::sqrt(kBlueYellow.b1 / (2 * kPi * kPi)) * ppd));
    const auto gaussian = [&](double b) {
        return sampled(radius,
                       [&](double i) { return std::exp(-kPi * kPi * (i / ppd) * (i / ppd) / b); });
    };
    Kernel g1 = gaussian(s.b1), g2 = gaussian(s.b2);
    // The sum over both dimensions is one. Each term is separable.
    const double w1 = s.a1 * std::sqrt(kPi / s.b1), w2 = s.a2 * std::sqrt(kPi / s.b2);
    const double total = w1 * sum(g1) * sum(g1) + w2 * sum(g2) * sum(g2);
    const auto term = [&](const Kernel& g, double w) {
        Kernel scaled = g;
        for (float& v : scaled) v = float(v * w / total);
        return convolve(in, scaled, g);
    };
    Plane out = term(g1, w1);
    if (s.a2 > 0) {
        const Plane second = term(g2, w2);
        for (size_t i = 0; i < out.data.size(); ++i) out.data[i] += second.data[i];
    }
    return out;
}

/// Scales positive and negative taps so that each sign sums to one.
Kernel balanced(Kernel k) {
    double positive = 0, negative = 0;
    for (float v : k) (v > 0 ? positive : negative) += v;
    for (float& v : k) v = float(v > 0 ? v / positive : -v / negative);
    return k;
}

/// Strengths of edges and of points: lengths of the gradient and of the pure second derivatives of a Gaussian.
struct Features {
    std::vector<float> edge, point;
};

Features features(const Plane& lightness, double ppd) {
    constexpr double kFeatureWidth = 0.082;  // degrees
    const double sigma = 0.5 * kFeatureWidth * ppd;
    const int radius = int(std::ceil(3 * sigma));
    const auto g = [&](double x) { return std::exp(-x * x / (2 * sigma * sigma)); };
    Kernel smooth = sampled(radius, g);
    const double total = sum(smooth);
    for (float& v : smooth) v = float(v / total);
    const Kernel first = balanced(sampled(radius, [&](double x) { return -x * g(x); }));
    const Kernel second =
        balanced(sampled(radius, [&](double x) { return (x * x / (sigma * sigma) - 1) * g(x); }));
    const auto strength = [&](const Kernel& derivative) {
        std::vector<float> s = convolve(lightness, derivative, smooth).data;
        const std::vector<float> along_y = convolve(lightness, smooth, derivative).data;
        for (size_t i = 0; i < s.size(); ++i) s[i] = std::hypot(s[i], along_y[i]);
        return s;
    };
    return {strength(first), strength(second)};
}

// ---------------------------------------------------------------------------------------------------------- FLIP

/// What one image contributes: colours as perceived, and features.
struct Perceived {
    std::vector<Triple> lab;
    Features features;
};

Perceived perceive(std::span<const Rgb> pixels, int width, int height, double ppd) {
    std::array<Plane, 3> opponent = {Plane(width, height), Plane(width, height),
                                     Plane(width, height)};
    Plane lightness(width, height);
    for (size_t i = 0; i < pixels.size(); ++i) {
        const Triple t = ycxcz(pixels[i]);
        for (int c = 0; c < 3; ++c) opponent[c].data[i] = t[c];
        lightness.data[i] = (t[0] + 16) / 116;
    }
    opponent[0] = filter_by_sensitivity(opponent[0], kAchromatic, ppd);
    opponent[1] = filter_by_sensitivity(opponent[1], kRedGreen, ppd);
    opponent[2] = filter_by_sensitivity(opponent[2], kBlueYellow, ppd);
    std::vector<Triple> lab(pixels.size());
    for (size_t i = 0; i < lab.size(); ++i)
        lab[i] = hunt_lab(
            rgb_from_ycxcz({opponent[0].data[i], opponent[1].data[i], opponent[2].data[i]}));
    return {std::move(lab), features(lightness, ppd)};
}

constexpr float kColourExponent = 0.7f, kFeatureExponent = 0.5f;

/// Maps HyAB^q_c to [0, 1]: distances up to 0.4 of the largest take 0.95 of the range.
float redistribute(float e) {
    constexpr float kCut = 0.4f, kTarget = 0.95f;
    static const float kLargest =
        std::pow(hyab(hunt_lab({0, 1, 0}), hunt_lab({0, 0, 1})), kColourExponent);
    const float cut = kCut * kLargest;
    return e < cut ? e * kTarget / cut : kTarget + (e - cut) / (kLargest - cut) * (1 - kTarget);
}

std::vector<float> flip_map(const Perceived& image, const Perceived& reference) {
    std::vector<float> map(image.lab.size());
    for (size_t i = 0; i < map.size(); ++i) {
        const float colour =
            redistribute(std::pow(hyab(image.lab[i], reference.lab[i]), kColourExponent));
        const float edge = std::fabs(image.features.edge[i] - reference.features.edge[i]);
        const float point = std::fabs(image.features.point[i] - reference.features.point[i]);
        const float feature = std::pow(std::max(edge, point) / std::sqrt(2.0f), kFeatureExponent);
        map[i] = std::clamp(std::pow(colour, 1 - feature), 0.0f, 1.0f);
    }
    return map;
}

void check_sizes(std::span<const Rgb> image, std::span<const Rgb> reference, int width,
                 int height) {
    if (image.size() != size_t(width) * height || reference.size() != image.size() || image.empty())
        throw std::invalid_argument("images of different sizes cannot be compared");
}

/// Replaces pixels that are not finite by black; finished() gives them the largest error.
std::vector<Rgb> finite_or_black(std::span<const Rgb> pixels) {
    std::vector<Rgb> v(pixels.begin(), pixels.end());
    for (Rgb& c : v)
        if (!is_finite(c)) c = {};
    return v;
}

FlipResult finished(std::vector<float> map, std::span<const Rgb> image,
                    std::span<const Rgb> reference) {
    double total = 0;
    for (size_t i = 0; i < map.size(); ++i) {
        if (!is_finite(image[i]) || !is_finite(reference[i])) map[i] = 1;
        total += map[i];
    }
    return {std::move(map), total / double(image.size())};
}

std::vector<float> flip_at(std::span<const Rgb> image, std::span<const Rgb> reference, int width,
                           int height, float ppd, const ToneMapping& mapping) {
    return flip_map(perceive(tone_map(image, mapping), width, height, ppd),
                    perceive(tone_map(reference, mapping), width, height, ppd));
}

}  // namespace

FlipResult ldr_flip(std::span<const Rgb> image, std::span<const Rgb> reference, int width,
                    int height, float ppd) {
    check_sizes(image, reference, width, height);
    return finished(
        flip_at(finite_or_black(image), finite_or_black(reference), width, height, ppd, {}), image,
        reference);
}

std::vector<float> flip_exposures(std::span<const Rgb> reference) {
    std::vector<double> luminances;
    for (const Rgb c : reference) {
        const float L = kXyzFromRgb[1][0] * c.r + kXyzFromRgb[1][1] * c.g + kXyzFromRgb[1][2] * c.b;
        if (std::isfinite(L)) luminances.push_back(std::max(L, 0.0f));
    }
    std::sort(luminances.begin(), luminances.end());
    if (luminances.empty() || luminances.back() <= 0) return {0};
    const double largest = luminances.back();
    // The median is zero where half the pixels are black; a fraction of the largest luminance replaces it then.
    const double median = std::max(luminances[luminances.size() / 2], largest * 0x1p-24);
    const double bright = inverse_aces_curve(0.85);
    const double start = std::log2(bright / largest), stop = std::log2(bright / median);
    const int count = std::max(2, int(std::ceil(stop - start)));
    std::vector<float> exposures;
    for (int i = 0; i < count; ++i)
        exposures.push_back(float(start + (stop - start) * i / (count - 1)));
    return exposures;
}

FlipResult hdr_flip(std::span<const Rgb> image, std::span<const Rgb> reference, int width,
                    int height, float ppd) {
    check_sizes(image, reference, width, height);
    const std::vector<Rgb> x = finite_or_black(image), r = finite_or_black(reference);
    std::vector<float> largest(image.size());
    for (const float exposure : flip_exposures(r)) {
        const auto map =
            flip_at(x, r, width, height, ppd, {.op = ToneOperator::Aces, .exposure = exposure});
        for (size_t i = 0; i < map.size(); ++i) largest[i] = std::max(largest[i], map[i]);
    }
    return finished(std::move(largest), image, reference);
}

}  // namespace etendue
