#include "studio/pixel_values.h"

#include <algorithm>
#include <cmath>

#include "math/statistics.h"

namespace etendue {

std::vector<float> relative_errors(const Snapshot& s) {
    std::vector<float> errors(s.mean.size());
    double mean = 0;
    for (const Rgb c : s.mean)
        if (is_finite(c)) mean += double(luminance(c)) / double(s.mean.size());
    for (size_t i = 0; i < errors.size(); ++i) {
        const float y = luminance(s.mean[i]), scale = std::max(std::abs(y), float(0.1 * mean));
        const Rgb v = s.variance[i];
        // Of the luminance if the errors of the channels are those of one factor, as the noise of paths mostly is; in no
        // case is the luminance's larger.
        const float error = luminance(Rgb(std::sqrt(v.r), std::sqrt(v.g), std::sqrt(v.b)));
        errors[i] = scale > 0 ? error / scale : 0.0f;
    }
    return errors;
}

RectangleValues values_in(const Snapshot& s, const ImageRect& rect) {
    RectangleValues v;
    std::array<Moments, 3> moments;
    for_each_pixel(rect, s.width, [&](size_t i) {
        const Rgb c = s.mean[i];
        if (std::isnan(c.r) || std::isnan(c.g) || std::isnan(c.b)) {
            ++v.nan;
            return;
        }
        if (!is_finite(c)) {
            ++v.infinite;
            return;
        }
        for (size_t k = 0; k < 3; ++k) {
            const auto value = double(c[int(k)]);
            v.least[k] = v.finite > 0 ? std::min(v.least[k], value) : value;
            v.largest[k] = v.finite > 0 ? std::max(v.largest[k], value) : value;
            moments[k].add(value);
            if (!s.variance.empty()) v.squared_error[k] += double(s.variance[i][int(k)]);
        }
        ++v.finite;
    });
    for (size_t k = 0; k < 3; ++k) {
        v.mean[k] = moments[k].mean();
        v.variance[k] = moments[k].variance();
        v.squared_error[k] /= sqr(std::max(1.0, double(v.finite)));
    }
    return v;
}

}  // namespace etendue
