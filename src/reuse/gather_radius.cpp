#include "reuse/gather_radius.h"

#include <algorithm>
#include <cmath>

#include "film/film.h"
#include "reuse/gather_constants.h"

namespace etendue {
namespace {

/// Variance of one sample of a pixel, relative to its squared luminance.
struct RelativeVariance {
    double
        mean;  ///< Over the pixels, without the noisiest ones, whose variance a few passes cannot tell.
    double
        part_of_square;  ///< Variance divided by the mean of squares: its mean, weighted by variance.
};
RelativeVariance relative_variance(const Film& film) {
    constexpr double kKept = 0.99;
    const std::vector<Rgb> variance = film.variance();
    std::vector<double> relative(variance.size());
    for (size_t i = 0; i < relative.size(); ++i) {
        const double mean = double(film.expected_luminance(film.geometry().pixel_center(i)));
        if (mean > 0)
            relative[i] = double(film.passes()) * double(luminance(variance[i])) / sqr(mean);
    }
    const auto end = relative.begin() + std::ptrdiff_t(kKept * double(relative.size()));
    std::nth_element(relative.begin(), end, relative.end());
    double sum = 0, part = 0;
    for (auto v = relative.begin(); v != end; ++v) sum += *v, part += *v * *v / (1 + *v);
    return {sum / double(relative.size()), sum > 0 ? part / sum : 0};
}

}  // namespace

void GatherRadius::start(float given, float scene_radius, double pairs_per_radius2) {
    is_given_ = given > 0;
    scene_radius_ = scene_radius;
    radius_ = kGatherConstants.largest_first_radius * scene_radius;
    if (pairs_per_radius2 > 0)
        radius_ = std::min(radius_, float(std::sqrt(kGatherConstants.pairs / pairs_per_radius2)));
    if (is_given_) radius_ = given;
}

double GatherRadius::factor_of_pairs(double gain, double time) {
    const double a = -std::log(std::clamp(1 - gain, 1 / kMore, 1.0)) / std::log(kMore);
    return std::clamp(std::sqrt(a * (1 - time) / ((1 - a) * time)), 1 / kMore, kMore);
}

void GatherRadius::learn(const Film& film, const RenderStats& so_far, const GatherTotals& totals) {
    if (is_given_) return;
    const GatherConstants& k = kGatherConstants;
    const Sums now{.eye_paths = double(so_far.eye_paths),
                   .pairs = totals.expected_pairs,
                   .gather_time =
                       k.pair_time * double(so_far.pairs) + k.trial_time * double(so_far.trials),
                   .other_time = double(so_far.rays() - so_far.trial_rays - so_far.visible_pairs),
                   .gain = (totals.moment - totals.moment_of_more) / GatherMoment::kUnit};
    const Sums since = now - before_;
    before_ = now;

    const double pairs = (since.pairs + 1) / since.eye_paths;
    double wanted = k.pairs;
    float largest = k.largest_first_radius;
    const RelativeVariance variance = relative_variance(film);
    if (totals.moment > 0 && variance.mean > 0) {
        const double change = factor_of_pairs(
            variance.part_of_square * since.gain / (since.eye_paths * variance.mean),
            since.gather_time / (since.gather_time + since.other_time));
        wanted = std::clamp(pairs * change, k.pairs / k.pairs_range, k.pairs * k.pairs_range);
        largest = k.largest_radius;
    }
    const double factor = std::clamp(std::sqrt(wanted / pairs), 0.25, 4.0);
    radius_ = std::min(largest * scene_radius_, radius_ * float(factor));
}

}  // namespace etendue
