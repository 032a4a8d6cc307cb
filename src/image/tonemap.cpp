#include "image/tonemap.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "color/srgb.h"

namespace etendue {
namespace {

// (a x² + b x) / (c x² + d x + e) of [Narkowicz 2016], where x is the exposed colour times kAcesScale.
constexpr double kAcesScale = 0.6, kAcesA = 2.51, kAcesB = 0.03, kAcesC = 2.43, kAcesD = 0.59,
                 kAcesE = 0.14;

Rgb clamp01(Rgb c) {
    return {std::clamp(c.r, 0.0f, 1.0f), std::clamp(c.g, 0.0f, 1.0f), std::clamp(c.b, 0.0f, 1.0f)};
}

/// L (1 + L / L_white²) / (1 + L) over L.
Rgb reinhard(Rgb c, double white) {
    const double L = std::max(luminance(c), 0.0f);
    if (std::isinf(L)) return Rgb(1);
    return c * float((1 + L / (white * white)) / (1 + L));
}

}  // namespace

std::optional<ToneOperator> tone_operator(std::string_view name) {
    if (name == "srgb") return ToneOperator::Srgb;
    if (name == "reinhard") return ToneOperator::Reinhard;
    if (name == "aces") return ToneOperator::Aces;
    return {};
}

float aces_curve(float exposed) {
    const double x = kAcesScale * std::max(exposed, 0.0f);
    if (std::isinf(x)) return 1;
    return float(
        std::clamp((kAcesA * x + kAcesB) * x / ((kAcesC * x + kAcesD) * x + kAcesE), 0.0, 1.0));
}

double inverse_aces_curve(double y) {
    // (y c − a) x² + (y d − b) x + y e = 0
    const double p = y * kAcesC - kAcesA, q = y * kAcesD - kAcesB, r = y * kAcesE;
    return (-q - std::sqrt(q * q - 4 * p * r)) / (2 * p) / kAcesScale;
}

std::vector<float> finite_luminances(std::span<const Rgb> pixels) {
    std::vector<float> values;
    for (const Rgb c : pixels)
        if (is_finite(c)) values.push_back(luminance(c));
    return values;
}

ToneCurve::ToneCurve(const ToneMapping& mapping, float largest)
    : op_(mapping.op),
      // Zero times infinity would be no colour.
      scale_(std::exp2(std::clamp(mapping.exposure, -126.0f, 127.0f))), white_(mapping.white) {
    if (white_ > 0) return;
    white_ = std::max(0.0, double(largest) * double(scale_));
    if (white_ == 0) white_ = 1;  // black stays black
}

Rgb ToneCurve::operator()(Rgb c) const {
    c *= scale_;
    if (op_ == ToneOperator::Reinhard) c = reinhard(c, white_);
    if (op_ == ToneOperator::Aces) c = {aces_curve(c.r), aces_curve(c.g), aces_curve(c.b)};
    return clamp01(c);
}

std::vector<Rgb> tone_map(std::span<const Rgb> pixels, const ToneMapping& mapping) {
    const std::vector<float> values = finite_luminances(pixels);
    const ToneCurve curve(mapping,
                          values.empty() ? 0 : *std::max_element(values.begin(), values.end()));
    std::vector<Rgb> mapped(pixels.begin(), pixels.end());
    for (Rgb& c : mapped) c = curve(c);
    return mapped;
}

Rgb magma(float v) {
    if (std::isnan(v)) return Rgb(v);
    // Ten colours of the map at equal distances, as sRGB codes.
    constexpr uint32_t kStops[] = {0x000004, 0x180f3e, 0x451077, 0x721f81, 0x9f2f7f,
                                   0xcd4071, 0xf1605d, 0xfd9567, 0xfec98d, 0xfcfdbf};
    constexpr int kLast = int(std::size(kStops)) - 1;
    const float x = std::clamp(v, 0.0f, 1.0f) * kLast;
    const int i = std::min(int(x), kLast - 1);
    const auto channel = [&](int shift) {
        const float lo = float(kStops[i] >> shift & 255u),
                    hi = float(kStops[i + 1] >> shift & 255u);
        return srgb_to_linear((lo + (x - float(i)) * (hi - lo)) / 255);
    };
    return {channel(16), channel(8), channel(0)};
}

float auto_exposure(std::vector<float> values) {
    if (values.empty()) return 0;
    const auto high = values.begin() + std::ptrdiff_t(0.95 * double(values.size() - 1));
    std::nth_element(values.begin(), high, values.end());
    return *high > 0 ? std::round(4 * std::log2(0.8f / *high)) / 4 : 0;
}

}  // namespace etendue
