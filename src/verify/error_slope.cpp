#include "verify/error_slope.h"

#include <cmath>

namespace etendue {

ErrorReference::ErrorReference(const RunSeries& series) : pixels(series.runs[0].pixels.size()) {
    for (const IndependentRun& r : series.runs)
        for (size_t i = 0; i < pixels.size(); ++i)
            for (int c = 0; c < 3; ++c) pixels[i][size_t(c)].add(double(r.pixels[i][c]));
}

ErrorReference::ErrorReference(const ReferenceImage& image) : pixels(image.pixels.size()) {
    for (size_t i = 0; i < pixels.size(); ++i)
        for (int c = 0; c < 3; ++c)
            pixels[i][size_t(c)] = Moments::estimate(double(image.pixels[i][c]),
                                                     double(image.variance[i][c]), image.samples);
}

std::vector<ErrorOfRuns> errors_of_runs(const RunSeries& series, const ErrorReference& reference) {
    std::vector<ErrorOfRuns> out;
    const size_t pixels = reference.pixels.size();
    double noise = 0;
    for (const auto& p : reference.pixels)
        for (const Moments& m : p) noise += m.squared_error() / double(3 * pixels);
    for (size_t n = 1; n <= series.runs.size(); n *= 2) {
        const size_t groups = series.runs.size() / n;
        double mse = 0;
        for (size_t g = 0; g < groups; ++g)
            for (size_t i = 0; i < pixels; ++i)
                for (int c = 0; c < 3; ++c) {
                    double sum = 0;
                    for (size_t r = g * n; r < (g + 1) * n; ++r)
                        sum += double(series.runs[r].pixels[i][c]);
                    mse += sqr(sum / double(n) - reference.pixels[i][size_t(c)].mean());
                }
        mse = mse / double(groups * 3 * pixels) - noise;
        // Errors below the reference's own noise cannot be measured.
        if (mse < noise) break;
        out.push_back({int(n), std::sqrt(mse)});
    }
    return out;
}

std::optional<double> error_slope(const std::vector<ErrorOfRuns>& errors) {
    if (errors.size() < 4) return {};
    double x = 0, y = 0, xx = 0, xy = 0;
    for (const ErrorOfRuns& e : errors) {
        const double u = std::log(e.runs), v = std::log(e.rmse);
        x += u, y += v, xx += u * u, xy += u * v;
    }
    const double n = double(errors.size());
    return (n * xy - x * y) / (n * xx - x * x);
}

}  // namespace etendue
