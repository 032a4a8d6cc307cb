#pragma once
// Some walks before the first pass, which tell how dense its light vertices will be.

#include "integrator/bidirectional.h"
#include "reuse/point_grid.h"

namespace etendue {

/// Result of run_pair_pilot().
struct PairPilot {
    CellCounts vertices;  ///< Connectible vertices of the light walks.
    double multiple;      ///< Number of light paths in a pass, divided by that of these walks.
    /// Mean numbers of gathers of an eye path in a pass, by Vertex::is_fixed_by_film, divided by the square of their radius.
    std::array<double, 2> pairs_per_radius2;
};

/// Walks like those of the pass, with its counts, but with random numbers that no pass uses: a quarter of its light paths
/// (between 2^10 and 2^17), and as many eye paths. Without the result, pairs would have almost no weight in the first pass.
PairPilot run_pair_pilot(const PassContext& pass, const Bidirectional& paths,
                         const TechniqueCounts& counts);

}  // namespace etendue
