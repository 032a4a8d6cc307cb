#pragma once
// Classes of paths: what decides which techniques can make a path. Two methods, or a technique and a method, can only be
// compared on paths that both can make.

#include <compare>
#include <string>
#include <vector>

#include "pathspace/join.h"

namespace etendue {

struct PathClass {
    static constexpr int kMostEdges = 24;

    uint8_t edges = 0;
    bool has_short_edge = false;  ///< Some edge is shorter than the cut-off.
    bool delta_emitter = false;   ///< x_0 has no extent.
    bool infinite_ends = false;   ///< Emitter and lens are both at infinity.
    uint32_t delta_events = 0;    ///< Bit i: x_i scatters by a delta event.

    friend auto operator<=>(const PathClass&, const PathClass&) = default;
    /// The same whether or not it has a short edge.
    PathClass without_length_of_edges() const {
        PathClass c = *this;
        c.has_short_edge = false;
        return c;
    }
    /// All of it, in 32 bits.
    uint32_t key() const {
        return delta_events | uint32_t(edges) << kMostEdges | uint32_t(has_short_edge) << 29 |
               uint32_t(delta_emitter) << 30 | uint32_t(infinite_ends) << 31;
    }
    static PathClass from_key(uint32_t key) {
        return {.edges = uint8_t(key >> kMostEdges & 31),
                .has_short_edge = (key >> 29 & 1) != 0,
                .delta_emitter = (key >> 30 & 1) != 0,
                .infinite_ends = (key >> 31 & 1) != 0,
                .delta_events = key & ((1u << kMostEdges) - 1)};
    }
};

/// In Heckbert's notation: L for the emitter, L* for one without extent, D or S for smooth and delta events, E for the
/// lens.
std::string to_string(const PathClass& c);

/// The class of the path that `join` makes of y and z; at most kMostEdges edges.
PathClass classify(const Scene& scene, const Join& join, const SubPath& y, const SubPath& z,
                   float cut_off);
/// Length of the path's shortest edge; those to infinity are not counted.
float shortest_edge(const Scene& scene, const Join& join, const SubPath& y, const SubPath& z);

/// All techniques that make paths of that many edges.
std::vector<Technique> techniques_of_length(int edges);
bool can_make(const Technique& technique, const PathClass& c);
/// How often `technique` makes each path of the class that it can make: a gather whose pairs drop both vertices, for a
/// path each, mostly does twice.
int times_made(const Technique& technique, const PathClass& c, PairRule rule);
/// Whether some technique with a count can.
bool can_make(const TechniqueCounts& counts, const PathClass& c);

}  // namespace etendue
