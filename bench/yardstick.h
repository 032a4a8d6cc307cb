#pragma once
// Speed of this machine: bare Embree along diffuse paths among 100k triangles. Results of other machines are compared
// relative to the ray rate of Embree there, not in seconds.

#include "geometry/accelerator.h"
#include "ray_recorder.h"

namespace etendue::bench {

/// Threads in the results of other renderers, and the ray rate of Embree on that machine (between 8.5 and 9.7 million).
inline constexpr int kPeerThreads = 2;
inline constexpr double kPeerRays = 9.1e6;

class Yardstick {
public:
    Yardstick();
    size_t triangles() const { return mesh_.faces().size(); }
    /// Rays a second, half of them closest hits and half occlusion.
    double rays_per_second(int threads, double seconds) const {
        return rays_.replay(threads, seconds);
    }

private:
    void trace_path(uint64_t index) const;

    TriangleMesh mesh_;
    Accelerator accelerator_;
    RecordedRays rays_;
};

}  // namespace etendue::bench
