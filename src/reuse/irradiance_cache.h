#pragma once
// Irradiance at few points, and its gradients, from which that at points near them follows [Ward et al. 1988; Ward &
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
    float distance;  ///< Harmonic mean of the distances to what is seen.
};

/// What arrives from a direction, and from how far.
struct IncidentRadiance {
    Rgb L;
    float distance = kInf;
};

/// A record from about `rays` stratified directions about `n`, whose radiance is asked for.
IrradianceRecord measure_irradiance(Vec3 p, Vec3 n, int rays, Sampler& sampler,
                                    const std::function<IncidentRadiance(Vec3)>& radiance);

class IrradianceCache {
public:
    /// `error`: the a of [Ward et al. 1988]; records reach as far as a times their distance, taken to lie in
    /// [min_distance, max_distance].
    void reset(float error, float min_distance, float max_distance);
    void add(std::span<const IrradianceRecord> records);
    size_t size() const { return records_.size(); }

    /// Interpolated irradiance; nothing where no record is near enough.
    std::optional<Rgb> find(Vec3 p, Vec3 n) const;

private:
    float error_ = 0, min_distance_ = 0, max_distance_ = 0;
    std::vector<IrradianceRecord> records_;
    PointGrid grid_;
};

}  // namespace etendue
