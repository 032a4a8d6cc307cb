#pragma once
// The walk: the one way in which sub-paths are made, from either end. A step samples a direction, appends the vertex that
// lies there, and closes what is known with it: the sums of MIS weights.

#include "pathspace/mis.h"
#include "pathspace/render_stats.h"
#include "pathspace/vertex.h"
#include "sampler/sampler.h"

namespace etendue {

/// How far a walk goes.
struct WalkOptions {
    int max_vertices = 1 << 20;  ///< Of the sub-path, its first vertex included.
    int rr_depth = 5;            ///< Russian roulette from the vertex with this index on.
};

/// What an integrator has learned of places, which every vertex looks up once, when it is appended.
class LearnedPlaces {
public:
    virtual ~LearnedPlaces() = default;
    /// Vertex::pair_level at `p`.
    virtual uint8_t pair_level(Vec3 p) const = 0;
};

/// What all walks of a sample share.
struct WalkContext {
    const Scene& scene;
    const TechniqueCounts& counts;  ///< Of the weights.
    RenderStats& stats;
    WalkOptions options;
    const LearnedPlaces* learned = nullptr;
};

/// z_0 on the lens and, if the scene is met, z_1. The film point is drawn from the pixel's filter.
/// Where the ray leaves the scene, z_1 is a vertex at infinity if there are emitters there, else z_0 stays alone.
void start_eye_path(const WalkContext& walk, const Film& film, uint64_t pixel, Sampler& sampler,
                    SubPath& z);
/// The same through a given film point; `u_lens` picks the point on a finite lens. `sampler` stands behind the numbers that
/// these two took.
void start_eye_path(const WalkContext& walk, const Film::PixelSample& at, Vec2 u_lens,
                    Sampler& sampler, SubPath& z);
/// y_0 on an emitter and, if the scene is met, y_1. False where there is no emitter to choose.
bool start_light_path(const WalkContext& walk, Sampler& sampler, SubPath& y);

/// p_NE / p_L of y_0 for a next vertex along `w`.
float next_event_ratio(const Vertex& y0, Vec3 w);

/// Russian roulette at the last vertex, and a direction from there. Nothing where the walk ends. Every decision at a vertex
/// has a slot of its own (lobe, direction, roulette, masks), used or not, so that a Markov chain finds its numbers again.
template <TransportMode mode>
std::optional<BsdfSample> sample_scattering(const WalkContext& walk, Sampler& sampler,
                                            SubPath& path);
/// Appends what lies in the direction s.wi from the last vertex, which leaves there by the event `s`, however that was
/// found. False where nothing was appended: the ray left the scene, which for an eye walk over a scene with emitters at
/// infinity is a vertex there, or met a surface edge-on.
template <TransportMode mode>
bool append(const WalkContext& walk, Sampler& sampler, const BsdfSample& s, SubPath& path);
/// Stores at the last vertex the sum of weights that its predecessors make known.
template <TransportMode mode>
void close(const WalkContext& walk, SubPath& path);

/// A whole step; false where the walk ends.
template <TransportMode mode>
bool extend(const WalkContext& walk, Sampler& sampler, SubPath& path) {
    const auto s = sample_scattering<mode>(walk, sampler, path);
    if (!s || !append<mode>(walk, sampler, *s, path)) return false;
    close<mode>(walk, path);
    return true;
}

/// Whole sub-paths, as far as the walk goes.
inline void trace_light_path(const WalkContext& walk, Sampler& sampler, SubPath& y) {
    if (!start_light_path(walk, sampler, y)) return;
    while (extend<TransportMode::Importance>(walk, sampler, y)) {
    }
}
inline void trace_eye_path(const WalkContext& walk, const Film& film, uint64_t pixel,
                           Sampler& sampler, SubPath& z) {
    start_eye_path(walk, film, pixel, sampler, z);
    while (extend<TransportMode::Radiance>(walk, sampler, z)) {
    }
}

}  // namespace etendue
