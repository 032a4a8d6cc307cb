#include "mcmc/pick_paths.h"

#include <algorithm>

#include <fmt/format.h>

#include "mcmc/chain_groups.h"
#include "mcmc/path_space.h"
#include "mcmc/whole_film.h"

namespace etendue {
namespace {

/// x_0 … x_m, up to the first vertex from the eye that is not a delta event; empty if this cannot be a user path.
std::vector<Vec3> light_points(const PathState& x) {
    const int m = x.before(x.last(), [](const Vertex& v) { return !v.is_delta; });
    std::vector<Vec3> points;
    if (x[0].v.is_infinite || m == 0) return points;
    for (int i = 0; i <= m; ++i) points.push_back(x[i].v.p);
    return points;
}

}  // namespace

std::vector<GivenPath> pick_paths(const Scene& scene, const PickOptions& o) {
    const FilmGeometry& g = scene.film();
    if (o.x < 0 || o.y < 0 || o.x >= g.width || o.y >= g.height)
        throw std::runtime_error(fmt::format("pixel {},{} lies outside the image of {} x {} pixels",
                                             o.x, o.y, g.width, g.height));
    const FilmRegion pixel{{float(o.x), float(o.y)}, {1, 1}};
    const PathSpace space({PathMeasure(scene, pixel, o.length, o.length),
                           weighted_luminance(TargetMap(g)), LengthChoice(o.length, o.length, {}),
                           TechniqueChoice(scene, o.length, 1, {})},
                          {}, {});
    const Film film(g, scene.filter());
    const PassContext pass{.scene = scene,
                           .film = film,
                           .index = 0,
                           .light_paths = 1,
                           .pixels = 1,
                           .seed = o.seed,
                           .for_each_sample = {},
                           .chunks = {},
                           .for_each_other_path = {},
                           .for_each_chain = {}};
    const WholeFilm whole(pass);
    Workspace work;
    const auto state = space.make_state();
    std::vector<std::vector<Vec3>> found;
    std::vector<double> importance;
    for (uint64_t i = 0; i < o.samples; ++i) {
        space.draw(0, hash_combine(o.seed, i), {whole.sample, work}, *state);
        const auto& x = static_cast<const PathState&>(*state);
        if (!(x.target > 0) || !pixel.contains(x.film)) continue;
        std::vector<Vec3> points = light_points(x);
        if (points.empty()) continue;
        importance.push_back(x.target);
        found.push_back(std::move(points));
    }
    const double u = to_unit_double(hash_combine(o.seed, o.samples));
    std::vector<size_t> picked = resample(importance, size_t(o.count), u);
    picked.erase(std::unique(picked.begin(), picked.end()), picked.end());
    if (picked.empty())
        throw std::runtime_error(
            fmt::format("none of {} samples found light for pixel {},{} along paths of {} edges "
                        "from an emitter within the scene; try another pixel or length, or more "
                        "samples",
                        o.samples, o.x, o.y, o.length));
    std::vector<GivenPath> paths;
    for (const size_t i : picked)
        paths.push_back({.name = fmt::format("pixel {},{}, {}", o.x, o.y, paths.size() + 1),
                         .points = found[i],
                         .cones = {GivenPath::kCone},
                         .radius = {}});
    return paths;
}

}  // namespace etendue
