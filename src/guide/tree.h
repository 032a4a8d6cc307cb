#pragma once
// Cells of space, each with the learned directions of both kinds of walks: a k-d tree, so that one look-up serves both.

#include <cstdint>
#include <vector>

#include "guide/kd_splits.h"
#include "guide/placed_density.h"
#include "guide/training.h"

namespace etendue {

/// What walks contribute to the image from a place on, on average and per unit of their throughput; negative where
/// unknown.
struct WalkContribution {
    float here = -1;    ///< By joins there and at later vertices.
    float beyond = -1;  ///< By joins at later vertices: what is lost if the walk ends there.
};

/// A vertex of a walk, and what the walk contributed from there on.
struct ContributionRecord {
    Vec3 p;
    float beta = 0;              ///< Throughput.
    float here = 0, beyond = 0;  ///< As WalkContribution, times the throughput.
    uint8_t mode = 0, face = 0;  ///< TransportMode of the walk; cube_face() of its arrival.
};

/// The learned directions of a cell. The fields are indexed by the TransportMode of the walks that they guide.
struct GuideCell {
    struct Field {
        GuideMixture mixture;
        std::array<float, kGuideClasses> share{}, training_share{};  ///< See GuideFit.
        /// Of these walks, by cube_face() of the normal on the side of their arrival; see
        /// GuideTree::set_contributions().
        std::array<WalkContribution, kCubeFaces> contribution{};

        template <class AField, class Use>
        static void for_each_field(AField& field, const Use& use) {
            auto& [mixture, share, training_share, contribution] = field;
            use(mixture), use(share), use(training_share), use(contribution);
        }
    };
    Vec3 center;
    std::array<Field, 2> fields;

    const Field& field(TransportMode mode) const { return fields[size_t(mode)]; }

    template <class Cell, class Use>
    static void for_each_field(Cell& cell, const Use& use) {
        auto& [center, fields] = cell;
        use(center), use(fields);
    }
};

class GuideTree {
public:
    GuideTree() = default;
    /// By TransportMode of the walks that samples would guide.
    using LeftOut = std::array<std::vector<PlacedWeight>, 2>;
    /// Fits the cells in parallel; a function of the samples and their order. `seed` seeds its choices. Samples whose weight
    /// is not positive and finite do not count. `left_out`: power that arrives at a place, of which no walk is to learn
    /// the direction; it tells where walks are that may gain by other directions.
    GuideTree(const std::vector<GuideSample>& samples, uint64_t seed,
              const GuideLearning& learning = {}, const LeftOut& left_out = {});
    /// One cell for all places.
    explicit GuideTree(const GuideCell& cell) : cells_{cell} {}

    /// Means of the records in each cell, on each side and in each mode; unknown where there are few records. Records that
    /// are not finite do not count.
    void set_contributions(const std::vector<ContributionRecord>& records);
    /// Takes GuideFit::training_share for the share.
    void use_training_shares();

    bool is_empty() const { return cells_.empty(); }
    /// The cell that holds `p`. Not where the tree is empty.
    const GuideCell& cell(Vec3 p) const { return cells_[splits_.leaf(p)]; }
    const std::vector<GuideCell>& cells() const { return cells_; }
    /// Mean of GuideFit::gain for walks of a mode, weighted by what they contribute: by the integral of radiance times
    /// importance over the surfaces of a cell, with the part of the radiance or importance that the walks learn and all of
    /// the other. Where no walks of the other mode are known, weighted by the power.
    float gain(TransportMode mode) const { return gain_[size_t(mode)]; }
    size_t memory_bytes() const {
        return splits_.memory_bytes() + cells_.capacity() * sizeof(GuideCell);
    }

    template <class State>
    void save(State& to) const {
        splits_.save(to);
        to.put(cells_);
        to.put(gain_);
    }
    template <class State>
    void load(State& from) {
        splits_.load(from);
        from.get(cells_);
        from.get(gain_);
    }

private:
    struct Builder;

    KdSplits splits_;  ///< Its leaves are cells.
    std::vector<GuideCell> cells_;
    std::array<float, 2> gain_{};
};

}  // namespace etendue
