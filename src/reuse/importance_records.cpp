#include "reuse/importance_records.h"

#include <algorithm>

#include <nanoflann.hpp>

namespace etendue {

bool to_cdf(std::vector<float>& masses) {
    double total = 0;
    for (const float m : masses) total += m;
    if (!(total > 0)) return false;
    double sum = 0;
    for (float& m : masses) {
        const double mass = m;
        m = float(sum / total);
        sum += mass;
    }
    masses.push_back(1);
    return true;
}

VertexMixture::Draw VertexMixture::sample(double u) const {
    constexpr double kBelowOne = 0x1.fffffffffffffp-1;
    int i = 0;
    double begin = 0;
    while (i < count_ && u >= begin + parts_[size_t(i)].weight) begin += parts_[size_t(i++)].weight;
    const float* cdf = i < count_ ? parts_[size_t(i)].cdf : nullptr;
    const double weight = cdf ? parts_[size_t(i)].weight : 1 - begin;
    const double x = std::min((u - begin) / weight, kBelowOne);
    const auto vertex = cdf ? uint32_t(std::upper_bound(cdf, cdf + vertices_, x) - cdf - 1)
                            : uint32_t(x * vertices_);
    return {vertex, pmf(vertex)};
}

double VertexMixture::pmf(uint32_t vertex) const {
    double sum = 0, uniform = 1;
    for (int i = 0; i < count_; ++i) {
        const auto& [cdf, weight] = parts_[size_t(i)];
        sum += weight * (double(cdf[vertex + 1]) - double(cdf[vertex]));
        uniform -= weight;
    }
    return sum + uniform / vertices_;
}

void ImportanceRecords::Chunk::clear() {
    places_.clear();
    cdfs_.clear();
}

void ImportanceRecords::Chunk::add(const Vertex& z, std::vector<float>& masses) {
    if (!to_cdf(masses)) return;
    places_.push_back({z.p, z.ng, z.wo});
    cdfs_.insert(cdfs_.end(), masses.begin(), masses.end());
}

/// k-d tree of the records' positions.
struct ImportanceRecords::Tree {
    struct Points {
        std::vector<std::array<float, 3>> points;
        size_t kdtree_get_point_count() const { return points.size(); }
        float kdtree_get_pt(size_t i, size_t axis) const { return points[i][axis]; }
        template <class Box>
        bool kdtree_get_bbox(Box&) const {
            return false;
        }
    };
    using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>,
                                                      Points, 3, uint32_t>;

    explicit Tree(const std::vector<Chunk::Place>& places)
        : points{[&] {
              std::vector<std::array<float, 3>> p;
              for (const Chunk::Place& place : places)
                  p.push_back({place.p.x, place.p.y, place.p.z});
              return p;
          }()},
          index(3, points, {kLeafSize}) {}

    static constexpr size_t kLeafSize = 6;
    /// The positions nearest to `p`, approximate up to a factor of 2 in distance; any choice is unbiased.
    size_t nearest(Vec3 p, int count, uint32_t* places, float* distances2) const {
        constexpr float kEpsilon = 3;
        nanoflann::KNNResultSet<float, uint32_t> found{size_t(count)};
        found.init(places, distances2);
        const float query[] = {p.x, p.y, p.z};
        index.findNeighbors(found, query, nanoflann::SearchParams(0, kEpsilon, false));
        return found.size();
    }

    Points points;
    Index index;
};

ImportanceRecords::ImportanceRecords() = default;
ImportanceRecords::~ImportanceRecords() = default;

void ImportanceRecords::assemble(std::span<Chunk> chunks, uint32_t vertices) {
    places_.clear();
    cdfs_.clear();
    vertices_ = vertices;
    for (const Chunk& c : chunks) {
        places_.insert(places_.end(), c.places_.begin(), c.places_.end());
        cdfs_.insert(cdfs_.end(), c.cdfs_.begin(), c.cdfs_.end());
    }
    tree_ = places_.empty() ? nullptr : std::make_unique<Tree>(places_);
}

VertexMixture ImportanceRecords::mixture(const Vertex& z, int neighbours, double uniform) const {
    VertexMixture mixture(vertices_);
    if (!tree_) return mixture;
    std::array<uint32_t, VertexMixture::kMostParts> nearest;
    std::array<float, VertexMixture::kMostParts> distances2;
    const size_t found = tree_->nearest(z.p, neighbours, nearest.data(), distances2.data());
    // Weights are inverse distances, plus a tenth of the largest distance to keep them finite.
    const float reach = 0.1f * std::sqrt(distances2[found - 1]) + 1e-20f;
    std::array<double, VertexMixture::kMostParts> weights;
    double total = 0;
    for (size_t i = 0; i < found; ++i) {
        const Chunk::Place& r = places_[nearest[i]];
        const float alike = std::max(0.0f, dot(r.ng, z.ng)) * std::max(0.0f, dot(r.wo, z.wo));
        weights[i] = alike / (std::sqrt(distances2[i]) + reach);
        total += weights[i];
    }
    if (!(total > 0)) return mixture;
    for (size_t i = 0; i < found; ++i)
        if (weights[i] > 0)
            mixture.add(&cdfs_[size_t(nearest[i]) * (vertices_ + 1)],
                        weights[i] * (1 - uniform) / total);
    return mixture;
}

size_t ImportanceRecords::memory_bytes() const {
    return places_.capacity() * sizeof(Chunk::Place) + cdfs_.capacity() * sizeof(float) +
           (tree_ ? tree_->index.usedMemory(tree_->index) : 0);
}

}  // namespace etendue
