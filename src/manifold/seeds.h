#pragma once
// Seeds of Newton's method: chains of delta events that walks from an eye vertex meet.

#include "manifold/chain.h"
#include "sampler/sampler.h"

namespace etendue {

struct ChainSeed {
    Vec3d w;  ///< Direction at the eye vertex.
    ChainEvents events;
};

/// Draws seeds for chains between an eye vertex and a point on a lamp.
class ChainSeeds {
public:
    /// `depth`: most events of a chain, at most ChainEvents::kMost.
    ChainSeeds(const Vertex& from, const LampPoint& lamp, int depth, ChainTracer& tracer,
               RenderStats& stats)
        : from_(from), lamp_(lamp), depth_(depth), tracer_(tracer), stats_(stats) {}

    /// A walk leaves the eye vertex in a direction of its own BSDF, without guide, and goes on by delta events. Of the
    /// chains that lead from the eye vertex to a surface on this walk, one is chosen uniformly from those whose last
    /// surface the lamp's point lights on the right side. Near a solution, all that is asked of a seed is true. Empty where there is none,
    /// or where the seed is known to have other events than `only`.
    std::optional<ChainSeed> draw(Sampler& sampler, const ChainEvents* only = nullptr);

private:
    /// Whether the lamp lights the surface that the tracer has left, on the side to which the ray went.
    bool may_end_here() const;

    const Vertex& from_;
    const LampPoint& lamp_;
    int depth_;
    ChainTracer& tracer_;
    RenderStats& stats_;
};

}  // namespace etendue
