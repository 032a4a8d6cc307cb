#pragma once
// Reference definitions: contribution, densities and MIS weight of a full path, computed from its vertices only. Joins
// and mis.h compute the same values incrementally; tests compare the two.

#include <span>
#include <vector>

#include "pathspace/join.h"
#include "pathspace/technique.h"
#include "pathspace/vertex.h"

namespace etendue {

/// Densities of every vertex of a full path x_0 (emitter) … x_k (lens), from either side, in the conventions of Vertex.
struct PathPdfs {
    std::vector<double> light, eye;
    std::vector<bool> is_delta;          ///< Whether the path scatters by a delta event.
    std::vector<uint8_t> gloss;          ///< See gloss.h.
    std::vector<uint8_t> pair_level;     ///< See Vertex.
    std::vector<bool> is_fixed_by_film;  ///< See Vertex.
    double next_event = 0;               ///< p_NE(x_0), sampled from x_1.
    /// Of the specular connection that can make the path, p̂ over the density of the hit; 0 where there is none. The
    /// caller sets it, since it depends on more than the vertices. It shares the path with hits alone: the weights of
    /// all others have the factor 1 - w of the hit.
    double specular_ratio = 0;
    /// Weight of the specular connection against the hit.
    double specular_weight() const {
        return can_hit_emitter ? sqr(specular_ratio) / (1 + sqr(specular_ratio))
                               : double(specular_ratio > 0);
    }
    bool can_hit_emitter = true;
    bool can_connect_ends =
        true;  ///< False where both ends are at infinity, or x_0 is of a delta emitter.

    int vertices() const { return int(light.size()); }
    /// Density with which the technique samples the path; 0 where it cannot.
    double density(const Technique& technique) const;
    /// Sample count times density, n·p, of the technique.
    double sampled(const Technique& technique, const TechniqueCounts& counts) const;
};

/// Power heuristic with β = 2 by the explicit sum over all techniques.
double mis_weight(const PathPdfs& pdfs, const Technique& technique, const TechniqueCounts& counts);

/// The vertices x_0 … x_k of the path that joins s light and t eye vertices. End points sampled by the technique itself
/// (next event, splat) are given as `emitter_point` or `lens_point`.
std::vector<const Vertex*> path_vertices(const SubPath& y, int s, const SubPath& z, int t,
                                         const Vertex* emitter_point = nullptr,
                                         const Vertex* lens_point = nullptr);

/// x_0 of a next event; `next` is x_1.
Vertex emitter_end(const Join& join, const Vertex& next);
/// x_k of a splat.
Vertex lens_end(const Scene& scene, const Join& join);

/// Measurement contribution f(x̄), without visibility and attenuation, and the densities. Events at the vertices of
/// `delta` (one flag a vertex) are the delta events Vertex::event; f and all densities leave out the factor δ of the
/// direction toward the eye given that toward the light, which they share. `guide` guides the walks.
struct PathValue {
    Rgb f;
    PathPdfs pdfs;
};
PathValue evaluate_path(const Scene& scene, std::span<const Vertex* const> x,
                        const std::vector<bool>& delta, const Guide* guide = nullptr);

}  // namespace etendue
