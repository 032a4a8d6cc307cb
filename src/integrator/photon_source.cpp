#include "integrator/photon_source.h"

#include <atomic>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

std::vector<MapPhoton> TracedPhotons::trace(const PassContext& pass) {
    std::vector<std::vector<MapPhoton>> chunks(pass.chunks(pass.light_paths));
    // A photon is in a chunk, among all, may be among the caustics, and has a leaf in each tree.
    constexpr uint64_t kPhotonBytes = 3 * sizeof(MapPhoton) + 32;
    std::atomic<uint64_t> bytes = 0;
    pass.for_each_light_path([&](const SampleContext& c, Workspace& work) {
        const SubPath& y = work.y;
        mapping_.paths().trace_light_path(c, {}, work);
        const uint64_t more = uint64_t(y.size()) * kPhotonBytes;
        if (bytes.fetch_add(more, std::memory_order_relaxed) + more > max_bytes_)
            throw std::runtime_error(fmt::format("the photons need more than {} MiB; give fewer "
                                                 "light_paths, limit max_depth, or raise "
                                                 "the integrator's parameter \"memory\"",
                                                 max_bytes_ >> 20));
        bool by_delta = y.size() > 0 && y[0].emitter->is_delta(), by_glossy = true;
        for (int i = 1; i < y.size(); ++i) {
            const Vertex& v = y[i];
            using Origin = MapPhoton::Origin;
            const Origin origin = i == 1 || !by_glossy ? Origin::Any
                                  : by_delta           ? Origin::DeltaCaustic
                                                       : Origin::Caustic;
            if (v.is_connectible && (mapping_.is_diffuse(v) || origin == Origin::DeltaCaustic))
                chunks[c.chunk].push_back(
                    {{v.p, v.wo, v.beta * c.splat_scale, y[0].emitter, i + 1}, origin});
            by_delta &= v.is_delta;
            by_glossy &= v.is_delta || !mapping_.is_diffuse(v);
        }
    });
    std::vector<MapPhoton> photons;
    for (const auto& chunk : chunks) photons.insert(photons.end(), chunk.begin(), chunk.end());
    return photons;
}

}  // namespace etendue
