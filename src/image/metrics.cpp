#include "image/metrics.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace etendue {
namespace {

constexpr double kTrimmed = 0.001;
constexpr double kSpikeQuantile = 0.9999;

double grey(Rgb c) {
    return (double(c.r) + c.g + c.b) / 3;
}

/// 0/0 is 0: black pixels of black images have no error.
double ratio(double error, double scale) {
    return error == 0 ? 0 : error / scale;
}

/// Image and references at one pixel.
struct Greys {
    double x, r1, r2;

    double r() const { return (r1 + r2) / 2; }
    double squared_error() const { return (x - r1) * (x - r2); }
    double relative_squared_error(double m) const {
        return ratio(squared_error(), r() * r() + 0.01 * m * m);
    }
    bool is_finite() const { return std::isfinite(x + r1 + r2); }
};

class Comparison {
public:
    Comparison(std::span<const Rgb> image, std::span<const Rgb> reference,
               std::span<const Rgb> reference2)
        : image_(image), reference_(reference),
          reference2_(reference2.empty() ? reference : reference2) {
        if (image.size() != reference.size() || image.size() != reference2_.size())
            throw std::invalid_argument("images of different sizes cannot be compared");
        for (size_t i = 0; i < size(); ++i) {
            const Greys g = at(i);
            if (!g.is_finite()) continue;
            ++finite_;
            sum_x_ += g.x;
            sum_r_ += g.r();
        }
    }

    size_t size() const { return image_.size(); }
    size_t finite() const { return finite_; }
    Greys at(size_t i) const {
        return {grey(image_[i]), grey(reference_[i]), grey(reference2_[i])};
    }
    double reference_mean() const { return sum_r_ / double(finite_); }
    double mean_ratio() const { return sum_x_ / sum_r_; }

private:
    std::span<const Rgb> image_, reference_, reference2_;
    size_t finite_ = 0;
    double sum_x_ = 0, sum_r_ = 0;
};

double mean(std::span<const double> v) {
    double sum = 0;
    for (double x : v) sum += x;
    return sum / double(v.size());
}

}  // namespace

ImageErrors image_errors(std::span<const Rgb> image, std::span<const Rgb> reference,
                         const ErrorOptions& options) {
    const Comparison pixels(image, reference, options.reference2);
    const double m = pixels.reference_mean();
    std::vector<double> squared, relative, absolute, mape, smape;
    for (size_t i = 0; i < pixels.size(); ++i) {
        const Greys g = pixels.at(i);
        if (!g.is_finite() || g.r() > options.ignore_above) continue;
        const double d = std::fabs(g.x - g.r());
        squared.push_back(g.squared_error());
        relative.push_back(g.relative_squared_error(m));
        absolute.push_back(d);
        mape.push_back(ratio(d, std::fabs(g.r()) + 0.01 * m));
        smape.push_back(ratio(d, (std::fabs(g.x) + std::fabs(g.r())) / 2 + 0.01 * m));
    }
    if (squared.empty()) throw std::invalid_argument("no pixel is left to compare");

    ImageErrors e;
    e.pixels = pixels.size();
    e.not_finite = pixels.size() - pixels.finite();
    e.ignored = pixels.finite() - squared.size();
    e.mse = mean(squared);
    e.rmse = std::sqrt(std::max(e.mse, 0.0));
    e.rel_mse = mean(relative);
    std::sort(relative.begin(), relative.end());
    const auto kept = std::max<size_t>(size_t(double(relative.size()) * (1 - kTrimmed)), 1);
    e.rel_mse_trimmed = mean(std::span(relative).first(kept));
    e.l1 = mean(absolute);
    const auto spike = absolute.begin() + std::ptrdiff_t(kSpikeQuantile * double(absolute.size()));
    std::nth_element(absolute.begin(), spike, absolute.end());
    e.spike = ratio(*spike, m);
    e.mape = mean(mape);
    e.smape = mean(smape);
    e.mean_ratio = pixels.mean_ratio();
    return e;
}

std::vector<float> relative_squared_errors(std::span<const Rgb> image,
                                           std::span<const Rgb> reference,
                                           std::span<const Rgb> reference2) {
    const Comparison pixels(image, reference, reference2);
    const double m = pixels.reference_mean();
    std::vector<float> map(pixels.size(), std::numeric_limits<float>::quiet_NaN());
    for (size_t i = 0; i < map.size(); ++i) {
        const Greys g = pixels.at(i);
        if (g.is_finite()) map[i] = float(g.relative_squared_error(m));
    }
    return map;
}

}  // namespace etendue
