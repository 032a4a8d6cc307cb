#include "session/seed_series.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "math/statistics.h"
#include "math/vec.h"

namespace etendue {
namespace {

using Images = std::vector<std::shared_ptr<const SeedSeries::Image>>;

/// Relative variances of one image: from all images, and from all but one, for each of them.
struct Spread {
    double variance = 0;
    std::vector<double> without;
};

/// `weights`: of the pixels.
Spread spread(const Images& images, const std::vector<double>& weights) {
    const size_t count = images.size();
    const auto k = double(count);
    Spread s;
    s.without.resize(count);
    for (size_t i = 0; i < weights.size(); ++i) {
        double mean = 0, squares = 0;
        for (const auto& image : images) mean += double((*image)[i]) / k;
        for (const auto& image : images) squares += sqr(double((*image)[i]) - mean);
        s.variance += weights[i] * squares / (k - 1);
        // The sum of squares without one value [Welford 1962].
        for (size_t j = 0; j < count; ++j) {
            const double rest = squares - sqr(double((*images[j])[i]) - mean) * k / (k - 1);
            s.without[j] += weights[i] * std::max(0.0, rest) / (k - 2);
        }
    }
    return s;
}

/// Squared error of the logarithm of variance times time, by the jackknife.
double squared_log_error(const Spread& s, const SeedSeries& series) {
    Moments logs;
    for (size_t i = 0; i < s.without.size(); ++i)
        logs.add(std::log(s.without[i] * (series.total_seconds() - series.seconds[i])));
    const auto k = double(s.without.size());
    return logs.variance() * sqr(k - 1) / k;
}

SeedComparison::Method method(const SeedSeries& series) {
    SeedComparison::Method m;
    Moments means;
    for (const auto& image : series.luminance) {
        double sum = 0;
        for (const float y : *image) sum += double(y);
        means.add(sum / double(image->size()));
    }
    m.mean = means.mean();
    m.mean_error = std::sqrt(means.squared_error());
    m.seconds = series.total_seconds() / std::max(1.0, double(series.luminance.size()));
    return m;
}

}  // namespace

double SeedSeries::total_seconds() const {
    return std::accumulate(seconds.begin(), seconds.end(), 0.0);
}

void SeedSeries::add(Image image, double seconds_of_image,
                     const std::vector<std::pair<std::string, double>>& its_figures) {
    luminance.push_back(std::make_shared<const Image>(std::move(image)));
    seconds.push_back(seconds_of_image);
    const auto n = double(luminance.size());
    for (auto& [name, mean] : figures) mean *= (n - 1) / n;
    for (const auto& [name, value] : its_figures) {
        const auto at =
            std::find_if(figures.begin(), figures.end(),
                         [&its_name = name](const auto& f) { return f.first == its_name; });
        if (at == figures.end())
            figures.emplace_back(name, value / n);
        else
            at->second += value / n;
    }
}

void SeedSeries::save(SectionWriter& to) const {
    to.put(seconds);
    for (const auto& image : luminance) to.put(*image);
    to.put(uint64_t(figures.size()));
    for (const auto& [name, mean] : figures) {
        to.put(name);
        to.put(mean);
    }
}

void SeedSeries::load(SectionReader& from, uint64_t pixels) {
    from.get(seconds);
    for (size_t i = 0; i < seconds.size(); ++i) {
        Image image;
        from.get(image, pixels, "pixels");
        luminance.push_back(std::make_shared<const Image>(std::move(image)));
    }
    for (auto left = from.get<uint64_t>(); left > 0; --left) {
        std::string name;
        from.get(name);
        figures.emplace_back(std::move(name), from.get<double>());
    }
}

SeedComparison compare(const SeedSeries& a, const SeedSeries& b) {
    SeedComparison c;
    c.a = method(a), c.b = method(b);
    if (std::min(a.luminance.size(), b.luminance.size()) < 3) return c;
    const size_t pixels = a.luminance[0]->size();
    if (b.luminance[0]->size() != pixels) return c;
    // Both methods have the same weights, so that only their variances differ. The less noisy one determines them: a
    // pixel that is too bright by chance would have a weight that is too small.
    std::vector<double> weights(pixels, 1);
    const double noise_a = spread(a.luminance, weights).variance / double(a.luminance.size()),
                 noise_b = spread(b.luminance, weights).variance / double(b.luminance.size());
    const double share_a = noise_a + noise_b > 0 ? noise_b / (noise_a + noise_b) : 0.5;
    double mean = 0;
    std::fill(weights.begin(), weights.end(), 0.0);
    for (const auto& [images, share] :
         {std::pair{&a.luminance, share_a}, {&b.luminance, 1 - share_a}})
        for (const auto& image : *images)
            for (size_t i = 0; i < pixels; ++i)
                weights[i] += double((*image)[i]) * share / double(images->size());
    for (const double w : weights) mean += w / double(pixels);
    for (double& w : weights) w = 1 / ((sqr(w) + 0.01 * sqr(mean)) * double(pixels));
    const Spread of_a = spread(a.luminance, weights), of_b = spread(b.luminance, weights);
    c.a.variance = of_a.variance, c.b.variance = of_b.variance;
    const double difference = std::abs(c.a.mean - c.b.mean),
                 error = std::hypot(c.a.mean_error, c.b.mean_error);
    const double dof = double(a.luminance.size() + b.luminance.size() - 2);
    c.means_differ = difference > student_quantile(0.01, dof) * error;
    if (!(mean > 0 && of_a.variance > 0 && of_b.variance > 0)) return c;
    const double squared = squared_log_error(of_a, a) + squared_log_error(of_b, b);
    if (!std::isfinite(squared)) return c;
    c.ratio = of_a.variance / of_b.variance;
    c.gain = c.ratio * c.a.seconds / c.b.seconds;
    const double half = student_quantile(0.05, dof) * std::sqrt(squared);
    c.low = c.gain * std::exp(-half), c.high = c.gain * std::exp(half);
    c.is_valid = true;
    return c;
}

}  // namespace etendue
