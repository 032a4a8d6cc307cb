#include "mcmc/technique_choice.h"

#include <algorithm>
#include <cmath>

namespace etendue {
namespace {

constexpr double kUniform = 0.2;

/// Index of the item that u in [0, 1) falls on.
int pick(const std::vector<double>& shares, double u) {
    int chosen = 0;
    for (size_t i = 0; i < shares.size(); u -= shares[i], ++i) {
        if (shares[i] > 0) chosen = int(i);
        if (u < shares[i]) break;
    }
    return chosen;
}

double sum_before(const std::vector<double>& shares, size_t end) {
    double sum = 0;
    for (size_t i = 0; i < end; ++i) sum += shares[i];
    return sum;
}

}  // namespace

bool hits_emitters(const Scene& scene) {
    return std::any_of(scene.emitters().begin(), scene.emitters().end(),
                       [](const auto& e) { return !e->is_delta(); });
}

TechniqueChoice::TechniqueChoice(const Scene& scene, int shortest, int lengths,
                                 const TechniqueLight& light)
    : shortest_(shortest), hits_(hits_emitters(scene)),
      hits_lens_(scene.sensor().has_finite_lens()) {
    for (int k = shortest; k < shortest + lengths; ++k) {
        const auto energy_of = [&](int s) {
            const auto found = light.find({k, s});
            return found == light.end() || !is_allowed(k, s) ? 0.0 : found->second;
        };
        std::vector<double> p(size_t(k) + 2);
        double energy = 0;
        for (int s = 0; s <= k + 1; ++s) energy += energy_of(s);
        const double uniform = energy > 0 ? kUniform : 1.0;
        for (int s = 0; s <= k + 1; ++s)
            if (is_allowed(k, s))
                p[size_t(s)] = uniform / allowed(k) +
                               (energy > 0 ? (1 - uniform) * energy_of(s) / energy : 0.0);
        pmf_.push_back(std::move(p));
    }
}

double TechniqueChoice::pmf(int k, int s) const {
    const size_t row = size_t(k - shortest_);
    if (row < pmf_.size()) return pmf_[row][size_t(s)];
    return is_allowed(k, s) ? 1.0 / allowed(k) : 0.0;
}

int TechniqueChoice::choose(int k, double u) const {
    const size_t row = size_t(k - shortest_);
    if (row < pmf_.size()) return pick(pmf_[row], u);
    const int i = std::min(int(u * allowed(k)), allowed(k) - 1);
    return hits_ ? i : i + 1;
}

double TechniqueChoice::number(int k, int s, double v) const {
    const size_t row = size_t(k - shortest_);
    if (row < pmf_.size()) return sum_before(pmf_[row], size_t(s)) + v * pmf_[row][size_t(s)];
    return (double(hits_ ? s : s - 1) + v) / double(allowed(k));
}

LengthChoice::LengthChoice(int shortest, int longest, const TechniqueLight& light)
    : shortest_(shortest), longest_(longest) {
    double sum = 0;
    for (const auto& [technique, value] : light) {
        const int k = technique.first;
        if (k < shortest || k > longest) continue;
        if (size_t(k - shortest) >= energy_.size()) energy_.resize(size_t(k - shortest) + 1);
        energy_[size_t(k - shortest)] += value;
        sum += value;
    }
    if (sum > 0) {
        by_energy_ = 1 - kUniform;
        for (double& e : energy_) e /= sum;
        fit_ratio();
    }
    constexpr int kTabulated = 64;
    for (int k = shortest; k <= std::min(longest, shortest + kTabulated); ++k)
        pmf_.push_back(computed_pmf(k));
}

void LengthChoice::fit_ratio() {
    constexpr double kSmallest = 0.75, kLargest = 0.98;
    // A geometric distribution of j ≥ 0 with the mean m has the ratio m/(1+m). Here j counts from the median on. The square
    // root is larger, since the pilot may have missed the longest paths.
    double shorter = 0, longer = 0, sum = 0;
    for (size_t i = 0, median = 0; i < energy_.size(); ++i) {
        shorter += energy_[i];
        if (shorter < 0.5) {
            median = i + 1;
            continue;
        }
        longer += energy_[i];
        sum += energy_[i] * double(i - median);
    }
    const double ratio = longer > 0 ? std::sqrt(sum / (longer + sum)) : 0.0;
    ratio_ = std::clamp(ratio, kSmallest, kLargest);
}

double LengthChoice::geometric(int k) const {
    const double lengths = double(longest_ - shortest_) + 1;
    return std::pow(ratio_, k - shortest_) * (1 - ratio_) / (1 - std::pow(ratio_, lengths));
}

double LengthChoice::pmf(int k) const {
    const size_t i = size_t(k - shortest_);
    return i < pmf_.size() ? pmf_[i] : computed_pmf(k);
}

double LengthChoice::computed_pmf(int k) const {
    const size_t i = size_t(k - shortest_);
    return by_energy_ * (i < energy_.size() ? energy_[i] : 0.0) + (1 - by_energy_) * geometric(k);
}

int LengthChoice::choose(double u) const {
    if (u < by_energy_) return shortest_ + pick(energy_, u / by_energy_);
    const double most = longest_ - shortest_;
    const double v = (u - by_energy_) / (1 - by_energy_) * (1 - std::pow(ratio_, most + 1));
    return shortest_ + int(std::min(most, std::log1p(-v) / std::log(ratio_)));
}

double LengthChoice::number(int k, double v) const {
    const size_t i = size_t(k - shortest_);
    const double tabulated = by_energy_ * (i < energy_.size() ? energy_[i] : 0.0);
    const double of_part = v * computed_pmf(k);
    if (of_part < tabulated) return by_energy_ * sum_before(energy_, i) + of_part;
    const double lengths = double(longest_ - shortest_) + 1;
    const double shorter = (1 - std::pow(ratio_, double(i))) / (1 - std::pow(ratio_, lengths));
    return by_energy_ + (1 - by_energy_) * shorter + (of_part - tabulated);
}

}  // namespace etendue
