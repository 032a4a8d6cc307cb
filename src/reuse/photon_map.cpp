#include "reuse/photon_map.h"

#include <nanoflann.hpp>

namespace etendue {

class PointTree {
public:
    explicit PointTree(std::vector<Vec3> points)
        : points_{std::move(points)}, index_(3, points_, {kLeafPoints}) {}

    /// Number of each point before, in the order of the leaves, which becomes the order of the points, so that a search
    /// reads memory in order.
    std::vector<uint32_t> sort() {
        std::vector<uint32_t> order = index_.vAcc;
        std::vector<Vec3> sorted;
        sorted.reserve(order.size());
        for (const uint32_t i : order) {
            index_.vAcc[sorted.size()] = uint32_t(sorted.size());
            sorted.push_back(points_.p[i]);
        }
        points_.p = std::move(sorted);
        return order;
    }
    template <class ResultSet>
    void find(Vec3 p, ResultSet& found) const {
        const float query[3] = {p.x, p.y, p.z};
        index_.findNeighbors(found, query, nanoflann::SearchParams());
    }

private:
    static constexpr size_t kLeafPoints = 20;

    struct Points {
        std::vector<Vec3> p;

        size_t kdtree_get_point_count() const { return p.size(); }
        float kdtree_get_pt(uint32_t i, size_t axis) const { return p[i][int(axis)]; }
        template <class Box>
        bool kdtree_get_bbox(Box&) const {
            return false;
        }
    };
    using Index =
        nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>, Points, 3>;

    Points points_;
    Index index_;
};

PhotonMap::PhotonMap() = default;
PhotonMap::~PhotonMap() = default;
PhotonMap::PhotonMap(PhotonMap&&) noexcept = default;
PhotonMap& PhotonMap::operator=(PhotonMap&&) noexcept = default;

void PhotonMap::build(std::vector<MapPhoton> photons) {
    photons_.clear();
    tree_ = nullptr;
    if (photons.empty()) return;
    std::vector<Vec3> points;
    points.reserve(photons.size());
    for (const MapPhoton& photon : photons) points.push_back(photon.p);
    tree_ = std::make_unique<PointTree>(std::move(points));
    photons_.reserve(photons.size());
    for (const uint32_t i : tree_->sort()) photons_.push_back(photons[i]);
}

namespace {

/// Result set of nanoflann: the nearest points within a radius, as a heap whose first element is the farthest.
class NearestPoints {
public:
    NearestPoints(int count, float radius, PhotonMap::Neighbours& out)
        : most_(count), bound_(radius * radius), out_(out) {
        out_.count = 0;
    }
    size_t size() const { return size_t(out_.count); }
    bool full() const { return out_.count == most_; }
    float worstDist() const { return full() ? dist2_[0] : bound_; }
    bool addPoint(float dist2, uint32_t i) {
        if (!(dist2 < worstDist()))
            return true;  // nanoflann compares with that of the leaf's beginning.
        int at = 0;
        if (!full()) {
            // From the end toward the first element.
            for (at = out_.count++; at > 0 && dist2_[size_t(at - 1) / 2] < dist2; at = (at - 1) / 2)
                move((at - 1) / 2, at);
        } else {
            // In place of the first element, toward the end.
            for (int child = 1; child < most_; child = 2 * at + 1) {
                if (child + 1 < most_ && dist2_[size_t(child)] < dist2_[size_t(child + 1)]) ++child;
                if (!(dist2 < dist2_[size_t(child)])) break;
                move(child, at);
                at = child;
            }
        }
        dist2_[size_t(at)] = dist2;
        out_.index[size_t(at)] = i;
        return true;
    }
    /// Removes the first element.
    void drop_farthest() { out_.index[0] = out_.index[size_t(--out_.count)]; }

private:
    void move(int from, int to) {
        dist2_[size_t(to)] = dist2_[size_t(from)];
        out_.index[size_t(to)] = out_.index[size_t(from)];
    }

    int most_;
    float bound_;
    std::array<float, PhotonMap::kMostNeighbours> dist2_;
    PhotonMap::Neighbours& out_;
};

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

void PhotonMap::find(Vec3 p, int count, float radius, Neighbours& out) const {
    NearestPoints found(count, radius, out);
    out.disc = kPi * radius * radius;
    if (!tree_) return;
    tree_->find(p, found);
    if (!found.full()) return;
    out.disc = kPi * found.worstDist();
    found.drop_farthest();
}

PhotonSides::PhotonSides() = default;
PhotonSides::~PhotonSides() = default;

void PhotonSides::build(const PhotonMap& photons, int step) {
    photons_ = &photons;
    step_ = size_t(step);
    std::vector<Vec3> points;
    for (size_t i = 0; i < photons.photons().size(); i += step_)
        points.push_back(photons.photons()[i].p);
    tree_ = points.empty() ? nullptr : std::make_unique<PointTree>(std::move(points));
}

std::optional<uint32_t> PhotonSides::nearest(Vec3 p, Vec3 n, float radius) const {
    if (!tree_) return {};
    constexpr float kCosine = 0.9f;
    const auto accept = [&](uint32_t i) {
        return dot(photons_->photons()[step_ * i].side.normal(), n) > kCosine;
    };
    NearestAccepted found(radius, accept);
    tree_->find(p, found);
    return found.index;
}

void PhotonIrradiance::begin(const PhotonMap& photons, int step, int count, float radius,
                             int longest) {
    photons_ = &photons;
    places_.build(photons, step);
    step_ = step;
    count_ = count;
    radius_ = radius;
    longest_ = longest;
    const size_t places = photons.photons().size() / size_t(step) + 1;
    states_ = std::make_unique<std::atomic<uint8_t>[]>(places);
    values_.resize(places);
}

std::optional<Rgb> PhotonIrradiance::find(Vec3 p, Vec3 n) const {
    const auto nearest = places_.nearest(p, n, radius_);
    if (!nearest) return {};
    const uint32_t place = *nearest;
    std::atomic<uint8_t>& state = states_[place];
    if (state.load(std::memory_order_acquire) == Known) return values_[place];
    const Rgb E = compute(place * uint32_t(step_));
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
