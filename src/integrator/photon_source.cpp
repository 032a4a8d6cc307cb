#include "integrator/photon_source.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

void PhotonMemory::add(uint64_t photons) {
    // A photon is stored in a chunk, in the global map and possibly in the caustic map. It has a position and an entry in
    // the tree of each map, and it may have an irradiance.
    constexpr uint64_t kPhotonBytes =
        3 * sizeof(MapPhoton) + 32 + 2 * sizeof(Vec3) + sizeof(Rgb) + 1;
    const uint64_t more = photons * kPhotonBytes;
    if (bytes_.fetch_add(more, std::memory_order_relaxed) + more > max_bytes_)
        throw std::runtime_error(fmt::format("the photons need more than {} MiB; trace "
                                             "fewer, limit max_depth, or raise "
                                             "the integrator's parameter \"memory\"",
                                             max_bytes_ >> 20));
}

MapPhotons TracedPhotons::trace(const PassContext& context, uint32_t pass,
                                const std::function<std::vector<Importon>()>&) {
    std::vector<std::vector<MapPhoton>> chunks(context.chunks(context.light_paths));
    PhotonMemory memory(max_bytes_);
    context.for_each_light_path([&](const SampleContext& c, Workspace& work) {
        const PhaseTimer timer(work.stats, &PhaseSeconds::light_paths);
        const TechniqueCounts no_joins;
        c.sampler.start(pass, c.index);
        trace_light_path(mapping_.paths().light_walk(c.scene, no_joins, work.stats), c.sampler,
                         work.y);
        memory.add(uint64_t(work.y.size()));
        for_each_photon(mapping_, work.y, [&](MapPhoton photon) {
            photon.power *= c.splat_scale;
            chunks[c.chunk].push_back(photon);
        });
    });
    MapPhotons photons;
    for (const auto& chunk : chunks) {
        photons.global.insert(photons.global.end(), chunk.begin(), chunk.end());
        for (const MapPhoton& photon : chunk)
            if (photon.is_caustic()) photons.caustic.push_back(photon);
    }
    photons_ = photons.global.size();
    return photons;
}

std::vector<std::pair<std::string, double>> TracedPhotons::figures() const {
    return {{"photons", double(photons_)}};
}

}  // namespace etendue
