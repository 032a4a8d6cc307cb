#include "verify/sample_plan.h"

#include <algorithm>
#include <cmath>

namespace etendue {
namespace {

std::vector<double> growth_for(const WantedPrecision& mean, std::span<const double> seconds) {
    const size_t n = seconds.size();
    std::vector<double> growth(n, 1);
    std::vector<bool> is_enough(n);
    for (size_t i = 0; i < n; ++i) is_enough[i] = !(mean.squared_errors[i] > 0);
    while (true) {
        double left = mean.wanted, root = 0;
        for (size_t i = 0; i < n; ++i)
            if (is_enough[i])
                left -= mean.squared_errors[i];
            else
                root += std::sqrt(mean.squared_errors[i] * seconds[i]);
        bool is_final = true;
        for (size_t i = 0; i < n; ++i) {
            if (is_enough[i]) continue;
            growth[i] = std::sqrt(mean.squared_errors[i] / seconds[i]) * root / left;
            if (growth[i] > 1) continue;
            growth[i] = 1;
            is_enough[i] = true;
            is_final = false;
        }
        if (is_final) return growth;
    }
}

}  // namespace

std::vector<double> sample_growth(std::span<const WantedPrecision> means,
                                  std::span<const double> seconds) {
    std::vector<double> growth(seconds.size(), 1);
    for (const WantedPrecision& mean : means) {
        const std::vector<double> own = growth_for(mean, seconds);
        for (size_t i = 0; i < growth.size(); ++i) growth[i] = std::max(growth[i], own[i]);
    }
    return growth;
}

}  // namespace etendue
