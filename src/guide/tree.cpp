#include "guide/tree.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "math/bounds.h"
#include "math/hash.h"

namespace etendue {
namespace {

/// Cells are split above this number of samples.
constexpr size_t kMostSamples = 4000;
/// A cell with fewer samples of a mode takes lobes also from those of the smallest node around it that has so many.
constexpr size_t kFewestSamples = 256;
constexpr size_t kMostCells = size_t(1) << 15;

/// Indices [begin, end) of the order of a mode.
struct Range {
    size_t begin = 0, end = 0;
    size_t size() const { return end - begin; }
    bool contains(size_t i) const { return i >= begin && i < end; }
};
using Ranges = std::array<Range, 2>;  ///< By TransportMode.

bool is_usable(const GuideSample& s) {
    return s.weight > 0 && s.weight < kInf;
}

}  // namespace

struct GuideTree::Builder {
    struct Leaf {
        Bounds3 box;
        Ranges own;
        Ranges around;  ///< Of the smallest node with enough samples of the mode.
    };

    GuideTree& tree;
    const std::vector<GuideSample>& samples;
    GuideLearning learning;
    /// Samples of each mode; those of a node follow each other.
    std::array<std::vector<uint32_t>, 2> order{};
    std::vector<Leaf> leaves{};

    void split(uint32_t node, const Ranges& own, Ranges around) {
        Bounds3 box;
        std::array<double, 3> sum{};
        size_t count = 0;
        for (size_t m = 0; m < 2; ++m) {
            for (size_t i = own[m].begin; i < own[m].end; ++i) {
                const Vec3 p = samples[order[m][i]].p;
                box.extend(p);
                for (int axis = 0; axis < 3; ++axis) sum[size_t(axis)] += double(p[axis]);
            }
            count += own[m].size();
            if (own[m].size() >= kFewestSamples) around[m] = own[m];
        }
        const Vec3 size = box.hi - box.lo;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const float at = float(sum[size_t(axis)] / double(count));
        // A plane through coincident points leaves one side empty.
        if (count > kMostSamples && leaves.size() < kMostCells && box.lo[axis] < at) {
            Ranges lower, upper;
            for (size_t m = 0; m < 2; ++m) {
                const auto first = order[m].begin();
                const auto middle = std::stable_partition(
                    first + ptrdiff_t(own[m].begin), first + ptrdiff_t(own[m].end),
                    [&](uint32_t i) { return samples[i].p[axis] < at; });
                lower[m] = {own[m].begin, size_t(middle - first)};
                upper[m] = {size_t(middle - first), own[m].end};
            }
            const uint32_t below = tree.splits_.divide(node, axis, at);
            split(below, lower, around);
            split(below + 1, upper, around);
            return;
        }
        tree.splits_.set_leaf(node, leaves.size());
        leaves.push_back({box, own, around});
    }

    /// The sides of the surfaces in a leaf, as bits.
    unsigned sides(const Leaf& leaf) const {
        unsigned bits = 0;
        for (size_t m = 0; m < 2; ++m)
            for (size_t i = leaf.own[m].begin; i < leaf.own[m].end; ++i)
                bits |= 1u << surface_side(samples[order[m][i]].unpacked_normal());
        return bits;
    }

    /// Samples for the fit of a mode. A leaf with few of its own takes its lobes also from those around it, as far as they
    /// lie on the same sides of surfaces. These may be in another room, so only its own tell what is gained here.
    FitSamples chosen(const Leaf& leaf, size_t m) const {
        const Range own = leaf.own[m], around = leaf.around[m];
        const auto at = [&](size_t i) { return &samples[order[m][i]]; };
        const size_t step = (around.size() + kMostSamples - 1) / kMostSamples;
        if (own.size() == around.size()) {
            std::vector<const GuideSample*> all;
            for (size_t i = own.begin; i < own.end; i += step) all.push_back(at(i));
            return FitSamples::held_out(all);
        }
        std::vector<const GuideSample*> all;
        for (size_t i = own.begin; i < own.end; ++i) all.push_back(at(i));
        FitSamples fit = FitSamples::held_out(all, 2);
        const unsigned known = sides(leaf);
        for (size_t i = around.begin; i < around.end; i += step)
            if (!own.contains(i) && known >> surface_side(at(i)->unpacked_normal()) & 1)
                fit.lobes.push_back(at(i));
        return fit;
    }

    void fit(size_t leaf, uint64_t seed, std::array<GuideFit, 2>& fits) {
        const Leaf& l = leaves[leaf];
        GuideCell& cell = tree.cells_[leaf];
        cell.center = l.box.center();
        for (size_t m = 0; m < 2; ++m) {
            const FitSamples samples_of_mode = chosen(l, m);
            const uint64_t number = hash_combine(seed, 2 * leaf + m);
            if (!learning.has_footprints)
                fits[m] = fit_guide(samples_of_mode, cell.center, number, learning);
            else if (m == size_t(TransportMode::Radiance))
                fits[m] = footprint_guide(samples_of_mode.lobes, number);
            cell.fields[m] = {fits[m].mixture, fits[m].share, fits[m].training_share, {}};
        }
    }

