#include "integrator/pair_pilot.h"

#include <algorithm>
#include <cmath>

#include "integrator/seen_extent.h"
#include "reuse/gather_constants.h"
#include "reuse/reciprocal.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

struct Place {
    Vec3 p, ng;
    ArrivalSide side;
    int index;              ///< i of the vertex.
    bool is_fixed_by_film;  ///< See Vertex; of eye vertices.
};

void append_connectible(const SubPath& path, std::vector<Place>& to) {
    for (int i = 1; i < path.size(); ++i)
        if (const Vertex& v = path[i]; v.is_connectible && v.kind == Vertex::Kind::Surface)
            to.push_back({v.p, v.ng, arrival_side(v), i, v.is_fixed_by_film});
}

/// Of the walks of a block, in order.
struct Block {
    std::vector<Place> light, eye;
    std::array<uint64_t, 2> pairs{};
};

}  // namespace

PairPilot run_pair_pilot(const PassContext& pass, const Bidirectional& paths,
                         const TechniqueCounts& counts) {
    constexpr uint64_t kBlock = 256, kFewest = 1024, kMost = uint64_t(1) << 17, kShare = 4;
    const uint64_t seed = pilot_seed(pass.seed, PilotUse::Pairs);
    const uint64_t walks = std::clamp(pass.light_paths / kShare, kFewest, kMost);
    std::vector<Block> blocks((walks + kBlock - 1) / kBlock);
    pass.for_each_other_path(blocks.size(), [&](uint64_t b, Sampler&, Workspace& work) {
        Sampler sampler(SamplerKind::Independent, seed);
        const WalkContext light = paths.light_walk(pass.scene, counts, work.stats),
                          eye = paths.eye_walk(pass.scene, counts, work.stats);
        for (uint64_t i = b * kBlock; i < std::min(walks, (b + 1) * kBlock); ++i) {
            sampler.start(0, i);
            trace_light_path(light, sampler, work.y);
            append_connectible(work.y, blocks[b].light);
            trace_eye_path(eye, pass.film, mix64(seed + i) % pass.pixels, sampler, work.z);
            append_connectible(work.z, blocks[b].eye);
        }
    });
    std::vector<Place> light;
    for (const Block& b : blocks) light.insert(light.end(), b.light.begin(), b.light.end());
    std::vector<PointGrid::Entry> entries(light.size());
    for (size_t i = 0; i < light.size(); ++i) entries[i] = {light[i].p, uint32_t(i)};
    // A radius at which most eye paths find pairs, and cells in which most places that the lens sees have several
    // vertices.
    const float radius = seen_extent(pass.scene).radius / std::sqrt(float(walks));
    PointGrid grid;
    grid.build(entries, 2 * radius);
    pass.for_each_other_path(blocks.size(), [&](uint64_t b, Sampler&, Workspace&) {
        for (const Place& z : blocks[b].eye) {
            const Neighbourhood near{z.p, z.ng, z.side, radius, kGatherConstants.flatness * radius};
            grid.for_each_near(z.p, radius, [&](const PointGrid::Entry& e) {
                const Place& y = light[e.index];
                if (counts.gathers(y.index + z.index) > 0 && near.contains(y.p, y.side))
                    ++blocks[b].pairs[z.is_fixed_by_film];
            });
        }
    });
    std::array<double, 2> pairs{};
    for (const Block& b : blocks)
        for (size_t i = 0; i < 2; ++i) pairs[i] += double(b.pairs[i]);
    const double multiple = double(pass.light_paths) / double(walks);
    for (double& n : pairs) n *= multiple / (double(walks) * sqr(double(radius)));
    return {grid.counts(), multiple, pairs};
}

}  // namespace etendue
