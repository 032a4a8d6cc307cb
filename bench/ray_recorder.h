#pragma once
// Records rays passed to Embree, and replays them without a renderer.
//
// The programs are linked so that calls of rtcIntersect1 and rtcOccluded1 pass through this code (ld --wrap).
// Integrators need no hooks, and every ray is recorded in the order of tracing. When neither recording nor timing, this
// costs one predictable branch per ray.

#include <cstdint>
#include <functional>
#include <vector>

#include "geometry/ray.h"

namespace etendue::bench {

struct RecordedRay {
    Ray ray;
    bool occlusion;  ///< rtcOccluded1; else rtcIntersect1.
};

/// The rays of one Embree scene, which must outlive it.
class RecordedRays {
public:
    /// Runs `trace`, which must use one thread and one scene, and keeps the rays it traces.
    explicit RecordedRays(const std::function<void()>& trace);

    size_t size() const { return rays_.size(); }
    /// Rays a second of bare rtcIntersect1 and rtcOccluded1: all rays, over and over for at least
    /// `seconds`.
    double replay(int threads, double seconds) const;

private:
    void trace_range(size_t begin, size_t end) const;

    std::vector<RecordedRay> rays_;
    void* scene_ = nullptr;  ///< RTCScene
};

/// Clock ticks of the processor where it has a fast counter, otherwise nanoseconds.
uint64_t ticks();

/// Runs `trace` on one thread and returns the ticks spent within Embree, without those of reading
/// the clock.
double ticks_within_embree(const std::function<void()>& trace);

}  // namespace etendue::bench
