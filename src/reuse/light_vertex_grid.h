#pragma once
// The light vertices within a distance of an eye vertex.

#include "reuse/light_vertex_cache.h"
#include "reuse/point_grid.h"

namespace etendue {

/// A light vertex y_{s-1} near an eye vertex, with the data that is known without a look-up in the cache.
struct GatherCandidate {
    Vec3 p;
    uint32_t vertex;
    int s;
    ArrivalSide side;
    uint8_t gloss_before;  ///< LightVertexCache::gloss_before().
    /// Luminance of the throughput, times max(1, π r² pdf_fwd).
    float flux;
};

/// A choice without data, for for_each_near().
struct Chosen {};

/// Grid over connectible vertices of a cache.
class LightVertexGrid {
public:
    /// Memory per vertex while the grid is built: its entry and a copy, its position, its bucket's index, and up to four
    /// buckets with two numbers each and a level of PairDensity.
    static constexpr uint64_t kVertexBytes =
        2 * sizeof(PointGrid::Entry) + sizeof(Vec3) + 10 * sizeof(uint32_t);
    /// The same afterwards.
    static constexpr uint64_t kBuiltVertexBytes =
        sizeof(PointGrid::Entry) + sizeof(Vec3) + 4 * sizeof(uint32_t);

    /// Of the vertices y_i, i ≥ first ≥ 1, for searches up to `radius`. The cache must outlive the grid, and not change
    /// before the next build().
    void build(const LightVertexCache& cache, float radius, int first = 1);

    float radius() const { return radius_; }
    /// Mean of GatherCandidate::flux.
    float mean_flux() const { return mean_flux_; }
    const PointGrid& points() const { return grid_; }

    /// Calls use(candidate, choice) for the light vertices in `region`, see PointGrid::for_each_in(), for which
    /// `choose(candidate) -> std::optional<Choice>` returns a choice.
    template <class Choose, class Use>
    void for_each_in(const FlatBall& region, const Choose& choose, const Use& use) const {
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
        grid_.for_each_in(region, [&](const PointGrid::Entry& e) {
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
    /// Tags of the grid's entries: arrival side (16 bits), s or kManyVertices (8), and gloss_before (8).
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