    /// See GuideTree::gain().
    void set_gains(const std::vector<std::array<GuideFit, 2>>& fits, const LeftOut& left_out) {
        // As in the fits, single samples must not decide.
        constexpr double kLargest = 10;
        // With fewer samples of both modes, neither what a cell gains is known nor the area of its surfaces.
        constexpr size_t kFewest = 16;
        /// In a cell, by mode and side.
        using Power = std::array<std::array<double, kSurfaceSides>, 2>;
        std::vector<Power> learned(leaves.size()), all;
        std::array<double, 2> total{};
        for (size_t k = 0; k < leaves.size(); ++k)
            for (size_t m = 0; m < 2; ++m) {
                const Range own = leaves[k].own[m];
                double sum = 0;
                for (size_t i = own.begin; i < own.end; ++i)
                    sum += double(samples[order[m][i]].flux());
                const double largest = kLargest * sum / double(own.size());
                for (size_t i = own.begin; i < own.end; ++i) {
                    const GuideSample& s = samples[order[m][i]];
                    learned[k][m][surface_side(s.unpacked_normal())] +=
                        std::min(double(s.flux()), largest);
                }
            }
        all = learned;
        for (size_t m = 0; m < 2; ++m)
            for (const PlacedWeight& w : left_out[m])
                if (w.weight < kInf)
                    all[tree.splits_.leaf(w.p)][m][surface_side(w.n)] += double(w.weight);
        for (const Power& power : all)
            for (size_t m = 0; m < 2; ++m)
                for (const double p : power[m]) total[m] += p;
        for (size_t m = 0; m < 2; ++m) {
            const size_t other = 1 - m;
            double gain = 0, sum = 0;
            for (size_t k = 0; k < leaves.size(); ++k) {
                if (leaves[k].own[0].size() + leaves[k].own[1].size() < kFewest) continue;
                const double area = surface_area(leaves[k].box);
                double weight = 0;
                for (size_t side = 0; side < kSurfaceSides; ++side)
                    if (total[other] == 0)
                        weight += learned[k][m][side];
                    else if (area > 0)
                        weight += learned[k][m][side] * all[k][other][side] / area;
                gain += weight * double(fits[k][m].gain);
                sum += weight;
            }
            tree.gain_[m] = sum > 0 ? float(gain / sum) : 0.0f;
        }
    }
};

GuideTree::GuideTree(const std::vector<GuideSample>& samples, uint64_t seed,
                     const GuideLearning& learning, const LeftOut& left_out) {
    Builder builder{*this, samples, learning};
    for (size_t i = 0; i < samples.size(); ++i)
        if (is_usable(samples[i])) builder.order[samples[i].mode].push_back(uint32_t(i));
    Ranges all;
    for (size_t m = 0; m < 2; ++m) all[m] = {0, builder.order[m].size()};
    if (all[0].size() + all[1].size() == 0) return;
    builder.split(KdSplits::kRoot, all, all);
    cells_.resize(builder.leaves.size());
    std::vector<std::array<GuideFit, 2>> fits(cells_.size());
    tbb::parallel_for(size_t(0), cells_.size(),
                      [&](size_t leaf) { builder.fit(leaf, seed, fits[leaf]); });
    builder.set_gains(fits, left_out);
}

void GuideTree::use_training_shares() {
    for (GuideCell& cell : cells_)
        for (GuideCell::Field& field : cell.fields) field.share = field.training_share;
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
    using BySide = std::array<std::array<Sums, kCubeFaces>, 2>;
    std::vector<BySide> cells(cells_.size());
    std::array<Sums, 2> all;
    const auto is_finite = [](const ContributionRecord& r) {
        return r.beta < kInf && r.here < kInf && r.beyond < kInf;
    };
    for (const ContributionRecord& r : records) {
        if (!is_finite(r)) continue;
        cells[splits_.leaf(r.p)][r.mode][r.face].add(r);
        all[r.mode].add(r);
    }
    std::vector<std::array<std::array<double, kCubeFaces>, 2>> clamped(cells_.size());
    for (const ContributionRecord& r : records) {
        if (!is_finite(r)) continue;
        const size_t cell = splits_.leaf(r.p);
        const Sums& s = cells[cell][r.mode][r.face];
        clamped[cell][r.mode][r.face] +=
            std::min(double(r.here), kLargestHere * double(r.beta) * s.here / s.beta);
    }
    for (size_t i = 0; i < cells_.size(); ++i)
        for (size_t m = 0; m < 2; ++m)
            for (size_t k = 0; k < kCubeFaces; ++k) {
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
