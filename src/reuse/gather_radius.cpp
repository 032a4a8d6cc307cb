#include "reuse/gather_radius.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "film/film.h"
#include "reuse/gather_constants.h"

namespace etendue {
namespace {

/// Mean variance of one sample of a pixel, relative to its squared luminance, without the noisiest pixels, whose variance
/// a few passes cannot tell.
double relative_variance(const Film& film) {
    constexpr double kKept = 0.99;
    const std::vector<Rgb> variance = film.variance();
    std::vector<double> relative(variance.size());
    for (size_t i = 0; i < relative.size(); ++i) {
        const double mean = double(film.expected().at(film.geometry().pixel_center(i)));
        if (mean > 0)
            relative[i] = double(film.passes()) * double(luminance(variance[i])) / sqr(mean);
    }
    const auto end = relative.begin() + std::ptrdiff_t(kKept * double(relative.size()));
    std::nth_element(relative.begin(), end, relative.end());
    return std::accumulate(relative.begin(), end, 0.0) / double(relative.size());
}

}  // namespace

void GatherRadius::start(float given, bool has_inner, float seen_radius,
                         const std::array<double, 2>& pairs_per_radius2) {
    const GatherConstants& k = kGatherConstants;
    is_given_ = given > 0;
    has_inner_ = has_inner;
    seen_radius_ = seen_radius;
    const auto radius_of = [&](double wanted, double per_radius2) {
        const float largest = k.largest_first_radius * seen_radius;
        return per_radius2 > 0 ? std::min(largest, float(std::sqrt(wanted / per_radius2)))
                               : largest;
    };
    if (is_given_)
        radii_.fill(given);
    else if (has_inner)
        radii_ = {radius_of(k.inner_pairs, pairs_per_radius2[0]),
                  radius_of(k.pairs, pairs_per_radius2[1])};
    else
        radii_.fill(radius_of(k.pairs, pairs_per_radius2[0] + pairs_per_radius2[1]));
}

void GatherRadius::grow(float& radius, double pairs, double wanted, float largest) const {
    const double factor = std::clamp(std::sqrt(wanted / pairs), 0.25, 4.0);
    radius = std::min(largest * seen_radius_, radius * float(factor));
}

double best_factor_of_pairs(double variance, double time,
                            const std::array<double, kRadiusChanges>& moments,
                            const std::array<double, kRadiusChanges>& times) {
    constexpr size_t kPresent = kRadiusChanges / 2;
    const VarianceAndTime others =
        VarianceAndTime{variance, time}.without(moments[kPresent], times[kPresent]);
    // Between the candidates, moments and times are powers of m.
    constexpr size_t kSteps = 4;
    double best = 1,
           least = (others.variance + moments[kPresent]) * (others.time + times[kPresent]);
    for (size_t i = 0; i <= (kRadiusChanges - 1) * kSteps; ++i) {
        const size_t k = std::min(i / kSteps, kRadiusChanges - 2);
        const double u = double(i - k * kSteps) / kSteps;
        const auto between = [&](double a, double b) {
            return a > 0 && b > 0 ? std::pow(a, 1 - u) * std::pow(b, u) : (1 - u) * a + u * b;
        };
        const double product = (others.variance + between(moments[k], moments[k + 1])) *
                               (others.time + between(times[k], times[k + 1]));
        if (product < least) {
            least = product;
            best = between(GatherRadius::factor_of_pairs(k), GatherRadius::factor_of_pairs(k + 1));
        }
    }
    return best;
}

void GatherRadius::learn(const Film& film, const RenderStats& so_far, const GatherTotals& totals) {
    const GatherConstants& k = kGatherConstants;
    const GatherTotals before = std::exchange(before_, totals);
    const double eye_paths_before = std::exchange(eye_paths_before_, double(so_far.eye_paths)),
                 eye_paths = eye_paths_before_ - eye_paths_before;
    const double now = double(so_far.rays() - so_far.trial_rays - so_far.visible_pairs) +
                       k.candidate_time * (totals.candidates + totals.inner_candidates) +
                       k.trial_time * double(so_far.trials);
    observed_ = {.variance = eye_paths * relative_variance(film),
                 .time = now - std::exchange(time_before_, now)};
    if (is_given_) return;

    const auto pairs = [&](bool is_fixed_by_film) {
        return (totals.expected_pairs[is_fixed_by_film] - before.expected_pairs[is_fixed_by_film] +
                1) /
               eye_paths;
    };
    if (!has_inner_) {
        grow(radii_[0], pairs(false) + pairs(true), k.pairs, k.largest_first_radius);
        radii_[1] = radii_[0];
        return;
    }

    std::array<double, kRadiusChanges> moments, times;
    for (size_t i = 0; i < kRadiusChanges; ++i) {
        moments[i] = totals.moments[i] - before.moments[i];
        times[i] = k.candidate_time * (totals.candidates - before.candidates) * factor_of_pairs(i) +
                   k.trial_time * (totals.trials[i] - before.trials[i]);
    }
    double wanted = k.pairs;
    float largest = k.largest_first_radius;
    if (moments[0] > 0 && observed_.variance > 0) {
        const double change =
            best_factor_of_pairs(observed_.variance, observed_.time, moments, times);
        wanted = std::clamp(pairs(true) * change, k.pairs / k.pairs_range, k.pairs * k.pairs_range);
        largest = k.largest_radius;
    }
    grow(radii_[1], pairs(true), wanted, largest);
    grow(radii_[0], pairs(false), k.inner_pairs * std::min(1.0, wanted / k.pairs), largest);
}

}  // namespace etendue
