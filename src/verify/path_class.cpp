#include "verify/path_class.h"

#include <algorithm>

namespace etendue {
namespace {

/// Length of the shortest edge between the first `count` vertices of a walk.
float shortest_edge(const SubPath& path, int count) {
    float shortest = kInf;
    for (int i = 1; i < count; ++i)
        if (!path[i - 1].is_infinite && !path[i].is_infinite)
            shortest = std::min(shortest, length2(path[i].p - path[i - 1].p));
    return std::sqrt(shortest);
}

}  // namespace

float shortest_edge(const Scene& scene, const Join& join, const SubPath& y, const SubPath& z) {
    const Technique& q = join.technique;
    // Numbers of vertices taken from the walks: the lens of C(s,0) is not one of them, and a gather drops one.
    int light = q.t == 0 ? q.s - 1 : q.s, eye = q.t;
    if (q.strategy == Strategy::Gather) --(length2(join.a.p - z[eye - 2].p) == 0 ? eye : light);
    float shortest = std::min(shortest_edge(y, light), shortest_edge(z, eye));
    const bool to_lens_at_infinity = q.t <= 1 && scene.sensor().is_orthographic();
    const bool has_edge = q.strategy != Strategy::Hit && q.strategy != Strategy::Merge;
    if (has_edge && !join.to_infinity && !to_lens_at_infinity)
        shortest = std::min(shortest, length(join.b.p - join.a.p));
    return shortest;
}

PathClass classify(const Scene& scene, const Join& join, const SubPath& y, const SubPath& z,
                   float cut_off) {
    const Technique& q = join.technique;
    const int last = q.vertices() - 1;
    PathClass c{.edges = uint8_t(last),
                .has_short_edge = shortest_edge(scene, join, y, z) < cut_off,
                .delta_emitter = join.emitter->is_delta(),
                .infinite_ends = join.emitter->is_infinite() && scene.sensor().is_orthographic()};
    // At the end points of a join the path scatters by a smooth lobe, whatever event the walk sampled there. C(s,0) has
    // no such end point, and the light vertex of X(s,t) is a delta event.
    const int light = q.t == 0 ? last : q.strategy == Strategy::Specular ? q.s : q.s - 1;
    for (int i = 1; i < light; ++i)
        if (y[i].is_delta) c.delta_events |= 1u << i;
    for (int i = 1; i < q.t - 1; ++i)
        if (z[i].is_delta) c.delta_events |= 1u << (last - i);
    return c;
}

std::vector<Technique> techniques_of_length(int edges) {
    std::vector<Technique> out;
    for (int s = 0; s <= edges + 1; ++s) out.push_back(connection_technique(s, edges + 1 - s));
    if (edges >= 2) out.push_back({Strategy::Connect, 1, edges});
    for (const Strategy strategy : {Strategy::Merge, Strategy::Gather})
        for (int s = 2; s <= edges; ++s) out.push_back({strategy, s, edges + 2 - s});
    for (int s = 2; s < edges; ++s) out.push_back({Strategy::Specular, s, edges + 1 - s});
    return out;
}

namespace {

/// Bit i is set where a walk cannot sample another direction at x_i.
uint32_t fixed_vertices(const PathClass& c) {
    return c.delta_events | 1u << c.edges;
}
/// The bit of x_{s-1}, the last light vertex; 0 where s = 0. For merges and gathers it is the vertex that both
/// sub-paths have.
uint32_t last_light_vertex(const Technique& q) {
    return q.s > 0 ? 1u << (q.s - 1) : 0u;
}

}  // namespace

int times_made(const Technique& q, const PathClass& c, PairRule rule) {
    if (q.strategy != Strategy::Gather || rule != PairRule::Both) return 1;
    const uint32_t x_m = last_light_vertex(q), fixed = fixed_vertices(c);
    return !(fixed & x_m << 1) + !(fixed & x_m >> 1);
}

bool can_make(const Technique& q, const PathClass& c) {
    if (q.vertices() != c.edges + 1) return false;
    const uint32_t x_m = last_light_vertex(q), fixed = fixed_vertices(c);
    if (is_pair(q.strategy) && (fixed & x_m)) return false;
    if (q.strategy == Strategy::Merge) return true;
    // A gather samples the vertex again from one of the two sides.
    if (q.strategy == Strategy::Gather) return !((fixed & x_m << 1) && (fixed & x_m >> 1));
    if (q.strategy == Strategy::Hit) return !c.delta_emitter;
    // All of x_1 … x_{s-1} are delta events, and x_s is none.
    if (q.strategy == Strategy::Specular)
        return q.s >= 2 && q.t >= 2 && (c.delta_events & ((x_m << 2) - 1)) == (x_m << 1) - 2;
    if (q.strategy == Strategy::HitLens) return true;
    if (q.s == 1 && q.t == 1) return !c.infinite_ends;
    return (c.delta_events & (x_m | x_m << 1)) == 0;  // x_{s-1} and x_s are connected
}

std::string to_string(const PathClass& c) {
    std::string text = c.delta_emitter ? "L*" : "L";
    for (int i = 1; i < c.edges; ++i) text += c.delta_events >> i & 1 ? 'S' : 'D';
    return text + "E";
}

bool can_make(const TechniqueCounts& counts, const Technique& q, const PathClass& c) {
    if (!(counts.of(q) > 0) || !can_make(q, c)) return false;
    if (q.strategy != Strategy::Specular) return true;
    // It is used where nothing but hits makes the path, as is_left_to_hits().
    if (counts.merge > 0) return false;
    for (int i = q.s; i < c.edges; ++i) {
        const bool is_smooth_pair = (c.delta_events & (3u << i)) == 0;
        if (is_smooth_pair && counts.makes_smooth_pairs(i + 1 == c.edges)) return false;
    }
    return true;
}

bool makes_by_specular(const TechniqueCounts& counts, const PathClass& c) {
    for (int s = 2; s < c.edges; ++s)
        if (can_make(counts, {Strategy::Specular, s, c.edges + 1 - s}, c)) return true;
    return false;
}

bool can_make(const TechniqueCounts& counts, const PathClass& c) {
    for (const Technique& q : techniques_of_length(c.edges))
        if (can_make(counts, q, c)) return true;
    return false;
}

}  // namespace etendue
