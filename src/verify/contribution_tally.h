#pragma once
// Contributions of one rendering, by class of paths and by technique.

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "render/contribution_observer.h"
#include "verify/path_class.h"

namespace etendue {

/// Sums of powers of the luminance of contributions to one mean.
struct Tally {
    double sum = 0, squares = 0, fourths = 0;

    void add(double v) {
        const double square = v * v;
        sum += v;
        squares += square;
        fourths += square * square;
    }
    Tally& operator+=(const Tally& o) {
        sum += o.sum;
        squares += o.squares;
        fourths += o.fourths;
        return *this;
    }
    Tally scaled(double factor) const {
        const double square = factor * factor;
        return {sum * factor, squares * square, fourths * square * square};
    }
    /// The tally of the same mean with fewer samples by this factor.
    Tally from_fewer_samples(double factor) const {
        return {sum, squares * factor, fourths * factor * factor * factor};
    }
    /// The tally with so large a second moment that its effective count is at most `count`.
    Tally with_count_of_at_most(double count) const {
        Tally limited = *this;
        limited.squares = std::max(squares, sum * sum / count);
        return limited;
    }
    /// Effective sample size (Σv)² / Σv² [Kish 1965]: a t-test needs a large one. Where few contributions dominate Σv²,
    /// it is uncertain itself, so it is limited to four times the effective sample size of the squares.
    double effective_count() const {
        return squares > 0 ? std::min(sum * sum / squares, 4 * squares * squares / fourths) : 0.0;
    }
};

/// Estimates of ∫ f²/p_q, the second moment of the unweighted contributions of a technique q, from the contributions of
/// several techniques, each with its power-heuristic weight. Rare ones are seen where another technique finds them.
struct SecondMoments {
    double own = 0;  ///< Part of the estimate for the technique itself.
    /// Part of a lower bound of that for any other technique q: there f/p_q is at least √(w / (1 - w)) times as large as the
    /// contribution, whose weight is w, because w_q ≤ 1 - w.
    double others = 0;

    void add(double contribution, double mis_weight) {
        constexpr double kRounding = 0x1p-24;  // of weights
        const double rest = std::max(1 - mis_weight, kRounding);
        const double weighted = contribution * mis_weight;
        own += weighted * contribution;
        others += weighted * contribution * std::sqrt(mis_weight / rest);
    }
    SecondMoments& operator+=(const SecondMoments& o) {
        own += o.own, others += o.others;
        return *this;
    }
    SecondMoments scaled(double factor) const {
        return {own * factor * factor, others * factor * factor};
    }
};

/// Division of the crop into count × count tiles.
struct TileGrid {
    FilmGeometry film;
    int count;

    size_t tile(uint64_t pixel) const {
        const int x = int(pixel % uint64_t(film.crop_width));
        const int y = int(pixel / uint64_t(film.crop_width));
        return size_t(y * count / film.crop_height * count + x * count / film.crop_width);
    }
    size_t tiles() const { return size_t(count) * size_t(count); }
};

/// Collects the contributions of one rendering, which must run on one thread.
class ContributionTally final : public ContributionObserver {
public:
    /// Weighted and unweighted contributions of one technique to one class, summed over the crop.
    struct Entry {
        PathClass path_class;
        Technique technique;
        Tally weighted, alone;
        SecondMoments of_alone{};

        Entry scaled(double factor) const {
            return {path_class, technique, weighted.scaled(factor), alone.scaled(factor),
                    of_alone.scaled(factor)};
        }
        Entry& operator+=(const Entry& o) {
            weighted += o.weighted, alone += o.alone, of_alone += o.of_alone;
            return *this;
        }
        /// By class, then by technique.
        friend bool operator<(const Entry& a, const Entry& b) {
            return std::tie(a.path_class, a.technique.strategy, a.technique.s) <
                   std::tie(b.path_class, b.technique.strategy, b.technique.s);
        }
    };
    /// Weighted sums over a tile.
    struct TileSum {
        std::array<double, 3> rgb{};
        Tally luminance;
    };

    /// Paths with an edge shorter than cut_offs[number of edges] get has_short_edge. Paths with more edges than there
    /// are cut-offs are ignored.
    ContributionTally(const Scene& scene, TileGrid grid, std::vector<float> cut_offs)
        : scene_(scene), grid_(grid), cut_offs_(std::move(cut_offs)) {}

    void observe(const Join& join, Rgb contribution, float share, const FilmTarget& target,
                 const Workspace& paths) override;

    /// All entries, sorted.
    std::vector<Entry> entries() const;
    /// Sums of every tile by class; classes that differ only in has_short_edge are combined.
    const std::map<PathClass, std::vector<TileSum>>& tiles() const { return tiles_; }

private:
    const Scene& scene_;
    TileGrid grid_;
    std::vector<float> cut_offs_;
    struct Sums {
        Tally weighted, alone;
        SecondMoments of_alone;
        std::vector<TileSum>* tiles = nullptr;  ///< Element of tiles_.
    };
    std::unordered_map<uint64_t, Sums> sums_;  ///< By class, strategy and s.
    std::map<PathClass, std::vector<TileSum>> tiles_;
};

}  // namespace etendue
