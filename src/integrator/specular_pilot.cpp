#include "integrator/specular_pilot.h"

#include <algorithm>
#include <cmath>

#include "manifold/specular_connection.h"
#include "pathspace/walk.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

constexpr int kTiles = 8;  // along each side of the image
constexpr uint64_t kWalks = 4096, kBlock = 64;
/// Longer searches are as costly as if they had so many trials, and longer.
constexpr uint64_t kMostTrials = 512;
/// Time of a ray of a chain, with its derivatives in double, relative to another ray: 1.5 on lantern, 2 on water-caustic.
constexpr double kChainRay = 2;

size_t tile_of(const FilmGeometry& g, Vec2 film) {
    const auto along = [](float x, int begin, int size) {
        return std::clamp(int((x - float(begin)) / float(size) * kTiles), 0, kTiles - 1);
    };
    return size_t(along(film.y, g.crop_y, g.crop_height) * kTiles +
                  along(film.x, g.crop_x, g.crop_width));
}

/// Sums over the walks of a part of the image.
struct TileSums {
    double walks = 0, light = 0, light_of_none = 0;
    double moment_without = 0, moment_with = 0, moment_of_hits = 0;

    TileSums& operator+=(const TileSums& o) {
        walks += o.walks, light += o.light, light_of_none += o.light_of_none;
        moment_without += o.moment_without, moment_with += o.moment_with;
        moment_of_hits += o.moment_of_hits;
        return *this;
    }
};

struct Block {
    std::array<TileSums, size_t(kTiles) * kTiles> tiles;
    double rays_without = 0, chain_rays = 0;
};

/// Adds the contributions of one eye walk.
void add_walk(const WalkContext& walk, int max_depth, const SeedPhotons& photons, const SubPath& z,
              Sampler& sampler, Workspace& work, TileSums& to) {
    const TechniqueCounts& n = walk.counts;
    double others = 0, hits = 0, chains = 0;
    double squares_of_hits = 0, squares_of_weighted = 0;
    const double film_weight = std::fabs(double(z.film_weight));
    for (int t = 2; t <= z.size(); ++t) {
        for_each_hit(walk.scene, z, t, n, [&](const Join& j) {
            const double v = double(luminance(j.contribution) * j.mis_weight),
                         w = double(hit_beside_specular(walk.scene, z, t, *j.emitter, n));
            if (w == 1) {
                others += v;
                return;
            }
            hits += w * v;
            squares_of_hits += w * v * v;
            squares_of_weighted += sqr(w * v);
        });
        if (t > max_depth || !z[t - 1].is_connectible) continue;
        if (const auto j = join_next_event(walk.scene, z, t, sampler, n))
            others += double(luminance(j->contribution) * j->mis_weight *
                             visibility(walk.scene, *j, work.stats));
        const uint64_t before = work.stats.chain_trials;
        const SpecularLimits limits{.max_depth = max_depth,
                                    .most_trials = kMostTrials,
                                    .gives_up = false,
                                    .photons = &photons};
        const auto x = join_specular(walk.scene, z, t, limits, sampler, n, work);
        if (!x) continue;
        const double w = double(x->mis_weight), v = double(luminance(x->contribution)) * w;
        chains += v;
        squares_of_weighted += v * v;
        if (x->emitter->is_delta()) {
            to.light_of_none += v * film_weight;
            continue;
        }
        // As a hit, the path would contribute at least √(w / (1 - w)) / c times as much as the connection without its number of
        // trials: from the definition of p̂.
        const double trials = double(work.stats.chain_trials - before);
        squares_of_hits +=
            v * (v / (w * trials)) * std::sqrt(w / std::max(1 - w, 0x1p-24)) / kSolutionShare;
    }
    const double scale = sqr(film_weight);
    ++to.walks;
    to.light += (others + hits + chains) * film_weight;
    to.moment_of_hits += squares_of_hits * scale;
    to.moment_without += (sqr(others) + squares_of_hits) * scale;
    to.moment_with += (sqr(others) + squares_of_weighted) * scale;
}

}  // namespace

SpecularPilot run_specular_pilot(const PassContext& pass, const DepthOptions& depth,
                                 const TechniqueCounts& counts, const SeedPhotons& photons) {
    const uint64_t seed = pilot_seed(pass.seed, PilotUse::Specular);
    const FilmGeometry& film = pass.film.geometry();
    std::vector<Block> blocks(kWalks / kBlock);
    pass.for_each_other_path(blocks.size(), [&](uint64_t b, Sampler&, Workspace& work) {
        Sampler sampler(SamplerKind::Independent, seed);
        Block& block = blocks[b];
        const RenderStats before = work.stats;
        work.stats = {};
        const WalkContext walk{pass.scene, counts, work.stats, depth.walk()};
        for (uint64_t i = b * kBlock; i < (b + 1) * kBlock; ++i) {
            work.go_on();
            sampler.start(0, i);
            if (counts.connect > 0) trace_light_path(walk, sampler, work.y);
            trace_eye_path(walk, pass.film, mix64(seed + i) % pass.pixels, sampler, work.z);
            // Each eye vertex is connected to each light vertex.
            if (counts.connect > 0)
                block.rays_without += double(work.y.size()) * double(work.z.size());
            add_walk(walk, depth.max_depth, photons, work.z, sampler, work,
                     block.tiles[tile_of(film, work.z.film)]);
        }
        block.rays_without += double(work.stats.walk_rays + work.stats.shadow_rays);
        block.chain_rays += double(work.stats.chain_rays);
        work.stats += before;
    });
    Block sum;
    for (const Block& b : blocks) {
        for (size_t i = 0; i < sum.tiles.size(); ++i) sum.tiles[i] += b.tiles[i];
        sum.rays_without += b.rays_without;
        sum.chain_rays += b.chain_rays;
    }
    SpecularPilot result;
    double walks = 0;
    result.rays_without = sum.rays_without;
    result.rays_with = sum.rays_without + kChainRay * sum.chain_rays;
    for (const TileSums& t : sum.tiles) {
        walks += t.walks;
        if (!(t.light > 0)) continue;
        const double relative = sqr(t.walks / t.light);
        result.light += t.light;
        result.light_of_none += t.light_of_none;
        result.moment_without += relative * t.moment_without;
        result.moment_with += relative * t.moment_with;
        result.moment_of_hits += relative * t.moment_of_hits;
    }
    result.luminance = walks > 0 ? result.light / walks : 0;
    return result;
}

}  // namespace etendue
