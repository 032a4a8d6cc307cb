#include "reuse/light_vertex_cache.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "film/parallel_for.h"
#include "guide/guide.h"

namespace etendue {

void LightVertexCache::begin(uint64_t chunks, uint64_t vertex_bytes, uint64_t max_bytes,
                             const Guide* guide) {
    is_guided_ = guide && guide->guides_surfaces();
    vertex_bytes_ = vertex_bytes + (is_guided_ ? kGuideBytes : 0);
    max_bytes_ = max_bytes;
    taken_bytes_ = 0;
    chunks_.resize(chunks);
    for (Chunk& c : chunks_) {
        c.heads.clear();
        c.vertices.clear();
        c.places.clear();
        c.guides.clear();
    }
}

void LightVertexCache::add(uint64_t chunk, const SubPath& y) {
    Chunk& c = chunks_[chunk];
    Head& head = c.heads.emplace_back();
    head.begin = head.end = uint32_t(c.vertices.size());
    if (y.size() == 0) return;
    const uint64_t bytes = uint64_t(y.size()) * vertex_bytes_;
    if (taken_bytes_.fetch_add(bytes, std::memory_order_relaxed) + bytes > max_bytes_)
        throw std::runtime_error(
            fmt::format("the light vertices of a pass need more than {} MiB; limit max_depth, or, "
                        "where the integrator has these parameters, give fewer light_paths or "
                        "more memory",
                        max_bytes_ >> 20));
    const Vertex& y0 = y[0];
    head.emitter = y0.emitter;
    head.guide = y0.guide;
    head.p = y0.p;
    head.ng = y0.ng;
    head.uv = y0.uv;
    head.prim = y0.location.prim;
    head.pdf_fwd = y0.pdf_fwd;
    head.beta = y0.beta;
    if (y.size() >= 2) head.next_event_ratio = y[1].next_event_ratio;
    for (int i = 1; i < y.size(); ++i) {
        const Vertex& v = y[i];
        c.vertices.push_back({.p = v.p,
                              .beta = v.beta,
                              .location = v.location,
                              .pdf_fwd = v.pdf_fwd,
                              .to_predecessor = v.to_predecessor,
                              .root_of_weight_sum = float(std::sqrt(v.weight_sum)),
                              .path = 0,
                              .is_delta = v.is_delta,
                              .is_connectible = v.is_connectible,
                              .medium = v.medium,
                              .survival_steps = v.survival.steps(),
                              .gloss = v.gloss});
        c.places.push_back({etendue::arrival_side(v), v.pair_level});
        if (is_guided_) c.guides.push_back({v.guide, v.guide_rev});
    }
    head.end = uint32_t(c.vertices.size());
}

void LightVertexCache::assemble() {
    struct Begin {
        size_t path, vertex;
    };
    std::vector<Begin> begins;
    size_t paths = 0, total = 0;
    for (const Chunk& c : chunks_) {
        begins.push_back({paths, total});
        paths += c.heads.size(), total += c.vertices.size();
    }
    if (total >= UINT32_MAX || paths >= size_t(1) << 30)
        throw std::runtime_error("a pass has more light vertices than can be numbered; limit "
                                 "max_depth, or give fewer light_paths where the integrator has "
                                 "this parameter");
    heads_.resize(paths);
    vertices_.resize(total);
    places_.resize(total);
    guides_.resize(is_guided_ ? total : 0);
    parallel_for(chunks_.size(), [&](size_t chunk) {
        const Chunk& c = chunks_[chunk];
        auto [path, first] = begins[chunk];
        std::copy(c.vertices.begin(), c.vertices.end(), vertices_.begin() + ptrdiff_t(first));
        std::copy(c.places.begin(), c.places.end(), places_.begin() + ptrdiff_t(first));
        if (is_guided_)
            std::copy(c.guides.begin(), c.guides.end(), guides_.begin() + ptrdiff_t(first));
        for (Head head : c.heads) {
            head.begin += uint32_t(first), head.end += uint32_t(first);
            for (uint32_t i = head.begin; i < head.end; ++i)
                vertices_[i].path = uint32_t(path) & 0x3fffffffu;
            heads_[path++] = head;
        }
    });
}

size_t LightVertexCache::memory_bytes() const {
    return heads_.capacity() * sizeof(Head) + vertices_.capacity() * sizeof(LightVertex) +
           places_.capacity() * sizeof(LightVertexPlace) +
           guides_.capacity() * sizeof(LightVertexGuide);
}

void LightVertexCache::restore_head(const Scene& scene, uint64_t index, SubPath& y) const {
    const Head& head = heads_[index];
    Vertex& y0 = y.append();
    y0.kind = Vertex::Kind::Emitter;
    y0.emitter = head.emitter;
    y0.is_infinite = head.emitter->is_infinite();
    y0.has_cosine = head.emitter->is_area();
    y0.p = head.p;
    y0.ng = head.ng;
    y0.uv = head.uv;
    y0.location.prim = head.prim;
    y0.is_connectible = true;
    y0.medium = y0.is_infinite ? kVacuum : scene.medium_at(*head.emitter, y0.ray_end());
    y0.gloss = gloss_of_emitter(head.emitter->is_area());
    y0.pdf_fwd = head.pdf_fwd;
    y0.beta = head.beta;
    y0.guide = head.guide;
}

namespace {

/// From a vertex toward its predecessor.
Vec3 arrival_direction(const LightVertex& v, const Vertex& predecessor) {
    return predecessor.is_infinite ? predecessor.p : normalize(predecessor.p - v.p);
}

}  // namespace

void LightVertexCache::restore_vertex(const Scene& scene, uint32_t vertex, bool bsdf, SubPath& y,
                                      int i) const {
    const LightVertex& stored = vertices_[vertex];
    Vertex& v = y[i];
    if (bsdf) {
        v.set_surface(scene.shape(stored.location.shape), stored.location,
                      scene.surface(stored.location), arrival_direction(stored, y[i - 1]), y.arena);
    } else {
        v.kind = Vertex::Kind::Surface;
        v.p = stored.p;
        v.is_connectible = stored.is_connectible;
        v.gloss = stored.gloss;
    }
    v.medium = stored.medium;
    v.beta = stored.beta;
    v.pdf_fwd = stored.pdf_fwd;
    v.to_predecessor = stored.to_predecessor;
    v.weight_sum = sqr(double(stored.root_of_weight_sum));
    v.is_delta = stored.is_delta;
    v.pair_level = places_[vertex].pair_level;
    if (is_guided_) {
        v.guide = guides_[vertex].cell;
        v.guide_rev = guides_[vertex].rev;
    }
    v.survival = Survival::from_steps(stored.survival_steps);
    if (i == 1) v.next_event_ratio = heads_[stored.path].next_event_ratio;
}

void LightVertexCache::restore(const Scene& scene, uint64_t index, SubPath& y) const {
    y.clear();
    const Head& head = heads_[index];
    if (!head.emitter) return;
    restore_head(scene, index, y);
    for (uint32_t vertex = head.begin; vertex < head.end; ++vertex) {
        y.append();
        restore_vertex(scene, vertex, true, y, y.size() - 1);
    }
}

uint8_t LightVertexCache::gloss_before(uint32_t vertex) const {
    const Head& head = heads_[vertices_[vertex].path];
    if (vertex == head.begin) return gloss_of_emitter(head.emitter->is_area());
    const LightVertex& previous = vertices_[vertex - 1];
    return previous.is_delta ? kDeltaGloss : uint8_t(previous.gloss);
}

void LightVertexCache::restore_first(const Scene& scene, uint32_t vertex, int size, bool whole,
                                     SubPath& y, bool with_bsdf) const {
    const uint64_t path = vertices_[vertex].path;
    const uint32_t begin = heads_[path].begin;
    const int last = size - 1;
    y.clear();
    restore_head(scene, path, y);
    for (int i = 1; i < size; ++i) {
        y.append();
        // The direction at a vertex needs the position of its predecessor.
        if (whole || i >= last - 2)
            restore_vertex(scene, begin + uint32_t(i) - 1, i == last && with_bsdf, y, i);
    }
    if (!with_bsdf && last >= 1) y[last].wo = arrival_direction(vertices_[vertex], y[last - 1]);
}

Photon LightVertexCache::photon(uint32_t vertex) const {
    const LightVertex& v = vertices_[vertex];
    const Head& head = heads_[v.path];
    const bool follows_y0 = vertex == head.begin;
    const Vec3 wi = follows_y0 && head.emitter->is_infinite()
                        ? head.p
                        : normalize((follows_y0 ? head.p : vertices_[vertex - 1].p) - v.p);
    return {v.p, wi, v.beta, head.emitter, int(vertex - head.begin) + 2};
}

bool LightVertexCache::came_by_delta_events(uint32_t vertex) const {
    const uint32_t begin = heads_[vertices_[vertex].path].begin;
    while (vertex > begin)
        if (!vertices_[--vertex].is_delta) return false;
    return true;
}

}  // namespace etendue
