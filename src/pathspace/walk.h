#pragma once
// The walk, which makes all sub-paths, from either end. A step samples a direction, appends the vertex in that
// direction, and updates the sums of MIS weights that are then known.

#include <span>

#include "pathspace/mis.h"
#include "pathspace/render_stats.h"
#include "pathspace/vertex.h"
#include "sampler/sampler.h"

namespace etendue {

/// Limits of a walk.
struct WalkOptions {
    int max_vertices = 1 << 20;  ///< Of the sub-path, its first vertex included.
    int rr_depth = 5;            ///< Russian roulette from the vertex with this index on.
    bool has_roulette = true;    ///< Whether there is any; otherwise not even that of a guide.
};

/// Data learned by an integrator as a function of position; every vertex looks it up once, when it is appended.
class LearnedPlaces {
public:
    virtual ~LearnedPlaces() = default;
    /// Vertex::pair_level at `p`.
    virtual uint8_t pair_level(Vec3 p) const = 0;
};

/// Data shared by all walks of a sample.
struct WalkContext {
    const Scene& scene;
    const TechniqueCounts& counts;  ///< Of the weights.
    RenderStats& stats;
    WalkOptions options;
    const LearnedPlaces* learned = nullptr;
};

/// A step of a walk under way: the ray that has left its last vertex, and what the ray has met.
struct Step {
    Ray ray;
    Rgb beta;         ///< Throughput at the end of the ray.
    float pdf_sa;     ///< Density of its direction, or the probability of a delta event.
    MediumId medium;  ///< At its end.
    bool found;       ///< Whether it has met a surface, at `hit`.
    SurfaceHit hit;
};

/// Makes z_0 on the lens and, if the ray hits a surface, z_1. The film point is that of the sample `index`. If the
/// ray leaves the scene, z_1 is a vertex at infinity if there are emitters at infinity; otherwise there is no z_1.
void start_eye_path(const WalkContext& walk, const Film& film, uint64_t index, Sampler& sampler,
                    SubPath& z);
/// The same for a film point that is drawn from the filter of a pixel. For walks that contribute nothing to the film:
/// they depend on their own random numbers alone, whatever the film points of the pass are.
void start_eye_path_of_pixel(const WalkContext& walk, const Film& film, uint64_t pixel,
                             Sampler& sampler, SubPath& z);
/// The same for a given film point; `u_lens` chooses the point on a finite lens. `sampler` must be positioned after the
/// numbers used for these two.
void start_eye_path(const WalkContext& walk, const Film::PixelSample& at, Vec2 u_lens,
                    Sampler& sampler, SubPath& z);
/// The same along a given ray.
void start_eye_path(const WalkContext& walk, const Film::PixelSample& at, const SensorRay& ray,
                    Sampler& sampler, SubPath& z);
/// Makes y_0 on an emitter and, if the ray hits a surface, y_1. False where no emitter has power.
bool start_light_path(const WalkContext& walk, Sampler& sampler, SubPath& y);
/// The same for a given start.
void start_light_path(const WalkContext& walk, const Emitter& emitter, const EmissionSample& e,
                      Sampler& sampler, SubPath& y);

/// p_NE / p_L of y_0 for a next vertex `next` along `w`, where `guide` guides light paths.
float next_event_ratio(const Vertex& y0, const Vertex& next, Vec3 w, const Guide* guide);

/// Russian roulette at the last vertex, and a sampled direction; empty where the walk ends. Every decision at a vertex
/// has its own slot of random numbers (lobe, direction, roulette, masks), used or not, so that a Markov chain finds its
/// numbers again.
template <TransportMode mode>
std::optional<BsdfSample> sample_scattering(const WalkContext& walk, Sampler& sampler,
                                            SubPath& path);
/// Appends the vertex in direction s.wi from the last vertex, for any event `s`, sampled or not. False where no vertex
/// was appended: the ray left the scene (eye walks get a vertex at infinity if there are emitters at infinity), or hit
/// a surface edge-on.
template <TransportMode mode>
bool append(const WalkContext& walk, Sampler& sampler, const BsdfSample& s, SubPath& path);
/// Stores the sum of MIS weights, which is now known for level last-2, at the last vertex.
template <TransportMode mode>
void close(const WalkContext& walk, SubPath& path);

/// The two parts of a step of the walk; false where the walk ends. The first one samples a direction and traces its ray, the
/// second one appends the vertex where the ray ends.
template <TransportMode mode>
bool begin_step(const WalkContext& walk, Sampler& sampler, SubPath& path, Step& step);
template <TransportMode mode>
bool end_step(const WalkContext& walk, SubPath& path, Step& step);
/// One step of the walk; false where it ends.
template <TransportMode mode>
bool extend(const WalkContext& walk, Sampler& sampler, SubPath& path) {
    Step step;
    return begin_step<mode>(walk, sampler, path, step) && end_step<mode>(walk, path, step);
}

/// Ends the step of a walk, and goes on with the walk to its end.
template <TransportMode mode>
void walk_on(const WalkContext& walk, Sampler& sampler, SubPath& path, Step& step) {
    while (end_step<mode>(walk, path, step) && begin_step<mode>(walk, sampler, path, step)) {
    }
}

/// One of several walks that are made in turns.
struct WalkInTurn {
    Sampler* sampler;
    SubPath* path;
    Step step;  ///< Begun.
};
/// As many as a worker makes in turns: enough that memory has come when it is read, and few enough that all of their vertices
/// stay in the caches.
inline constexpr size_t kWalksInTurn = 8;
/// walk_on() for at most kWalksInTurn walks. While one of
/// them computes, the memory that the others wait for comes: group prefetching [Chen et al. 2007].
template <TransportMode mode>
void walk_in_turns(const WalkContext& walk, std::span<WalkInTurn> walks);
/// Makes z_0 on the lens, and begins the step to z_1.
void begin_eye_path(const WalkContext& walk, const Film::PixelSample& at, const SensorRay& ray,
                    Sampler& sampler, SubPath& z, Step& step);

/// Walks whole sub-paths.
inline void trace_light_path(const WalkContext& walk, Sampler& sampler, SubPath& y) {
    if (!start_light_path(walk, sampler, y)) return;
    while (extend<TransportMode::Importance>(walk, sampler, y)) {
    }
}
/// By start_eye_path_of_pixel().
inline void trace_eye_path(const WalkContext& walk, const Film& film, uint64_t pixel,
                           Sampler& sampler, SubPath& z) {
    start_eye_path_of_pixel(walk, film, pixel, sampler, z);
    while (extend<TransportMode::Radiance>(walk, sampler, z)) {
    }
}

}  // namespace etendue
