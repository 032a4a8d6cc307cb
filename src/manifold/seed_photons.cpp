#include "manifold/seed_photons.h"

#include <algorithm>
#include <tuple>

namespace etendue {

SeedPhotons::SeedPhotons(std::vector<SeedPhoton> photons) : photons_(std::move(photons)) {
    constexpr size_t kMostInLeaf = 32;
    if (photons_.empty()) return;
    const std::vector<uint32_t> leaves = splits_.divide_all(
        std::span(photons_), kMostInLeaf, [](const SeedPhoton& s) { return s.p; });
    for (size_t i = 0; i + 1 < leaves.size(); ++i) {
        const auto begin = photons_.begin() + leaves[i], end = photons_.begin() + leaves[i + 1];
        std::stable_sort(begin, end, [](const SeedPhoton& a, const SeedPhoton& b) {
            return std::tuple(surface_side(a.n), a.emitter) <
                   std::tuple(surface_side(b.n), b.emitter);
        });
        auto next = begin;
        for (size_t side = 0; side < kSurfaceSides; ++side) {
            begin_.push_back(uint32_t(next - photons_.begin()));
            next = std::find_if(next, end,
                                [&](const SeedPhoton& s) { return surface_side(s.n) != side; });
        }
    }
    begin_.push_back(uint32_t(photons_.size()));
}

std::span<const SeedPhoton> SeedPhotons::near(Vec3 p, Vec3 n, uint32_t emitter) const {
    if (photons_.empty()) return {};
    const size_t place = splits_.leaf(p) * kSurfaceSides + surface_side(n);
    const auto first = photons_.begin() + begin_[place],
               last = photons_.begin() + begin_[place + 1];
    const auto begin = std::lower_bound(
        first, last, emitter, [](const SeedPhoton& s, uint32_t e) { return s.emitter < e; });
    const auto end = std::upper_bound(
        begin, last, emitter, [](uint32_t e, const SeedPhoton& s) { return e < s.emitter; });
    return {begin, end};
}

}  // namespace etendue
