#include "session/largest_passes.h"

#include <algorithm>
#include <queue>
#include <tuple>

namespace etendue {

SumsBefore SumsBefore::of(const Film& film) {
    SumsBefore before{.passes = film.passes(), .luminance = {}};
    before.luminance.reserve(film.moments().size());
    for (const PixelMoments& m : film.moments()) before.luminance.push_back(m.luminance_sum());
    return before;
}

LargestPasses::LargestPasses(const Film* film, const SumsBefore& before)
    : film_(film), before_(before),
      passes_(film && !film->largest().empty() ? film->passes() - before.passes : 0) {}

float LargestPasses::sum(uint64_t i) const {
    const float all = film_->moments()[i].luminance_sum();
    return before_.luminance.empty() ? all : all - before_.luminance[i];
}

WorstPixel LargestPasses::pixel(uint64_t i) const {
    const auto [luminance, pass] = film_->largest()[i];
    const float all = sum(i);
    return {i, pass, luminance, all > 0 ? std::min(1.0f, luminance / all) : 0.0f};
}

std::optional<WorstPixel> LargestPasses::at(uint64_t i) const {
    if (passes_ < 2 || i >= film_->largest().size() || !(film_->largest()[i].luminance > 0))
        return {};
    return pixel(i);
}

std::vector<WorstPixel> LargestPasses::worst(size_t count) const {
    if (passes_ < 2 || count == 0) return {};
    const double least = 0.1 * film_->mean_luminance().mean, n = double(passes_);
    struct Ranked {
        double rank;
        uint64_t pixel;
        /// The better one is less, so that the worst one of those found is on top of the queue.
        bool operator<(const Ranked& r) const {
            return std::tuple(-rank, pixel) < std::tuple(-r.rank, r.pixel);
        }
    };
    std::priority_queue<Ranked> found;
    for (uint64_t i = 0; i < film_->largest().size(); ++i) {
        const double value = double(film_->largest()[i].luminance);
        if (!(value > 0)) continue;
        const double rest = std::max(least, (double(sum(i)) - value) / (n - 1));
        if (!(rest > 0)) continue;
        const Ranked r{value / n / rest, i};
        if (found.size() < count) {
            found.push(r);
        } else if (r < found.top()) {
            found.pop();
            found.push(r);
        }
    }
    std::vector<WorstPixel> pixels(found.size());
    for (size_t k = found.size(); k-- > 0; found.pop()) pixels[k] = pixel(found.top().pixel);
    return pixels;
}

}  // namespace etendue
