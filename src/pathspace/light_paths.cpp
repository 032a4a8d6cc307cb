#include "pathspace/light_paths.h"

#include <algorithm>
#include <stdexcept>

#include <tbb/parallel_for.h>

namespace etendue {

void LightPaths::Chunk::clear() {
    heads_.clear();
    vertices_.clear();
    places_.clear();
}

void LightPaths::Chunk::add(const SubPath& y) {
    Head& head = heads_.emplace_back();
    head.begin = head.end = uint32_t(vertices_.size());
    if (y.size() == 0) return;
    const Vertex& y0 = y[0];
    head.emitter = y0.emitter;
    head.p = y0.p;
    head.ng = y0.ng;
    head.uv = y0.uv;
    head.prim = y0.location.prim;
    head.u_emission = y.u_emission;
    head.pdf_fwd = y0.pdf_fwd;
    head.beta = y0.beta;
    if (y.size() >= 2) head.next_event_ratio = y[1].next_event_ratio;
    for (int i = 1; i < y.size(); ++i) {
        const Vertex& v = y[i];
        vertices_.push_back({.p = v.p,
                             .beta = v.beta,
                             .location = v.location,
                             .pdf_fwd = v.pdf_fwd,
                             .to_predecessor = v.to_predecessor,
                             .weight_sum = float(v.weight_sum),
                             .path = 0,
                             .is_delta = v.is_delta,
                             .may_connect = v.may_connect,
                             .medium = v.medium,
                             .survival_steps = v.survival.steps(),
                             .gloss = v.gloss});
        places_.push_back({v.arrival_side(), v.pair_level});
    }
    head.end = uint32_t(vertices_.size());
}

void LightPaths::assemble(std::span<const Chunk> chunks) {
    struct Begin {
        size_t path, vertex;
    };
    std::vector<Begin> begins;
    size_t paths = 0, total = 0;
    for (const Chunk& c : chunks) {
        begins.push_back({paths, total});
        paths += c.heads_.size(), total += c.vertices_.size();
    }
    if (total >= UINT32_MAX || paths >= size_t(1) << 30)
        throw std::runtime_error("a pass has more light vertices than can be kept; limit "
                                 "max_depth, or render in crops");
    heads_.resize(paths);
    vertices_.resize(total);
    places_.resize(total);
    tbb::parallel_for(size_t(0), chunks.size(), [&](size_t chunk) {
        const Chunk& c = chunks[chunk];
        auto [path, first] = begins[chunk];
        std::copy(c.vertices_.begin(), c.vertices_.end(), vertices_.begin() + ptrdiff_t(first));
        std::copy(c.places_.begin(), c.places_.end(), places_.begin() + ptrdiff_t(first));
        for (Chunk::Head head : c.heads_) {
            head.begin += uint32_t(first), head.end += uint32_t(first);
            for (uint32_t i = head.begin; i < head.end; ++i)
                vertices_[i].path = uint32_t(path) & 0x3fffffffu;
            heads_[path++] = head;
        }
    });
}

size_t LightPaths::memory_bytes() const {
    return heads_.capacity() * sizeof(Chunk::Head) + vertices_.capacity() * sizeof(LightVertex) +
           places_.capacity() * sizeof(LightVertexPlace);
}

void LightPaths::restore_head(uint64_t index, SubPath& y) const {
    const Chunk::Head& head = heads_[index];
    y.u_emission = head.u_emission;
    Vertex& y0 = y.append();
    y0.kind = Vertex::Kind::Emitter;
    y0.emitter = head.emitter;
    y0.is_infinite = head.emitter->is_infinite();
    y0.has_cosine = head.emitter->is_area();
    y0.p = head.p;
    y0.ng = head.ng;
    y0.uv = head.uv;
    y0.location.prim = head.prim;
    y0.may_connect = true;
    y0.gloss = gloss_of_emitter(head.emitter->is_area());
    y0.pdf_fwd = head.pdf_fwd;
    y0.beta = head.beta;
}

void LightPaths::restore_vertex(const Scene& scene, uint32_t vertex, bool bsdf, SubPath& y,
                                int i) const {
    const LightVertex& stored = vertices_[vertex];
    Vertex& v = y[i];
    if (bsdf) {
        const Vertex& previous = y[i - 1];
        const Vec3 wo = previous.is_infinite ? previous.p : normalize(previous.p - stored.p);
        v.set_surface(scene.shape(stored.location.shape), stored.location,
                      scene.surface(stored.location), wo, y.arena);
    } else {
        v.kind = Vertex::Kind::Surface;
        v.p = stored.p;
        v.may_connect = stored.may_connect;
        v.gloss = stored.gloss;
    }
    v.medium = stored.medium;
    v.beta = stored.beta;
    v.pdf_fwd = stored.pdf_fwd;
    v.to_predecessor = stored.to_predecessor;
    v.weight_sum = double(stored.weight_sum);
    v.is_delta = stored.is_delta;
    v.pair_level = places_[vertex].pair_level;
    v.survival = Survival::from_steps(stored.survival_steps);
    if (i == 1) v.next_event_ratio = heads_[stored.path].next_event_ratio;
}

void LightPaths::restore(const Scene& scene, uint64_t index, SubPath& y) const {
    y.clear();
    const Chunk::Head& head = heads_[index];
    if (!head.emitter) return;
    restore_head(index, y);
    for (uint32_t vertex = head.begin; vertex < head.end; ++vertex) {
        y.append();
        restore_vertex(scene, vertex, true, y, y.size() - 1);
    }
}

uint8_t LightPaths::gloss_before(uint32_t vertex) const {
    const Chunk::Head& head = heads_[vertices_[vertex].path];
    if (vertex == head.begin) return gloss_of_emitter(head.emitter->is_area());
    const LightVertex& previous = vertices_[vertex - 1];
    return previous.is_delta ? kDeltaGloss : uint8_t(previous.gloss);
}

void LightPaths::restore_first(const Scene& scene, uint32_t vertex, int size, bool whole,
                               SubPath& y) const {
    const uint64_t path = vertices_[vertex].path;
    const uint32_t begin = heads_[path].begin;
    y.clear();
    restore_head(path, y);
    for (int i = 1; i < size; ++i) {
        y.append();
        // A BSDF looks toward its predecessor, whose place must be known.
        if (whole || i >= size - 3)
            restore_vertex(scene, begin + uint32_t(i) - 1, i == size - 1, y, i);
    }
}

Photon LightPaths::photon(uint32_t vertex) const {
    const LightVertex& v = vertices_[vertex];
    const Chunk::Head& head = heads_[v.path];
    const bool follows_y0 = vertex == head.begin;
    const Vec3 wi = follows_y0 && head.emitter->is_infinite()
                        ? head.p
                        : normalize((follows_y0 ? head.p : vertices_[vertex - 1].p) - v.p);
    return {v.p, wi, v.beta, head.emitter, int(vertex - head.begin) + 2};
}

bool LightPaths::came_by_delta_events(uint32_t vertex) const {
    const uint32_t begin = heads_[vertices_[vertex].path].begin;
    while (vertex > begin)
        if (!vertices_[--vertex].is_delta) return false;
    return true;
}

}  // namespace etendue
