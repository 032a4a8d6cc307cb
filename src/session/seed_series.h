#pragma once
// Renderings of one method with several seeds, and the comparison of two methods by the spread over their seeds. Unlike
// the spread of passes, it is an error estimate for methods whose passes belong to Markov chains, too.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "system/section_file.h"

namespace etendue {

/// The finished renderings of a run with several seeds.
struct SeedSeries {
    using Image = std::vector<float>;
    std::vector<std::shared_ptr<const Image>> luminance;  ///< One image for each seed.
    std::vector<double> seconds;                          ///< Of each of them.
    std::vector<std::pair<std::string, double>>
        figures;  ///< Integrator::figures(), averaged over the seeds.

    double total_seconds() const;
    /// Adds a rendering.
    void add(Image image, double seconds_of_image,
             const std::vector<std::pair<std::string, double>>& its_figures);
    void save(SectionWriter& to) const;
    /// `pixels`: of each image. Throws std::runtime_error if the file has another number of them.
    void load(SectionReader& from, uint64_t pixels);
};

/// Two methods, `a` and `b`. The relative variance of an image is the mean over its pixels of its variance over the
/// seeds, divided by I² + 0.01·mean(I)², where I is the mean of all images, weighted by the inverse of their variances.
struct SeedComparison {
    struct Method {
        double variance = 0;              ///< Relative variance of one image.
        double seconds = 0;               ///< Time of one image.
        double mean = 0, mean_error = 0;  ///< Mean luminance of all images, and its standard error.
    };
    Method a, b;
    double ratio = 0;          ///< Variance of `a` over that of `b`.
    double gain = 0;           ///< Time that `a` needs for the variance of `b`, over that of `b`.
    double low = 0, high = 0;  ///< 95 % confidence interval of `gain`, by the jackknife over seeds.
    bool is_valid = false;     ///< False with fewer than three seeds, or if a variance is 0.
    bool means_differ = false;  ///< The means differ by more than their errors explain.
};
SeedComparison compare(const SeedSeries& a, const SeedSeries& b);

}  // namespace etendue
