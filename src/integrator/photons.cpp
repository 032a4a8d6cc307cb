#include "integrator/photons.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace etendue {

void Photons::trace(const PassContext& pass, const Bidirectional& paths,
                    const TechniqueCounts& counts, float radius, uint64_t max_bytes) {
    // A vertex is in a chunk, which may have as much to spare, among all, and in the grid, whose entries were a list. There
    // are up to four buckets for it, twice while the grid is built, and in bytes for the density.
    constexpr uint64_t kVertexBytes = 3 * (sizeof(LightVertex) + sizeof(LightVertexPlace)) +
                                      2 * sizeof(PointGrid::Entry) + 10 * sizeof(uint32_t);
    radius_ = radius;
    collector_.begin(pass, kVertexBytes, max_bytes);
    paths.trace_light_paths(pass, counts, pass.light_paths, collector_);
    collector_.assemble(paths_);
    index();
}

void Photons::index() {
    // Counted, then written, by blocks, so that their order depends on no thread.
    const auto vertices = paths_.vertices();
    constexpr size_t kBlock = 4096;
    struct Block {
        size_t begin = 0;
        double flux = 0;
    };
    std::vector<Block> blocks((vertices.size() + kBlock - 1) / kBlock + 1);
    const auto for_each_connectible = [&](const auto& use) {
        tbb::parallel_for(size_t(0), blocks.size() - 1, [&](size_t block) {
            const size_t end = std::min(vertices.size(), (block + 1) * kBlock);
            size_t rank = 0;
            for (size_t i = block * kBlock; i < end; ++i)
                if (vertices[i].may_connect) use(block, rank++, uint32_t(i));
        });
    };
    for_each_connectible([&](size_t block, size_t, uint32_t) { ++blocks[block + 1].begin; });
    for (size_t i = 1; i < blocks.size(); ++i) blocks[i].begin += blocks[i - 1].begin;
    std::vector<PointGrid::Entry> entries(blocks.back().begin);
    for_each_connectible([&](size_t block, size_t rank, uint32_t i) {
        const LightVertex& v = vertices[i];
        const float clamped = luminance(v.beta) * std::max(1.0f, kPi * sqr(radius_) * v.pdf_fwd);
        const uint32_t s = std::min(uint32_t(paths_.depth(i) + 1), kManyVertices);
        const uint32_t side = paths_.arrival_side(i).bits();
        entries[blocks[block].begin + rank] = {v.p, i, side << 16 | s << 8 | paths_.gloss_before(i),
                                               clamped};
        blocks[block].flux += double(clamped);
    });
    double flux = 0;
    for (const Block& b : blocks) flux += b.flux;
    mean_flux_ = entries.empty() ? 0.0f : float(flux / double(entries.size()));
    grid_.build(entries, radius_);
}

void Photons::learn_density(float radius) {
    if (!paths_.vertices().empty()) density_ = PairDensity(grid_, radius);
}

std::vector<ParamInfo> RadiusSchedule::params(const char* doc) {
    return {{"radius", ParamKind::Float, "0", doc},
            {"alpha", ParamKind::Float, "0.75",
             "The radius of pass i is radius·i^((alpha-1)/2); 1: it does not shrink, and the image "
             "stays biased."}};
}

RadiusSchedule::RadiusSchedule(const IntegratorParams& p, float default_share)
    : first_(p.number("radius")), alpha_(p.number("alpha")), default_share_(default_share) {
    if (!(first_ >= 0))
        throw std::runtime_error(fmt::format("{}: radius must not be negative", p.integrator()));
    if (!(alpha_ > 0 && alpha_ <= 1))
        throw std::runtime_error(fmt::format("{}: alpha must lie in (0, 1]", p.integrator()));
}

float RadiusSchedule::radius(const Scene& scene, uint32_t pass) const {
    const float first = first_ > 0 ? first_ : default_share_ * scene.bounds().radius();
    return first * std::pow(float(pass + 1), (alpha_ - 1) / 2);
}

}  // namespace etendue
