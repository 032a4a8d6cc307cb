#pragma once
// Makes a full path from what is kept of another one, and vertices sampled from either end of the gap.

#include "mcmc/path_state.h"
#include "mcmc/user_paths.h"

namespace etendue {

class PathBuilder {
public:
    /// Keeps x_0 … x_l and x_m … x_k; nothing on the light's side where l = -1, on the eye's where m = k+1. `x` may be
    /// nullptr, and nothing is kept.
    PathBuilder(const PathMeasure& measure, Sampler& sampler, Workspace& work, const PathState* x,
                int l, int m);

    /// Samples vertices from x_l on, or from an emitter on; a single one there is a next event. If nothing is kept of the
    /// eye's side, and nothing is sampled from there, the last one is where a ray crosses the lens.
    bool sample_light(int count, bool ends_at_lens = false);
    /// The same from x_m, or the lens. Without any from the light's side the last one has to lie on an emitter.
    bool sample_eye(int count);

    /// The eye sub-path from the kept lens through a film point, up to its first surface.
    bool start_eye(Vec2 film);
    /// The same from a lens point sampled for a film point anywhere.
    bool start_eye_anywhere();
    /// The light sub-path from the kept x_0, or a new one, up to its first surface.
    bool start_light(const Emitter& emitter, const EmissionSample& e);
    /// The light sub-path close to one of the user's.
    bool follow(const UserPaths& paths);
    /// One more vertex where the last one has delta events alone.
    bool sample_eye_delta();
    /// One more vertex by a given event.
    bool step_light(const BsdfSample& s);
    bool step_eye(const BsdfSample& s);
    /// The last vertices so far.
    const Vertex& light_end() const { return work_.y[work_.y.size() - 1]; }
    const Vertex& eye_end() const { return work_.z[work_.z.size() - 1]; }

    /// Joins both sides, with a shadow ray where no ray has found the edge. False where the path brings nothing, or has
    /// not one of the lengths that states have. The target is not yet known.
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
