#pragma once
// Makes a full path from the parts of another path that are kept, and new vertices from either end of the gap.

#include "mcmc/path_state.h"
#include "mcmc/user_paths.h"
#include "pathspace/join.h"

namespace etendue {

/// Where the first vertex of a path comes from.
enum class LightEnd : uint8_t {
    Kept,
    Sampled,    ///< By emission.
    NextEvent,  ///< As seen from x_1; there is no other new vertex on the light's side.
    Hit         ///< The last vertex of the eye sub-path lies on an emitter.
};

/// Where the last vertex of a path comes from.
enum class EyeEnd : uint8_t {
    Kept,
    Sampled,    ///< With a film point.
    Connected,  ///< As seen from x_{k-1}; there is no other new vertex on the eye's side.
    Hit         ///< The last ray of the light sub-path hits the lens.
};

class PathBuilder {
public:
    /// Keeps x_0 … x_l and x_m … x_k. With l = -1 nothing is kept on the light's side, with m = k+1 nothing on the eye's
    /// side. If `x` is nullptr, nothing is kept.
    PathBuilder(const PathMeasure& measure, Sampler& sampler, Workspace& work, const PathState* x,
                int l, int m);

    /// Samples vertices from x_l or from an emitter, and from x_m or from the lens. A side without a kept vertex gets its
    /// end by a hit if it samples no vertex, and as seen from the other side if it samples one. False if a walk ends early.
    bool sample(int from_light, int from_eye);
    /// The same for the eye's side alone, where it keeps no vertex; `count` is at least 1.
    bool sample_eye_path(int count);

    /// Takes the sub-paths that `work` now has, and their join, as a sample of bidirectional path tracing with the same random
    /// numbers made it. `flight` is that of the light sub-path when it was joined.
    void take(const Join& join, const Flight& flight);

    /// Starts the eye sub-path at the kept lens point, through a film point in pixels, and walks to its first surface.
    bool start_eye(Vec2 film);
    /// The same with a film point anywhere and a new lens point.
    bool start_eye_anywhere();
    /// Starts the light sub-path at the kept x_0 or at a new one, and walks to its first surface.
    bool start_light(const Emitter& emitter, const EmissionSample& e);
    /// Makes a light sub-path close to one of the user paths.
    bool follow(const UserPaths& paths);
    /// Appends a vertex by a sampled event.
    bool sample_light_step();
    bool sample_eye_step();
    /// Appends a vertex by a given event.
    bool step_light(const BsdfSample& s);
    bool step_eye(const BsdfSample& s);
    /// Appends a delta event of a chain that ends at x_l, whose last edge no ray has tested. The chain follows the last vertex
    /// that was walked to.
    void append_chain_vertex(const Vertex& v);
    /// The vertices so far of the side of the light, and the last ones of both sides.
    int light_vertices() const { return work_.y.size(); }
    const Vertex& light_end() const { return work_.y[work_.y.size() - 1]; }
    const Vertex& eye_end() const { return work_.z[work_.z.size() - 1]; }

    /// Joins both sides, with a shadow ray if no ray has tested this edge. False if the path contributes nothing, or if its
    /// length is not one of those of states. The target is not computed yet.
    bool finish(PathState& y);

private:
    bool sample_light(int count);
    bool sample_eye(int count);
    template <TransportMode mode>
    bool step(const BsdfSample& s);
    template <TransportMode mode>
    bool sample_step();
    bool keeps_light() const { return l_ >= 0; }
    bool keeps_eye() const { return x_ && m_ <= x_->last(); }
    bool append_emitter_point(const Vertex& from, PathState& y);
    bool append_lens(const Vertex& from, PathState& y);
    bool append_lens_hit(PathState& y);
    bool append_hit_emitter(const Vertex& hit, PathState& y);

    const PathMeasure& measure_;
    Sampler& sampler_;
    Workspace& work_;
    const PathState* x_;
    int l_, m_;
    LightEnd light_end_;
    EyeEnd eye_end_;
    int new_light_ = 0, new_eye_ = 0;  ///< Vertices sampled so far.
    bool is_joined_by_chain_ =
        false;  ///< Whether the last eye vertex leads to x_l by a delta event.
    WalkContext walk_;
    Vec2 film_{};
    /// Vertices of Stream::Connection: the numbers for an emitter or a point on it, and for a lens point.
    uint64_t emitter_numbers_ = 0, lens_numbers_ = 1;
    /// That of a sample that is taken, which may have selected it otherwise than paths do; for an eye path that left the scene,
    /// or a next event.
    const Emitter* emitter_ = nullptr;
};

}  // namespace etendue
