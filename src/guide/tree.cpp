#include "guide/tree.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "math/bounds.h"
#include "math/hash.h"

namespace etendue {
namespace {

/// Cells are split above this number of samples.
constexpr size_t kMostSamples = 4000;
/// A cell with fewer samples of a mode takes those of the smallest node around it that has so many.
constexpr size_t kFewestSamples = 256;
constexpr size_t kMostCells = size_t(1) << 15;

/// Samples [begin, end) of the order.
struct Range {
    size_t begin, end;
    size_t size() const { return end - begin; }
};

}  // namespace

struct GuideTree::Builder {
    struct Leaf {
        Bounds3 box;
        std::array<Range, 2> ranges;  ///< From which each mode is fitted.
    };

    GuideTree& tree;
    const std::vector<GuideSample>& samples;
    GuideLearning learning;
    std::vector<uint32_t> order{};
    std::vector<Leaf> leaves{};

    void split(uint32_t node, Range range, std::array<Range, 2> ranges) {
        Bounds3 box;
        std::array<double, 3> sum{};
        std::array<size_t, 2> count{};
        for (size_t i = range.begin; i < range.end; ++i) {
            const GuideSample& s = samples[order[i]];
            box.extend(s.p);
            for (int axis = 0; axis < 3; ++axis) sum[size_t(axis)] += double(s.p[axis]);
            ++count[s.mode];
        }
        for (size_t m = 0; m < 2; ++m)
            if (count[m] >= kFewestSamples) ranges[m] = range;
        const Vec3 size = box.hi - box.lo;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const float at = float(sum[size_t(axis)] / double(range.size()));
        // A plane through coincident points leaves one side empty.
        if (range.size() > kMostSamples && leaves.size() < kMostCells && box.lo[axis] < at) {
            const auto begin = order.begin();
            const size_t middle = size_t(
                std::stable_partition(begin + ptrdiff_t(range.begin), begin + ptrdiff_t(range.end),
                                      [&](uint32_t i) { return samples[i].p[axis] < at; }) -
                begin);
            const uint32_t below = tree.splits_.divide(node, axis, at);
            split(below, {range.begin, middle}, ranges);
            split(below + 1, {middle, range.end}, ranges);
            return;
        }
        tree.splits_.set_leaf(node, leaves.size());
        leaves.push_back({box, ranges});
    }

    /// Samples of a mode in a range, in the order of the samples, and no more of them than are needed.
    std::vector<const GuideSample*> of_mode(Range range, size_t mode) const {
        std::vector<uint32_t> found;
        for (size_t i = range.begin; i < range.end; ++i)
            if (const GuideSample& s = samples[order[i]]; s.mode == mode && s.weight > 0)
                found.push_back(order[i]);
        std::vector<const GuideSample*> kept;
        const size_t step = (found.size() + kMostSamples - 1) / kMostSamples;
        for (size_t i = 0; i < found.size(); i += step) kept.push_back(&samples[found[i]]);
        return kept;
    }

    void fit(size_t leaf, uint64_t seed, std::array<GuideFit, 2>& fits) {
        const Leaf& l = leaves[leaf];
        GuideCell& cell = tree.cells_[leaf];
        cell.center = l.box.center();
        for (size_t m = 0; m < 2; ++m) {
            const auto chosen = of_mode(l.ranges[m], m);
            if (chosen.empty()) continue;
            const uint64_t number = hash_combine(seed, 2 * leaf + m);
            if (!learning.has_footprints)
                fits[m] = fit_guide(chosen, cell.center, number, learning);
            else if (m == size_t(TransportMode::Radiance))
                fits[m] = footprint_guide(chosen, number);
            cell.fields[m] = {fits[m].mixture, fits[m].share};
        }
    }
};

GuideTree::GuideTree(const std::vector<GuideSample>& samples, uint64_t seed,
                     const GuideLearning& learning) {
    if (samples.empty()) return;
    Builder builder{*this, samples, learning};
    builder.order.resize(samples.size());
    for (size_t i = 0; i < samples.size(); ++i) builder.order[i] = uint32_t(i);
    const Range all{0, samples.size()};
    builder.split(KdSplits::kRoot, all, {all, all});
    cells_.resize(builder.leaves.size());
    std::vector<std::array<GuideFit, 2>> fits(cells_.size());
    tbb::parallel_for(size_t(0), cells_.size(),
                      [&](size_t leaf) { builder.fit(leaf, seed, fits[leaf]); });

    // Where one of the two is nothing, the other does not matter.
    std::vector<std::array<double, 2>> light(cells_.size());
    std::array<size_t, 2> count{};
    for (const GuideSample& s : samples)
        light[splits_.leaf(s.p)][s.mode] += double(s.weight), ++count[s.mode];
    const bool has_both = count[0] > 0 && count[1] > 0;
    for (size_t m = 0; m < 2; ++m) {
        double gain = 0, sum = 0;
        for (size_t i = 0; i < cells_.size(); ++i) {
            const double weight = has_both ? light[i][0] * light[i][1] : light[i][m];
            gain += weight * double(fits[i][m].gain);
            sum += weight;
        }
        gain_[m] = sum > 0 ? float(gain / sum) : 0.0f;
    }
}

void GuideTree::set_contributions(const std::vector<ContributionRecord>& records) {
    constexpr double kFewest = 32;
    // As if so many records of average throughput had been found with the mean over all cells.
    constexpr double kPrior = 4;
    // References of Russian roulette must not be large by chance, since many walks would end. A large `beyond` only
    // keeps walks alive.
    constexpr double kLargestHere = 10;
    struct Sums {
        double count = 0, beta = 0, here = 0, beyond = 0;
        void add(const ContributionRecord& r) {
            ++count;
            beta += double(r.beta);
            here += double(r.here);
            beyond += double(r.beyond);
        }
    };
    using ByOctant = std::array<std::array<Sums, 8>, 2>;
    std::vector<ByOctant> cells(cells_.size());
    std::array<Sums, 2> all;
    for (const ContributionRecord& r : records) {
        cells[splits_.leaf(r.p)][r.mode][r.octant].add(r);
        all[r.mode].add(r);
    }
    std::vector<std::array<std::array<double, 8>, 2>> clamped(cells_.size());
    for (const ContributionRecord& r : records) {
        const size_t cell = splits_.leaf(r.p);
        const Sums& s = cells[cell][r.mode][r.octant];
        clamped[cell][r.mode][r.octant] +=
            std::min(double(r.here), kLargestHere * double(r.beta) * s.here / s.beta);
    }
    for (size_t i = 0; i < cells_.size(); ++i)
        for (size_t m = 0; m < 2; ++m)
            for (size_t k = 0; k < 8; ++k) {
                const Sums& s = cells[i][m][k];
                WalkContribution& c = cells_[i].fields[m].contribution[k];
                c = {};
                if (!(s.count >= kFewest && s.beta > 0)) continue;
                const double prior = kPrior * s.beta / s.count;
                c.here = float((clamped[i][m][k] + prior * all[m].here / all[m].beta) /
                               (s.beta + prior));
                c.beyond =
                    float((s.beyond + prior * all[m].beyond / all[m].beta) / (s.beta + prior));
            }
}

}  // namespace etendue
