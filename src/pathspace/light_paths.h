#pragma once
// The light sub-paths of a pass, kept for merges, gathers and connections from any eye path.

#include <span>
#include <vector>

#include "pathspace/photon.h"
#include "pathspace/vertex.h"

namespace etendue {

/// y_i, i ≥ 1, in one cache line. Direction and geometry follow from its place and its predecessor's.
struct LightVertex {
    Vec3 p;
    Rgb beta;
    SurfaceLocation location;
    float pdf_fwd, to_predecessor, weight_sum;  ///< As in Vertex.
    uint32_t path : 30, is_delta : 1, may_connect : 1;
    MediumId medium;
    uint16_t survival_steps : 10, gloss : 6;
};
static_assert(sizeof(LightVertex) == 64);

/// What else there is of y_i, as in Vertex.
struct LightVertexPlace {
    ArrivalSide side;
    uint8_t pair_level;
};

class LightPaths {
public:
    /// What one chunk of a pass's paths leaves; filled by one thread.
    class Chunk {
    public:
        void clear();
        void add(const SubPath& y);

    private:
        friend class LightPaths;
        /// y_0 and the range of the others.
        struct Head {
            const Emitter* emitter = nullptr;  ///< nullptr: the path has no vertex at all.
            Vec3 p, ng;
            Vec2 uv, u_emission;
            uint32_t prim = 0;
            float pdf_fwd = 0, next_event_ratio = 1;
            Rgb beta;
            uint32_t begin = 0, end = 0;
        };
        std::vector<Head> heads_;
        std::vector<LightVertex> vertices_;
        std::vector<LightVertexPlace> places_;
    };

    /// Takes the chunks' paths in order, whichever threads made them.
    void assemble(std::span<const Chunk> chunks);

    std::span<const LightVertex> vertices() const { return vertices_; }
    ArrivalSide arrival_side(uint32_t vertex) const { return places_[vertex].side; }
    size_t size() const { return heads_.size(); }
    size_t memory_bytes() const;

    /// The whole path `index` as it was walked.
    void restore(const Scene& scene, uint64_t index, SubPath& y) const;
    /// Hints that `vertex` will be read soon; then, that its path will be.
    void prefetch(uint32_t vertex) const { __builtin_prefetch(&vertices_[vertex]); }
    void prefetch_head(uint32_t vertex) const {
        __builtin_prefetch(&heads_[vertices_[vertex].path]);
    }

    /// i of the vertex y_i.
    int depth(uint32_t vertex) const {
        return int(vertex - heads_[vertices_[vertex].path].begin) + 1;
    }
    /// The gloss of y_{i-1}, or of its event, for the vertex y_i.
    uint8_t gloss_before(uint32_t vertex) const;
    /// The first `size` vertices of the path that `vertex` is on; of them only what joins with the last one read: y_0
    /// and the last three; all of them, without the earlier BSDFs, if `whole`.
    void restore_first(const Scene& scene, uint32_t vertex, int size, bool whole, SubPath& y) const;

    /// What arrives at `vertex`.
    Photon photon(uint32_t vertex) const;
    /// Whether all scattering before `vertex` was by delta events.
    bool came_by_delta_events(uint32_t vertex) const;

private:
    void restore_head(uint64_t index, SubPath& y) const;
    void restore_vertex(const Scene& scene, uint32_t vertex, bool bsdf, SubPath& y, int i) const;

    std::vector<Chunk::Head> heads_;
    std::vector<LightVertex> vertices_;
    std::vector<LightVertexPlace> places_;
};

}  // namespace etendue
