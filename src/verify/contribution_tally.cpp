#include "verify/contribution_tally.h"

#include <algorithm>

namespace etendue {

void ContributionTally::observe(const Join& join, Rgb contribution, float share,
                                const FilmTarget& target, const Workspace& paths) {
    const size_t edges = size_t(join.technique.vertices() - 1);
    if (edges >= cut_offs_.size()) return;
    const Technique& q = join.technique;
    const PathClass c = classify(scene_, join, paths.light_side(q), paths.z, cut_offs_[edges]);
    Sums& sums = sums_[uint64_t(q.strategy) << 40 | uint64_t(q.s) << 32 | c.key()];
    if (!sums.tiles) {
        sums.tiles = &tiles_[c.without_length_of_edges()];
        sums.tiles->resize(grid_.tiles());
    }
    std::vector<TileSum>& tiles = *sums.tiles;

    const auto add_to_tile = [&](uint64_t at, Rgb value) {
        TileSum& t = tiles[grid_.tile(at)];
        for (int i = 0; i < 3; ++i) t.rgb[size_t(i)] += double(value[i]);
        t.luminance.add(double(luminance(value)));
    };
    double reach = 0;  // sum over the pixels of the crop for a contribution of 1
    for_each_pixel(grid_.film, scene_.filter(), target, [&](uint64_t at, float h) {
        reach += double(share * h);
        add_to_tile(at, contribution * (join.mis_weight * share * h));
    });
    const double alone = double(luminance(contribution)) * reach;
    sums.alone.add(alone);
    sums.weighted.add(alone * double(join.mis_weight));
    sums.of_alone.add(alone, double(join.mis_weight));
}

std::vector<ContributionTally::Entry> ContributionTally::entries() const {
    std::vector<Entry> out;
    for (const auto& [key, sums] : sums_) {
        const PathClass c = PathClass::from_key(uint32_t(key));
        const Strategy strategy = Strategy(key >> 40);
        const int s = int(key >> 32 & 0xff);
        out.push_back({c,
                       {strategy, s, c.edges + 1 + is_pair(strategy) - s},
                       sums.weighted,
                       sums.alone,
                       sums.of_alone});
    }
    std::sort(out.begin(), out.end());
    return out;
}

}  // namespace etendue
