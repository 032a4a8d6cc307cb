#include "mcmc/finds.h"

#include <numeric>

namespace etendue {
namespace {

double sum_of_weights(std::span<const Find> finds) {
    double sum = 0;
    for (const Find& f : finds) sum += f.weight;
    return sum;
}

}  // namespace

std::vector<size_t> resample(std::span<const double> weights, size_t count, double u) {
    const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
    std::vector<size_t> out;
    if (!(total > 0)) return out;
    size_t item = 0;
    double sum = weights[0];
    for (size_t i = 0; i < count; ++i) {
        const double at = (double(i) + u) / double(count) * total;
        while (sum <= at && item + 1 < weights.size()) sum += weights[++item];
        // By rounding, the last item may be one without weight.
        size_t chosen = item;
        while (!(weights[chosen] > 0)) --chosen;
        out.push_back(chosen);
    }
    return out;
}

std::vector<size_t> resample(std::span<const Find> finds, size_t count, double u) {
    std::vector<double> weights;
    weights.reserve(finds.size());
    for (const Find& f : finds) weights.push_back(f.weight);
    return resample(weights, count, u);
}

void thin(std::vector<Find>& finds, size_t count, double u) {
    if (finds.size() <= count) return;
    const double each = sum_of_weights(finds) / double(count);
    std::vector<Find> kept;
    kept.reserve(count);
    size_t last = finds.size();
    for (const size_t i : resample(finds, count, u)) {
        if (i != last) kept.push_back(finds[i]), kept.back().weight = 0;
        kept.back().weight += each;
        last = i;
    }
    finds = std::move(kept);
}

}  // namespace etendue
