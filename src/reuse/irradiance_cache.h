#pragma once
// Irradiance and its gradients at few points, from which it is interpolated at others [Ward et al. 1988; Ward &
// Heckbert 1992].

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "color/rgb.h"
#include "reuse/point_grid.h"
#include "sampler/sampler.h"

namespace etendue {

struct IrradianceRecord {
    Vec3 p, n;
    Rgb E;
    /// By channel: E at a normal n' differs by (n × n')·rotation, at a point p' by (p' - p)·translation.
    std::array<Vec3, 3> rotation, translation;
    float distance;  ///< Harmonic mean of the distances to visible surfaces.
};

/// Radiance from one direction, and the distance of its origin.
struct IncidentRadiance {
    Rgb L;
    float distance = kInf;
};

/// Computes a record from `radiance(direction)` for about `rays` stratified directions in the hemisphere about `n`.
IrradianceRecord measure_irradiance(Vec3 p, Vec3 n, int rays, Sampler& sampler,
                                    const std::function<IncidentRadiance(Vec3)>& radiance);

class IrradianceCache {
public:
    /// `error` is a in [Ward et al. 1988]: records are valid up to a times their distance, which is clamped to
    /// [min_distance, max_distance].
    void reset(float error, float min_distance, float max_distance);
    void add(std::span<const IrradianceRecord> records);
    size_t size() const { return records_.size(); }

    /// Interpolated irradiance; empty where no record is near enough.
    std::optional<Rgb> find(Vec3 p, Vec3 n) const;

private:
    float error_ = 0, min_distance_ = 0, max_distance_ = 0;
    std::vector<IrradianceRecord> records_;
    PointGrid grid_;
};

}  // namespace etendue
