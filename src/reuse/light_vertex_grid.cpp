#include "reuse/light_vertex_grid.h"

#include <algorithm>

#include "film/parallel_for.h"

namespace etendue {

void LightVertexGrid::build(const LightVertexCache& cache, float radius, int first) {
    cache_ = &cache;
    radius_ = radius;
    // Entries are counted, then written, in blocks, so that their order does not depend on threads.
    const auto vertices = cache.vertices();
    constexpr size_t kBlock = 4096;
    struct Block {
        size_t begin = 0;
        double flux = 0;
    };
    std::vector<Block> blocks((vertices.size() + kBlock - 1) / kBlock + 1);
    const auto for_each_connectible = [&](const auto& use) {
        parallel_for(blocks.size() - 1, [&](size_t block) {
            const size_t end = std::min(vertices.size(), (block + 1) * kBlock);
            size_t rank = 0;
            for (size_t i = block * kBlock; i < end; ++i)
                if (vertices[i].is_connectible && (first == 1 || cache.depth(uint32_t(i)) >= first))
                    use(block, rank++, uint32_t(i));
        });
    };
    for_each_connectible([&](size_t block, size_t, uint32_t) { ++blocks[block + 1].begin; });
    for (size_t i = 1; i < blocks.size(); ++i) blocks[i].begin += blocks[i - 1].begin;
    std::vector<PointGrid::Entry> entries(blocks.back().begin);
    for_each_connectible([&](size_t block, size_t rank, uint32_t i) {
        const LightVertex& v = vertices[i];
        const float clamped = luminance(v.beta) * std::max(1.0f, kPi * sqr(radius_) * v.pdf_fwd);
        const uint32_t s = std::min(uint32_t(cache.depth(i) + 1), kManyVertices);
        const uint32_t side = cache.arrival_side(i).bits();
        entries[blocks[block].begin + rank] = {v.p, i, side << 16 | s << 8 | cache.gloss_before(i),
                                               clamped};
        blocks[block].flux += double(clamped);
    });
    double flux = 0;
    for (const Block& b : blocks) flux += b.flux;
    mean_flux_ = entries.empty() ? 0.0f : float(flux / double(entries.size()));
    grid_.build(entries, radius);
}

}  // namespace etendue
