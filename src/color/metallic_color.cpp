#include "color/metallic_color.h"

#include <algorithm>
#include <cmath>

namespace etendue {

MetallicColor metallic_color(Rgb diffuse, Rgb specular) {
    constexpr double kF0 = 0.04, kLeast = 1e-6, kRounding = 1e-6;
    for (int c = 0; c < 3; ++c) specular[c] = std::min(specular[c], 1.0f);
    const double rest = 1 - double(specular.max()), s = double(luminance(specular)),
                 f0 = std::min(s, kF0), d = double(luminance(diffuse)) * rest / (1 - kF0);
    // With the base colour b: d = b (1 - m) and s = kF0 (1 - m) + b m, hence kF0 m² + (d + s - 2 kF0) m + kF0 - s = 0.
    double m = 0;
    if (s > kF0 + kRounding) {
        const double p = d + s - 2 * kF0, discriminant = p * p - 4 * kF0 * (kF0 - s);
        m = std::clamp((-p + std::sqrt(std::max(discriminant, 0.0))) / (2 * kF0), 0.0, 1.0);
    }
    const Rgb of_diffuse = diffuse * float(rest / (1 - f0) / std::max(1 - m, kLeast)),
              of_specular = (specular - Rgb(float(kF0 * (1 - m)))) * float(1 / std::max(m, kLeast));
    const Rgb base = lerp(float(m * m), of_diffuse, of_specular);
    const auto in_range = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
    return {float(m), {in_range(base.r), in_range(base.g), in_range(base.b)}, float(f0 / kF0)};
}

}  // namespace etendue
