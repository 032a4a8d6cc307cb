#pragma once
// Sub-paths, their vertices and their joins, as objects of Python.

#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "bindings.h"

namespace etendue::python {

constexpr int kNoRoulette = 1 << 20;
/// Longer walks end. No path of a scene needs more, and a closed room of mirrors would never end.
constexpr int kMostVertices = 1024;

/// A sub-path with what it needs. Those of an integrator's sample are only valid during that sample.
struct Path {
    Path(ScenePtr s, const TechniqueCounts& c) : scene(std::move(s)), counts(c), own(), at(&own) {}
    Path(SubPath& sub_path, const TechniqueCounts& c) : counts(c), own(), at(&sub_path) {}

    const SubPath& sub_path() const {
        if (!at)
            throw std::runtime_error("this sub-path belonged to a sample that has ended; use its "
                                     "arrays within sample()");
        return *at;
    }

    ScenePtr scene;  ///< Kept alive; empty within samples.
    TechniqueCounts counts;
    SubPath own;
    SubPath* at;
};
using PathPtr = std::shared_ptr<Path>;

/// A vertex of a sub-path, which it keeps alive, or one of its own.
struct VertexHandle {
    PathPtr path;
    int index = 0;
    std::shared_ptr<Vertex> own;
    std::shared_ptr<ComponentArena> arena;  ///< Of the BSDF of `own`.
    ScenePtr scene;

    const Vertex& vertex() const {
        if (own) return *own;
        const SubPath& p = path->sub_path();
        if (index >= p.size()) throw std::runtime_error("the sub-path has been replaced");
        return p[index];
    }
};

/// A join with the sub-paths it was made of, and its contribution after the shadow ray.
struct JoinHandle {
    Join join;
    Rgb contribution;
    PathPtr y, z;
    ScenePtr scene;
};

WalkOptions walk_options(std::optional<int> max_vertices, std::optional<int> rr_depth);

/// Whether the joins of s and t vertices are made of a light sub-path, and of an eye sub-path beyond the lens.
inline bool uses_light_path(int s, int t) {
    return s >= 2 || (s == 1 && t == 1);
}
inline bool uses_eye_path(int t) {
    return t >= 2;
}

/// All joins of y_{s-1} and z_{t-1} with a contribution, after their shadow rays.
std::vector<JoinHandle> joins(const ScenePtr& kept, const PathPtr& y, int s, const PathPtr& z,
                              int t, Sampler& sampler, const TechniqueCounts& counts,
                              RenderStats& stats);

}  // namespace etendue::python
