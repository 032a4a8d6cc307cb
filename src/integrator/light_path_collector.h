#pragma once
// The light sub-paths of a pass on their way into LightPaths.

#include <optional>
#include <vector>

#include "integrator/photon_memory.h"
#include "pathspace/light_paths.h"

namespace etendue {

class LightPathCollector {
public:
    /// For those of `pass`: at most `max_bytes`, at so many a vertex.
    void begin(const PassContext& pass, uint64_t vertex_bytes, uint64_t max_bytes) {
        vertex_bytes_ = vertex_bytes;
        memory_.emplace(max_bytes);
        chunks_.resize(pass.chunks(pass.light_paths));
        for (LightPaths::Chunk& chunk : chunks_) chunk.clear();
    }
    /// Keeps a path of the chunk. Throws std::runtime_error where there are too many.
    void add(uint64_t chunk, const SubPath& y) {
        chunks_[chunk].add(y);
        memory_->take(uint64_t(y.size()) * vertex_bytes_);
    }
    /// In the order of chunks, and in these in that of add().
    void assemble(LightPaths& paths) const { paths.assemble(chunks_); }

private:
    std::vector<LightPaths::Chunk> chunks_;
    std::optional<PhotonMemory> memory_;
    uint64_t vertex_bytes_ = 0;
};

}  // namespace etendue
