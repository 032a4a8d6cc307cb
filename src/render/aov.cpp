#include "render/aov.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "film/thread_arena.h"
#include "pathspace/walk.h"

namespace etendue {
namespace {

Rgb to_rgb(Vec3 v) {
    return {v.x, v.y, v.z};
}

Rgb value(const std::string& name, const Vertex& v, const SubPath& z, const Scene& scene) {
    if (name == "albedo") return v.bsdf.albedo_estimate();
    if (name == "normal") return to_rgb(v.bsdf.shading_normal());
    if (name == "depth") return Rgb(z.flight.length);
    if (name == "position") return to_rgb(v.p);
    if (name == "uv") {
        const Vec2 uv = scene.surface(v.location).uv;
        return {uv.x, uv.y, 0};
    }
    return Rgb();
}

}  // namespace

const std::vector<AovInfo>& aov_registry() {
    static const std::vector<AovInfo> entries = {
        {"albedo", "Approximate reflectance of the first surface."},
        {"normal", "Shading normal of the first surface, world space."},
        {"depth", "Distance from the lens to the first surface; 0 where there is none."},
        {"position", "Position of the first surface, world space."},
        {"uv", "Texture coordinates of the first surface."},
        {"variance", "Variance of the pixel's mean, from the spread of the passes."},
    };
    return entries;
}

void check_aovs(const std::vector<std::string>& names) {
    std::vector<std::string> known;
    for (const AovInfo& a : aov_registry()) known.push_back(a.name);
    for (const std::string& n : names)
        if (std::find(known.begin(), known.end(), n) == known.end())
            throw std::runtime_error(
                fmt::format("unknown layer \"{}\" (known: {})", n, fmt::join(known, ", ")));
}

std::vector<std::vector<Rgb>> average_first_hits(const Scene& scene, size_t layers, int samples,
                                                 uint64_t seed, int threads,
                                                 const FirstHitValue& value) {
    std::vector<std::vector<Rgb>> images(layers, std::vector<Rgb>(scene.film().pixel_count()));
    const Film film(scene.film(), scene.filter());
    ThreadArena arena(threads);
    arena.execute([&] {
        tbb::parallel_for(0, scene.film().crop_height, [&](int row) {
            SubPath z;
            RenderStats stats;
            const TechniqueCounts counts;
            const WalkContext walk{scene, counts, stats, {}};
            Sampler sampler(SamplerKind::Sobol, seed);
            for (int x = 0; x < scene.film().crop_width; ++x) {
                const uint64_t pixel = uint64_t(row) * scene.film().crop_width + x;
                for (int i = 0; i < samples; ++i) {
                    sampler.start(uint32_t(i), pixel);
                    start_eye_path(walk, film, pixel, sampler, z);
                    if (z.size() < 2 || z[1].kind != Vertex::Kind::Surface) continue;
                    for (size_t layer = 0; layer < layers; ++layer)
                        images[layer][pixel] += value(z, layer) * (z.film_weight / float(samples));
                }
            }
        });
    });
    return images;
}

std::vector<AovImage> render_aovs(const Scene& scene, const std::vector<std::string>& names,
                                  int samples, uint64_t seed, int threads) {
    std::vector<AovImage> images;
    for (const std::string& n : names)
        if (n != "variance") images.push_back({n, {}});
    if (images.empty()) return images;
    auto pixels = average_first_hits(
        scene, images.size(), samples, seed, threads,
        [&](const SubPath& z, size_t i) { return value(images[i].name, z[1], z, scene); });
    for (size_t i = 0; i < images.size(); ++i) images[i].pixels = std::move(pixels[i]);
    return images;
}

}  // namespace etendue
