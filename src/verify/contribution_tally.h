#pragma once
// What one rendering brought, by class of paths and by technique.

#include <array>
#include <map>
#include <unordered_map>

#include "render/contribution_observer.h"
#include "verify/path_class.h"

namespace etendue {

/// Luminance of many contributions to one mean.
struct Tally {
    double sum = 0, squares = 0;

    void add(double v) {
        sum += v;
        squares += v * v;
    }
    Tally& operator+=(const Tally& o) {
        sum += o.sum;
        squares += o.squares;
        return *this;
    }
    /// How many equal contributions would be spread as much [Kish 1965]: where it is small, a t-test is void.
    double effective_count() const { return squares > 0 ? sum * sum / squares : 0.0; }
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

    std::vector<Entry> entries() const;
    /// By class, whether or not it has a short edge; tile by tile.
    const std::map<PathClass, std::vector<TileSum>>& tiles() const { return tiles_; }

private:
    const Scene& scene_;
    TileGrid grid_;
    std::vector<float> cut_offs_;
    struct Sums {
        Tally weighted, alone;
    };
    std::unordered_map<uint64_t, Sums> sums_;  ///< By class, strategy and s.
    std::map<PathClass, std::vector<TileSum>> tiles_;
};

}  // namespace etendue
