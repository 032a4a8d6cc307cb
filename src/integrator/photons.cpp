#include "integrator/photons.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

void PhotonMemory::take(uint64_t bytes) {
    if (bytes_.fetch_add(bytes, std::memory_order_relaxed) + bytes > max_bytes_)
        throw std::runtime_error(fmt::format(
            "the light vertices of a pass need more than {} MiB; render in crops (--crop) or "
            "smaller, limit max_depth, or raise the integrator's parameter \"memory\"",
            max_bytes_ >> 20));
}

void Photons::trace(const PassContext& pass, const Bidirectional& paths,
                    const TechniqueCounts& counts, float radius, uint64_t max_bytes) {
    radius_ = radius;
    chunks_.resize(pass.chunks(pass.light_paths));
    for (LightPaths::Chunk& chunk : chunks_) chunk.clear();
    // A vertex is in a chunk, among all, and in the grid.
    constexpr uint64_t kVertexBytes = 2 * sizeof(LightVertex) + sizeof(PointGrid::Entry) + 8;
    PhotonMemory memory(max_bytes);
    pass.for_each_light_path([&](uint64_t chunk, const SampleContext& c, Workspace& work) {
        paths.light_path(c, counts, work);
        chunks_[chunk].add(work.y);
        memory.take(uint64_t(work.y.size()) * kVertexBytes);
    });
    paths_.assemble(chunks_);

    std::vector<PointGrid::Entry> entries;
    const auto vertices = paths_.vertices();
    for (uint32_t i = 0; i < vertices.size(); ++i)
        if (vertices[i].may_connect) entries.push_back({vertices[i].p, i});
    grid_.build(entries, radius);
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
