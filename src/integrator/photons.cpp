#include "integrator/photons.h"

#include <atomic>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

void Photons::trace(const PassContext& pass, const Bidirectional& paths,
                    const TechniqueCounts& counts, float radius, uint64_t max_bytes) {
    radius_ = radius;
    chunks_.resize(pass.chunks);
    for (LightPaths::Chunk& chunk : chunks_) chunk.clear();
    // A vertex is in a chunk, among all, and in the grid.
    constexpr uint64_t kVertexBytes = 2 * sizeof(LightVertex) + sizeof(PointGrid::Entry) + 8;
    std::atomic<uint64_t> bytes = 0;
    pass.for_each_light_path([&](uint64_t chunk, const SampleContext& c, Workspace& work) {
        paths.light_path(c, counts, work);
        chunks_[chunk].add(work.y);
        const uint64_t own = uint64_t(work.y.size()) * kVertexBytes;
        if (bytes.fetch_add(own, std::memory_order_relaxed) + own > max_bytes)
            throw std::runtime_error(fmt::format(
                "the light vertices of a pass need more than {} MiB; render in crops (--crop) or "
                "smaller, limit max_depth, or raise the integrator's parameter \"memory\"",
                max_bytes >> 20));
    });
    paths_.assemble(chunks_);

    std::vector<PointGrid::Entry> entries;
    const auto vertices = paths_.vertices();
    for (uint32_t i = 0; i < vertices.size(); ++i)
        if (vertices[i].may_connect) entries.push_back({vertices[i].p, i});
    grid_.build(entries, radius);
}

uint64_t photon_memory(const IntegratorParams& p) {
    const int mebibytes = p.integer("memory");
    if (mebibytes < 1)
        throw std::runtime_error(fmt::format("{}: memory must be at least 1", p.integrator()));
    return uint64_t(mebibytes) << 20;
}

ParamInfo memory_param() {
    return {"memory", ParamKind::Int, "8192",
            "Most that the light vertices of a pass may take, in MiB."};
}

}  // namespace etendue
