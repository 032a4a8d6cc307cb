#include "reuse/photon_map.h"

#include <nanoflann.hpp>

namespace etendue {

struct PhotonMap::Tree {
    struct Points {
        std::span<const MapPhoton> photons;

        size_t kdtree_get_point_count() const { return photons.size(); }
        float kdtree_get_pt(uint32_t i, size_t axis) const { return photons[i].p[int(axis)]; }
        template <class Box>
        bool kdtree_get_bbox(Box&) const {
            return false;
        }
    };
    using Index =
        nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>, Points, 3>;

    Points points;
    Index index;
    explicit Tree(std::span<const MapPhoton> photons) : points{photons}, index(3, points) {}
};

PhotonMap::PhotonMap() = default;
PhotonMap::~PhotonMap() = default;
PhotonMap::PhotonMap(PhotonMap&&) noexcept = default;
PhotonMap& PhotonMap::operator=(PhotonMap&&) noexcept = default;

void PhotonMap::build(std::vector<MapPhoton> photons) {
    photons_ = std::move(photons);
    tree_ = photons_.empty() ? nullptr : std::make_unique<Tree>(photons_);
}

void PhotonMap::find(Vec3 p, int count, float radius, Neighbours& out) const {
    out.count = 0;
    out.disc = kPi * radius * radius;
    if (!tree_) return;
    std::array<float, kMostNeighbours> dist2;
    nanoflann::KNNResultSet<float, uint32_t, int> found(count);
    found.init(out.index.data(), dist2.data());
    dist2[size_t(count - 1)] = radius * radius;  // the search's first bound
    const float query[3] = {p.x, p.y, p.z};
    tree_->index.findNeighbors(found, query, nanoflann::SearchParams());
    out.count = found.size();
    if (out.count < count) return;
    --out.count;
    out.disc = kPi * dist2[size_t(count - 1)];
}

}  // namespace etendue
