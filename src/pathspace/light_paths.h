#pragma once
// The light sub-paths of a pass, kept for merges, gathers and connections from any eye path.

#include <span>
#include <vector>

#include "pathspace/vertex.h"

namespace etendue {

/// y_i, i ≥ 1, in one cache line. Direction and geometry follow from its place and its predecessor's.
struct LightVertex {
    Vec3 p;
    Rgb beta;
    SurfaceLocation location;
    float pdf_fwd, to_predecessor, weight_sum;  ///< As in Vertex.
    uint32_t path;
    MediumId medium : 14;
    bool is_delta : 1, may_connect : 1;
    Survival survival;
};
static_assert(sizeof(LightVertex) == 64);

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
    };

    /// Takes the chunks' paths in order, whichever threads made them.
    void assemble(std::span<const Chunk> chunks);

    std::span<const LightVertex> vertices() const { return vertices_; }
    size_t size() const { return heads_.size(); }
    size_t memory_bytes() const;

    /// The whole path `index` as it was walked.
    void restore(const Scene& scene, uint64_t index, SubPath& y) const;
    /// The path up to `vertex`; of its vertices only what joins with the last one (`bsdfs` = 1), or the last two, read:
    /// y_0 and the last three; all of them, without the earlier BSDFs, if `whole`. Returns s.
    int restore_up_to(const Scene& scene, uint32_t vertex, int bsdfs, bool whole, SubPath& y) const;

private:
    void restore_head(uint64_t index, SubPath& y) const;
    void restore_vertex(const Scene& scene, uint32_t vertex, bool bsdf, SubPath& y, int i) const;

    std::vector<Chunk::Head> heads_;
    std::vector<LightVertex> vertices_;
};

}  // namespace etendue
