#pragma once
// Seeds of Newton's method: chains of delta events that random walks from an eye vertex meet.

#include <vector>

#include "manifold/chain.h"
#include "manifold/seed_photons.h"
#include "sampler/sampler.h"

namespace etendue {

struct ChainSeed {
    Vec3d w;  ///< Direction at the eye vertex.
    ChainEvents events;
    ChainRay ray;  ///< Behind the events.
    /// What the path would contribute per unit of throughput at the eye vertex if the lamp's point lay in the direction of the
    /// ray, and surfaces did not focus: a guess.
    Rgb guess;
};

/// Draws seeds for chains between an eye vertex and a point on a lamp.
class ChainSeeds {
public:
    /// `depth`: most events of a chain, at most ChainEvents::kMost. What is referred to must outlive this.
    ChainSeeds(const Scene& scene, const Vertex& from, const LampPoint& lamp, int depth,
               const SeedPhotons& photons, ChainTracer& tracer, RenderStats& stats);

    /// A walk leaves the eye vertex and goes on by delta events: toward where a photon near it had its last event, toward a
    /// random point of a shape that has delta events alone, or in a direction of its own BSDF, without guide. Of the chains
    /// that lead from the eye vertex to a surface on this walk, one is chosen uniformly among those from whose last surface the
    /// ray leaves on the side of the lamp's point, which that surface sees. Every condition on a seed also holds for the seeds
    /// near a solution, and directions of the BSDF reach all solutions that contribute. So each solution that is not degenerate
    /// has a positive probability. Empty where the walk has no such chain, or the seed is known to have other events than
    /// `only`.
    std::optional<ChainSeed> draw(Sampler& sampler, const ChainEvents* only = nullptr);

private:
    std::optional<Vec3d> first_direction(Sampler& sampler) const;
    std::optional<Vec3d> toward(Vec3 p) const;
    const ClearShape& choose_shape(float u) const;
    /// L_e |cos θ| of the lamp toward the surface that the tracer has left, if the chain may end there.
    Rgb emission_here() const;

    const Scene& scene_;
    const Vertex& from_;
    const LampPoint& lamp_;
    int depth_;
    std::span<const SeedPhoton> photons_;  ///< Near the eye vertex, of the lamp.
    ChainTracer& tracer_;
    RenderStats& stats_;
    /// Partial sums over the clear shapes of what is proportional to the probability of their choice; empty where there are
    /// too many of them.
    std::vector<float> sums_;
};

}  // namespace etendue
