#pragma once
// What one rendering found, by class of paths and by technique.

#include <algorithm>
#include <array>
#include <map>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "render/contribution_observer.h"
#include "verify/path_class.h"

namespace etendue {

/// Luminance of many contributions to one mean.
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
    /// What the same mean has where its samples are fewer by this factor.
    Tally from_fewer_samples(double factor) const {
        return {sum, squares * factor, fourths * factor * factor * factor};
    }
    /// The number of equal contributions with the same relative spread [Kish 1965]: a t-test is void where it is small.
    /// The spread itself is uncertain where few contributions decide it, so the number is also limited to four times the
    /// same of the squares.
    double effective_count() const {
        return squares > 0 ? std::min(sum * sum / squares, 4 * squares * squares / fourths) : 0.0;
    }
};

/// The image cut into count × count tiles.
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

/// Serves one rendering on one thread.
class ContributionTally final : public ContributionObserver {
public:
    /// Sums over the crop: the weighted contributions, and the unweighted ones, of one technique to one class.
    struct Entry {
        PathClass path_class;
        Technique technique;
        Tally weighted, alone;

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

    /// An edge shorter than cut_offs[edges of the path] marks the path. Paths with more edges are passed over.
    ContributionTally(const Scene& scene, TileGrid grid, std::vector<float> cut_offs)
        : scene_(scene), grid_(grid), cut_offs_(std::move(cut_offs)) {}

    void observe(const Join& join, Rgb contribution, float share, uint64_t pixel,
                 const Workspace& paths) override;

    /// Sorted.
    std::vector<Entry> entries() const;
    /// By class, whether or not it has a short edge; tile by tile.
    const std::map<PathClass, std::vector<TileSum>>& tiles() const { return tiles_; }

private:
    const Scene& scene_;
    TileGrid grid_;
    std::vector<float> cut_offs_;
    struct Sums {
        Tally weighted, alone;
        std::vector<TileSum>* tiles = nullptr;  ///< In tiles_.
    };
    std::unordered_map<uint64_t, Sums> sums_;  ///< By class, strategy and s.
    std::map<PathClass, std::vector<TileSum>> tiles_;
};

}  // namespace etendue
