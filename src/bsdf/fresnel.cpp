#include "bsdf/fresnel.h"

namespace etendue {

namespace {

/// For n > 1.
double external_diffuse_reflectance(double n) {
    // Closer to n = 1 the terms cancel. The value is below 1e-3 there and approximated as linear.
    constexpr double kNearlyOne = 1.0005;
    if (n < kNearlyOne)
        return external_diffuse_reflectance(kNearlyOne) * (n - 1) / (kNearlyOne - 1);
    const double n2 = n * n, n4 = n2 * n2;
    return 0.5 + (n - 1) * (3 * n + 1) / (6 * sqr(n + 1)) +
           n2 * sqr(n2 - 1) / (sqr(n2 + 1) * (n2 + 1)) * std::log((n - 1) / (n + 1)) -
           2 * n2 * n * (n2 + 2 * n - 1) / ((n2 + 1) * (n4 - 1)) +
           8 * n4 * (n4 + 1) / ((n2 + 1) * sqr(n4 - 1)) * std::log(n);
}

}  // namespace

float fresnel_diffuse_reflectance(float eta) {
    if (eta >= 1) return float(external_diffuse_reflectance(eta));
    return float(1 - (1 - external_diffuse_reflectance(1 / double(eta))) * sqr(double(eta)));
}

float fresnel_diffuse_transmittance(float eta) {
    if (eta >= 1) return float(1 - external_diffuse_reflectance(eta));
    return float((1 - external_diffuse_reflectance(1 / double(eta))) * sqr(double(eta)));
}

}  // namespace etendue
