#include "guide/light_selection.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "math/hash.h"

namespace etendue {

float LightSelection::pmf(uint32_t emitter, float everywhere) const {
    const auto at = std::lower_bound(emitters_.begin(), emitters_.end(), emitter);
    const bool is_learned = at != emitters_.end() && *at == emitter;
    const float learned = is_learned ? choice_.pmf(uint32_t(at - emitters_.begin())) : 0.0f;
    return (1 - share_) * everywhere + share_ * learned;
}

LightSelection::Draw LightSelection::sample(double u) const {
    constexpr double kMost = 0x1.fffffffffffffp-1;
    const double a = double(share_);
    if (!(u < a)) return {{}, std::min((u - a) / (1 - a), kMost)};
    const AliasTable::Draw draw = choice_.sample(std::min(u / a, kMost));
    return {emitters_[draw.index], draw.u};
}

size_t LightSelection::memory_bytes() const {
    return sizeof(*this) + emitters_.capacity() * sizeof(uint32_t) + choice_.memory_bytes();
}

LightSelections::LightSelections(std::vector<Arrival> arrivals, const std::vector<float>& pmf) {
    std::erase_if(arrivals,
                  [](const Arrival& a) { return !(a.at.weight > 0 && a.at.weight < kInf); });
    constexpr size_t kMostInLeaf = 128;
    const std::vector<uint32_t> leaves = splits_.divide_all(
        std::span(arrivals), kMostInLeaf, [](const Arrival& a) { return a.at.p; });
    const size_t places = (leaves.size() - 1) * kSurfaceSides;
    std::vector<Placed> placed;
    std::array<std::vector<Placed>, 2> halves;
    for (const Arrival& a : arrivals) {
        placed.push_back({uint32_t(place(a.at.p, a.at.n)), a.emitter, double(a.at.weight)});
        halves[mix64(placed.size()) & 1].push_back(placed.back());
    }
    set(halves[0], places);
    double gain = 0, sum = 0;
    for (const Placed& a : halves[1]) {
        sum += a.weight;
        const uint32_t i = by_place_[a.place];
        if (i == kNone) continue;
        gain += a.weight * std::log(double(selections_[i].pmf(a.emitter, pmf[a.emitter])) /
                                    double(pmf[a.emitter]));
    }
    gain_ = sum > 0 ? float(gain / sum) : 0.0f;
    set(std::move(placed), places);
}

/// Sums up the weights by place and emitter.
void LightSelections::set(std::vector<Placed> arrivals, size_t places) {
    std::stable_sort(arrivals.begin(), arrivals.end(), [](const Placed& a, const Placed& b) {
        return a.place != b.place ? a.place < b.place : a.emitter < b.emitter;
    });
    learned_.clear();
    counts_.clear();
    for (const Placed& a : arrivals) {
        if (counts_.empty() || counts_.back().place != a.place) counts_.push_back({a.place, 0});
        ++counts_.back().arrivals;
        const bool is_same = !learned_.empty() && learned_.back().place == a.place &&
                             learned_.back().emitter == a.emitter;
        if (is_same)
            learned_.back().weight += a.weight;
        else
            learned_.push_back(a);
    }
    tabulate(places);
}

void LightSelections::tabulate(size_t places) {
    // With few arrivals, more is selected as everywhere: an emitter that matters as much as others is missing among n of them
    // with a probability that falls with n.
    constexpr float kMostShare = 0.8f, kPrior = 8;
    by_place_.assign(places, kNone);
    selections_.clear();
    auto next = learned_.begin();
    for (const Count& c : counts_) {
        std::vector<uint32_t> emitters;
        std::vector<double> weights;
        for (; next != learned_.end() && next->place == c.place; ++next) {
            emitters.push_back(next->emitter);
            weights.push_back(next->weight);
        }
        const float n = float(c.arrivals);
        by_place_[c.place] = uint32_t(selections_.size());
        selections_.emplace_back(kMostShare * n / (n + kPrior), std::move(emitters), weights);
    }
}

size_t LightSelections::memory_bytes() const {
    size_t sum = splits_.memory_bytes() + learned_.capacity() * sizeof(Placed) +
                 counts_.capacity() * sizeof(Count) + by_place_.capacity() * sizeof(uint32_t);
    for (const LightSelection& s : selections_) sum += s.memory_bytes();
    return sum;
}

}  // namespace etendue
