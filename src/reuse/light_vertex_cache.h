#pragma once
// The light sub-paths of a pass, stored for merges, gathers and connections with any eye path.

#include <atomic>
#include <span>
#include <vector>

#include "pathspace/photon.h"
#include "reuse/arrival_side.h"

namespace etendue {

/// y_i, i ≥ 1, in one cache line. Direction and geometry are recomputed from its location and its predecessor's
/// position.
struct LightVertex {
    Vec3 p;
    Rgb beta;
    SurfaceLocation location;
    float pdf_fwd, to_predecessor;  ///< As in Vertex.
    float
        root_of_weight_sum;  ///< √Vertex::weight_sum: the sum itself may be too large for a float.
    uint32_t path : 30, is_delta : 1, is_connectible : 1;
    MediumId medium;
    uint16_t survival_steps : 10, gloss : 6;
};
static_assert(sizeof(LightVertex) == 64);

/// The remaining data of y_i, as in Vertex.
struct LightVertexPlace {
    ArrivalSide side;
    uint8_t pair_level;
};

/// The guide of y_i, as in Vertex.
struct LightVertexGuide {
    const GuideCell* cell;
    float rev;
};

class LightVertexCache {
public:
    /// Starts the collection of the light paths of a pass in `chunks` chunks. `vertex_bytes`: memory per vertex, here
    /// and in the data structures of the caller; `max_bytes`: limit of the total; `guide`: of the walks, or nullptr.
    void begin(uint64_t chunks, uint64_t vertex_bytes, uint64_t max_bytes,
               const Guide* guide = nullptr);
    /// Adds the next path of a chunk; each chunk belongs to one thread at a time. Throws std::runtime_error where the
    /// paths exceed `max_bytes`.
    void add(uint64_t chunk, const SubPath& y);
    /// Ends the collection. Paths are in the order of chunks, independent of threads.
    void assemble();

    std::span<const LightVertex> vertices() const { return vertices_; }
    ArrivalSide arrival_side(uint32_t vertex) const { return places_[vertex].side; }
    /// Number of paths.
    size_t size() const { return heads_.size(); }
    size_t memory_bytes() const;

    /// Number of vertices of the path `index`.
    int path_size(uint64_t index) const {
        const Head& head = heads_[index];
        return head.emitter ? int(head.end - head.begin) + 1 : 0;
    }
    /// Restores the whole path `index`.
    void restore(const Scene& scene, uint64_t index, SubPath& y) const;
    /// Prefetches `vertex`, or the head of its path.
    void prefetch(uint32_t vertex) const {
        __builtin_prefetch(&vertices_[vertex]);
        __builtin_prefetch(&places_[vertex]);
        if (is_guided_) __builtin_prefetch(&guides_[vertex]);
    }
    void prefetch_head(uint32_t vertex) const {
        __builtin_prefetch(&heads_[vertices_[vertex].path]);
    }

    /// i of the vertex y_i.
    int depth(uint32_t vertex) const {
        return int(vertex - heads_[vertices_[vertex].path].begin) + 1;
    }
    /// For the vertex y_i: the gloss of y_{i-1}, or kDeltaGloss after a delta event.
    uint8_t gloss_before(uint32_t vertex) const;
    /// Restores the first `size` vertices of the path of `vertex`. Without `whole`, only the vertices needed for joins
    /// with the last one are set: y_0 and the last three. Only the last vertex has a BSDF, and only with `with_bsdf`,
    /// since merges do not read it.
    void restore_first(const Scene& scene, uint32_t vertex, int size, bool whole, SubPath& y,
                       bool with_bsdf = true) const;

    /// The flux that arrives at `vertex`.
    Photon photon(uint32_t vertex) const;
    /// Whether all scattering before `vertex` was by delta events.
    bool came_by_delta_events(uint32_t vertex) const;

    /// Memory per vertex: in a chunk, whose capacity may be twice its size, and in the assembled cache.
    static constexpr uint64_t kVertexBytes = 3 * (sizeof(LightVertex) + sizeof(LightVertexPlace));
    /// The same for the guide of a vertex, where there is one.
    static constexpr uint64_t kGuideBytes = 3 * sizeof(LightVertexGuide);

private:
    /// y_0, and the range of the other vertices.
    struct Head {
        const Emitter* emitter = nullptr;  ///< nullptr for a path without vertices.
        const GuideCell* guide = nullptr;
        Vec3 p, ng;
        Vec2 uv;
        uint32_t prim = 0;
        float pdf_fwd = 0, next_event_ratio = 1;
        Rgb beta;
        uint32_t begin = 0, end = 0;
    };
    /// The paths of one chunk.
    struct Chunk {
        std::vector<Head> heads;
        std::vector<LightVertex> vertices;
        std::vector<LightVertexPlace> places;
        std::vector<LightVertexGuide> guides;  ///< Empty without a guide at surfaces.
    };

    void restore_head(const Scene& scene, uint64_t index, SubPath& y) const;
    void restore_vertex(const Scene& scene, uint32_t vertex, bool bsdf, SubPath& y, int i) const;

    std::vector<Chunk> chunks_;
    uint64_t vertex_bytes_ = 0, max_bytes_ = 0;
    std::atomic<uint64_t> taken_bytes_ = 0;

    std::vector<Head> heads_;
    std::vector<LightVertex> vertices_;
    std::vector<LightVertexPlace> places_;
    std::vector<LightVertexGuide> guides_;  ///< Empty without a guide at surfaces.
    bool is_guided_ = false;
};

}  // namespace etendue
