#include "session/largest_passes.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

namespace etendue {

void LargestPasses::add(std::span<const Film::Moments> moments, uint64_t passes) noexcept try {
    const std::lock_guard lock(mutex_);
    if (has_failed_) return;
    bool is_known = passes != 1 && passes == seen_ + 1 && sums_.size() == moments.size();
    if (!is_known) {
        // The rendering began, or goes on after passes that are unknown.
        is_known = passes == 1;
        sums_.assign(moments.size(), 0);
        before_.clear();
        largest_.assign(moments.size(), 0);
        pass_.assign(moments.size(), 0);
        counted_ = 0;
    }
    if (!is_known) {
        for (size_t i = 0; i < moments.size(); ++i) sums_[i] = moments[i].luminance_sum();
        before_ = sums_;
    } else {
        ++counted_;
        for (size_t i = 0; i < moments.size(); ++i) {
            const float sum = moments[i].luminance_sum(), value = sum - sums_[i];
            sums_[i] = sum;
            if (value > largest_[i]) largest_[i] = value, pass_[i] = uint32_t(passes - 1);
        }
    }
    seen_ = passes;
} catch (const std::exception&) {
    const std::lock_guard lock(mutex_);
    has_failed_ = true;
    counted_ = 0;
    for (std::vector<float>* v : {&sums_, &before_, &largest_}) *v = {};
    pass_ = {};
}

uint64_t LargestPasses::passes() const {
    const std::lock_guard lock(mutex_);
    return counted_;
}

WorstPixel LargestPasses::pixel(size_t i) const {
    const float sum = sums_[i] - (before_.empty() ? 0.0f : before_[i]);
    return {i, pass_[i], largest_[i], sum > 0 ? std::min(1.0f, largest_[i] / sum) : 0.0f};
}

std::optional<WorstPixel> LargestPasses::at(uint64_t i) const {
    const std::lock_guard lock(mutex_);
    if (counted_ < 2 || i >= largest_.size() || !(largest_[i] > 0)) return {};
    return pixel(size_t(i));
}

std::vector<WorstPixel> LargestPasses::worst(size_t count) const {
    const std::lock_guard lock(mutex_);
    if (counted_ < 2) return {};
    const auto sum = [&](size_t i) {
        return double(sums_[i]) - (before_.empty() ? 0.0 : double(before_[i]));
    };
    double mean = 0;
    for (size_t i = 0; i < sums_.size(); ++i)
        if (std::isfinite(sums_[i])) mean += sum(i) / double(counted_) / double(sums_.size());
    std::vector<std::pair<double, size_t>> ranked;
    for (size_t i = 0; i < sums_.size(); ++i) {
        const double value = double(largest_[i]), n = double(counted_);
        if (!(value > 0)) continue;
        const double rest = std::max(0.1 * mean, (sum(i) - value) / (n - 1));
        if (rest > 0) ranked.emplace_back(value / n / rest, i);
    }
    count = std::min(count, ranked.size());
    std::partial_sort(ranked.begin(), ranked.begin() + std::ptrdiff_t(count), ranked.end(),
                      [](const auto& a, const auto& b) {
                          return a.first != b.first ? a.first > b.first : a.second < b.second;
                      });
    std::vector<WorstPixel> pixels;
    for (size_t k = 0; k < count; ++k) pixels.push_back(pixel(ranked[k].second));
    return pixels;
}

}  // namespace etendue
