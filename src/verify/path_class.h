#pragma once
// Classes of paths: the properties that determine which techniques can make a path. Methods and techniques can be
// compared only on paths that both can make.

#include <compare>
#include <string>
#include <vector>

#include "pathspace/join.h"

namespace etendue {

struct PathClass {
    static constexpr int kMostEdges = 24;

    uint8_t edges = 0;
    bool has_short_edge = false;  ///< Whether any edge is shorter than the cut-off.
    bool delta_emitter = false;   ///< Whether the emitter is delta.
    bool infinite_ends = false;   ///< Whether emitter and lens are both at infinity.
    uint32_t delta_events = 0;    ///< Bit i is set where the path scatters by a delta event at x_i.

    friend auto operator<=>(const PathClass&, const PathClass&) = default;
    /// The class without the distinction of short edges.
    PathClass without_length_of_edges() const {
        PathClass c = *this;
        c.has_short_edge = false;
        return c;
    }
    /// The class encoded in 32 bits.
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

/// Heckbert's notation: L for the emitter, L* for a delta emitter, D for smooth and S for delta events, E for the lens.
std::string to_string(const PathClass& c);

/// The class of the path that `join` makes of y and z, which has at most kMostEdges edges.
PathClass classify(const Scene& scene, const Join& join, const SubPath& y, const SubPath& z,
                   float cut_off);
/// Length of the path's shortest edge; edges to infinity are ignored.
float shortest_edge(const Scene& scene, const Join& join, const SubPath& y, const SubPath& z);

/// All techniques that make paths of `edges` edges.
std::vector<Technique> techniques_of_length(int edges);
/// Whether the technique can make paths of the class.
bool can_make(const Technique& technique, const PathClass& c);
/// Number of times that `technique` makes each path of a class that it can make: 2 for gathers under PairRule::Both
/// where either vertex can be dropped, otherwise 1.
int times_made(const Technique& technique, const PathClass& c, PairRule rule);
/// The same where the technique is one of a method with these counts, which may leave classes to other techniques.
bool can_make(const TechniqueCounts& counts, const Technique& technique, const PathClass& c);
/// Whether a specular connection of the method makes paths of the class.
bool makes_by_specular(const TechniqueCounts& counts, const PathClass& c);
/// Whether any technique with a positive count can make paths of the class.
bool can_make(const TechniqueCounts& counts, const PathClass& c);

}  // namespace etendue
