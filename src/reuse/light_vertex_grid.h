#pragma once
// The light vertices within a distance of an eye vertex.

#include "reuse/light_vertex_cache.h"
#include "reuse/point_grid.h"

namespace etendue {

/// A light vertex y_{s-1} near an eye vertex, with as much as is known without looking it up.
struct GatherCandidate {
    Vec3 p;
    uint32_t vertex;
    int s;
    ArrivalSide side;
    uint8_t gloss_before;  ///< Of y_{s-2}, or of its event.
    /// Luminance, times the area density of y_{s-1} over the disc's where it is larger.
    float flux;
};

/// The choice of a candidate about which nothing more is to be known.
struct Chosen {};

/// Over the connectible vertices y_i, i ≥ 1, of a cache.
class LightVertexGrid {
public:
    /// Bytes of a vertex, the building of the grid included: an entry and the list it is made from, up to four buckets,
    /// twice, and as many bytes for densities.
    static constexpr uint64_t kVertexBytes = 2 * sizeof(PointGrid::Entry) + 10 * sizeof(uint32_t);

    /// The cache must outlive the grid, and not change before the next build().
    void build(const LightVertexCache& cache, float radius);

    float radius() const { return radius_; }
    /// Mean of GatherCandidate::flux.
    float mean_flux() const { return mean_flux_; }
    const PointGrid& points() const { return grid_; }

    /// Calls use(candidate, choice) for the light vertices nearer to `p` than the radius for which
    /// `choose(candidate) -> std::optional<Choice>` has a choice.
    template <class Choose, class Use>
    void for_each_near(Vec3 p, const Choose& choose, const Use& use) const {
        constexpr int kBatch = 32;
        using Choice = typename decltype(choose(GatherCandidate{}))::value_type;
        struct Found {
            GatherCandidate candidate;
            Choice choice;
        };
        std::array<Found, kBatch> batch;
        size_t count = 0;
        const auto use_batch = [&] {
            for (size_t i = 0; i < count; ++i) cache_->prefetch_head(batch[i].candidate.vertex);
            for (size_t i = 0; i < count; ++i) use(batch[i].candidate, batch[i].choice);
            count = 0;
        };
        grid_.for_each_near(p, radius_, [&](const PointGrid::Entry& e) {
            Found& found = batch[count];
            found.candidate = {.p = e.p,
                               .vertex = e.index,
                               .s = size_of(e),
                               .side = ArrivalSide::from_bits(e.tag >> 16),
                               .gloss_before = uint8_t(e.tag & 0xff),
                               .flux = e.weight};
            const auto choice = choose(found.candidate);
            if (!choice) return;
            found.choice = *choice;
            cache_->prefetch(e.index);
            if (++count == kBatch) use_batch();
        });
        use_batch();
    }

private:
    /// Tags of the grid's entries: arrival side, s or kManyVertices, and gloss before.
    static constexpr uint32_t kManyVertices = 255;
    int size_of(const PointGrid::Entry& e) const {
        const uint32_t s = e.tag >> 8 & 0xff;
        return s < kManyVertices ? int(s) : cache_->depth(e.index) + 1;
    }

    const LightVertexCache* cache_ = nullptr;
    PointGrid grid_;
    float radius_ = 0, mean_flux_ = 0;
};

}  // namespace etendue
