#include "reuse/photon_map.h"

#include <algorithm>

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
    dist2[size_t(count - 1)] = radius * radius;  // initial bound of the search
    const float query[3] = {p.x, p.y, p.z};
    tree_->index.findNeighbors(found, query, nanoflann::SearchParams());
    out.count = found.size();
    if (out.count < count) return;
    --out.count;
    out.disc = kPi * dist2[size_t(count - 1)];
}

namespace {

/// Result set of nanoflann: the nearest point within a radius that `accept` accepts.
template <class Accept>
class NearestAccepted {
public:
    NearestAccepted(float radius, const Accept& accept)
        : dist2_(radius * radius), accept_(accept) {}
    size_t size() const { return index ? 1 : 0; }
    bool full() const { return true; }
    bool addPoint(float dist2, uint32_t i) {
        if (dist2 < dist2_ && accept_(i)) {
            dist2_ = dist2;
            index = i;
        }
        return true;
    }
    float worstDist() const { return dist2_; }

    std::optional<uint32_t> index;

private:
    float dist2_;
    const Accept& accept_;
};

}  // namespace

std::optional<uint32_t> PhotonMap::nearest_on_side(Vec3 p, Vec3 n, int step, float radius) const {
    if (!tree_) return {};
    constexpr float kCosine = 0.9f;
    const auto accept = [&](uint32_t i) {
        return i % uint32_t(step) == 0 && dot(photons_[i].side.normal(), n) > kCosine;
    };
    NearestAccepted found(radius, accept);
    const float query[3] = {p.x, p.y, p.z};
    tree_->index.findNeighbors(found, query, nanoflann::SearchParams());
    return found.index;
}

void PhotonIrradiance::begin(const PhotonMap& photons, int step, int count, float radius,
                             int longest) {
    photons_ = &photons;
    step_ = step;
    count_ = count;
    radius_ = radius;
    longest_ = longest;
    const size_t places = photons.photons().size() / size_t(step) + 1;
    states_ = std::make_unique<std::atomic<uint8_t>[]>(places);
    values_.resize(places);
}

std::optional<Rgb> PhotonIrradiance::find(Vec3 p, Vec3 n) const {
    const auto photon = photons_->nearest_on_side(p, n, step_, radius_);
    if (!photon) return {};
    const size_t place = *photon / uint32_t(step_);
    std::atomic<uint8_t>& state = states_[place];
    if (state.load(std::memory_order_acquire) == Known) return values_[place];
    const Rgb E = compute(*photon);
    // Another thread may be about to store the same value.
    uint8_t unknown = Unknown;
    if (state.compare_exchange_strong(unknown, InWork, std::memory_order_relaxed)) {
        values_[place] = E;
        state.store(Known, std::memory_order_release);
    }
    return E;
}

Rgb PhotonIrradiance::compute(uint32_t photon) const {
    const MapPhoton& at = photons_->photons()[photon];
    const Vec3 n = at.side.normal();
    PhotonMap::Neighbours near;
    // The photon itself is included. It is always inside the disc. On the other hand, there is a disc without photons
    // around any point whose nearest photon this is, and this disc lacks one photon on average. The two effects cancel.
    photons_->find(at.p, count_, radius_, near);
    Rgb sum;
    for (int i = 0; i < near.count; ++i) {
        const MapPhoton& other = photons_->photons()[near.index[size_t(i)]];
        if (other.s <= longest_ && dot(other.wi, n) > 0) sum += other.power;
    }
    return sum * (1 / near.disc);
}

}  // namespace etendue
