#include "integrator/photons.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

void Photons::trace(const PassContext& pass, const Bidirectional& paths,
                    const TechniqueCounts& counts, float radius, uint64_t max_bytes) {
    radius_ = radius;
    // A vertex is in a chunk, among all, and in the grid.
    constexpr uint64_t kVertexBytes = 2 * sizeof(LightVertex) + sizeof(PointGrid::Entry) + 8;
    paths.trace_light_paths(pass, counts, pass.light_paths, max_bytes / kVertexBytes, chunks_,
                            paths_);

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
