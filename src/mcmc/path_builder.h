#pragma once
// Makes a full path from the parts of another path that are kept, and new vertices from either end of the gap.

#include "mcmc/path_state.h"
#include "mcmc/user_paths.h"

namespace etendue {

class PathBuilder {
public:
    /// Keeps x_0 … x_l and x_m … x_k. With l = -1 nothing is kept on the light's side, with m = k+1 nothing on the eye's
    /// side. If `x` is nullptr, nothing is kept.
    PathBuilder(const PathMeasure& measure, Sampler& sampler, Workspace& work, const PathState* x,
                int l, int m);

    /// Samples `count` vertices, starting from x_l or from an emitter; a single vertex on an emitter is a next event. If the
    /// eye's side keeps no vertex and samples none (`ends_at_lens`), the last vertex is the point where the ray hits the
    /// lens. False if a walk ends early.
    bool sample_light(int count, bool ends_at_lens = false);
    /// The same from x_m or from the lens. If the light's side has no vertex, the last one must lie on an emitter.
    bool sample_eye(int count);

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
    /// The vertices so far of the side of the light, and the last ones of both sides.
    int light_vertices() const { return work_.y.size(); }
    const Vertex& light_end() const { return work_.y[work_.y.size() - 1]; }
    const Vertex& eye_end() const { return work_.z[work_.z.size() - 1]; }

    /// Joins both sides, with a shadow ray if no ray has tested this edge. False if the path contributes nothing, or if its
    /// length is not one of those of states. The target is not computed yet.
    bool finish(PathState& y);

private:
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
    int new_light_ = 0, new_eye_ = 0;  ///< Vertices sampled so far.
    bool has_next_event_ = false, ends_at_lens_ = false;
    WalkContext walk_;
    Vec2 film_{};
};

}  // namespace etendue
