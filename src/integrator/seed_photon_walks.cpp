#include "integrator/seed_photon_walks.h"

#include "pathspace/walk.h"
#include "sampler/pilot_seed.h"

namespace etendue {

SeedPhotons trace_seed_photons(const PassContext& pass, int depth, uint64_t walks) {
    constexpr uint64_t kBlock = 1024;
    const uint64_t seed = pilot_seed(pass.seed, PilotUse::SpecularSeeds);
    std::vector<std::vector<SeedPhoton>> blocks(walks / kBlock);
    const TechniqueCounts unguided{.connect = 1, .specular_depth = depth};
    pass.for_each_other_path(blocks.size(), [&](uint64_t b, Sampler&, Workspace& work) {
        Sampler sampler(SamplerKind::Independent, seed);
        const int longest = depth + 2;
        const WalkContext walk{pass.scene, unguided, work.stats, {longest, longest}};
        SubPath& y = work.y;
        for (uint64_t i = b * kBlock; i < (b + 1) * kBlock; ++i) {
            sampler.start(0, i);
            if (!start_light_path(walk, sampler, y)) continue;
            while (y.size() < longest && extend<TransportMode::Importance>(walk, sampler, y)) {
                const Vertex &v = y[y.size() - 1], &before = y[y.size() - 2];
                if (y.size() > 2 && !before.is_delta) break;
                if (y.size() > 2 && v.is_connectible)
                    blocks[b].push_back({v.p, side_normal(v), before.p, y[0].emitter->index});
            }
        }
    });
    std::vector<SeedPhoton> all;
    for (const std::vector<SeedPhoton>& block : blocks)
        all.insert(all.end(), block.begin(), block.end());
    return SeedPhotons(std::move(all));
}

}  // namespace etendue
