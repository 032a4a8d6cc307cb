#include "render/aov.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "film/parallel_for.h"
#include "film/thread_arena.h"
#include "pathspace/walk.h"

namespace etendue {
namespace {

Rgb to_rgb(Vec3 v) {
    return {v.x, v.y, v.z};
}

/// Layers of what mirrors and clear glass show, instead of these themselves.
bool looks_through(const std::string& name) {
    return name.starts_with("denoise_");
}

/// Continues an eye path to the first surface that is neither a mirror nor clear glass.
void pass_delta_surfaces(const WalkContext& walk, Sampler& sampler, SubPath& z) {
    while (z.size() < walk.options.max_vertices && !z[z.size() - 1].is_connectible &&
           extend<TransportMode::Radiance>(walk, sampler, z)) {
    }
}

/// Of the last vertex of a path that passed delta surfaces. Black where it met no other surface.
Rgb seen_value(const std::string& name, const SubPath& z) {
    const Vertex& v = z[z.size() - 1];
    if (v.kind != Vertex::Kind::Surface || !v.is_connectible) return Rgb();
    if (name == "denoise_normal") return to_rgb(v.bsdf.shading_normal());
    // In the colours of the mirrors and glass before it; without the η² of refractions.
    Rgb albedo = v.bsdf.albedo_estimate();
    for (int i = 0; i < 3; ++i)
        if (const float before = z[1].beta[i]; before > 0)
            albedo[i] = std::min(albedo[i] * z.eta2 * (v.beta[i] / before), 1.0f);
    return albedo;
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

/// average_first_hits(); if `looks_on`, paths continue by pass_delta_surfaces() before `value` is called.
std::vector<std::vector<Rgb>> average_eye_paths(const Scene& scene, size_t layers, int samples,
                                                uint64_t seed, int threads, bool looks_on,
                                                const FirstHitValue& value) {
    constexpr int kMostVertices = 16;
    std::vector<std::vector<Rgb>> images(layers, std::vector<Rgb>(scene.film().pixel_count()));
    const Film film(scene.film(), scene.filter());
    ThreadArena arena(threads);
    arena.execute([&] {
        parallel_for(scene.film().crop_height, [&](int row) {
            SubPath z;
            RenderStats stats;
            const TechniqueCounts counts;
            const WalkContext walk{scene, counts, stats, {kMostVertices, kMostVertices}};
            Sampler sampler(SamplerKind::Sobol, seed);
            for (int x = 0; x < scene.film().crop_width; ++x) {
                const uint64_t pixel = uint64_t(row) * scene.film().crop_width + x;
                for (int i = 0; i < samples; ++i) {
                    sampler.start(uint32_t(i), pixel);
                    start_eye_path(walk, film, pixel, sampler, z);
                    if (z.size() < 2 || z[1].kind != Vertex::Kind::Surface) continue;
                    if (looks_on) pass_delta_surfaces(walk, sampler, z);
                    for (size_t layer = 0; layer < layers; ++layer)
                        images[layer][pixel] += value(z, layer) * (z.film_weight / float(samples));
                }
            }
        });
    });
    return images;
}

}  // namespace

const std::vector<AovInfo>& aov_registry() {
    static const std::vector<AovInfo> entries = {
        {"albedo", "Approximate reflectance of the first surface."},
        {"normal", "Shading normal of the first surface, world space."},
        {"depth", "Distance from the lens to the first surface; 0 where there is none."},
        {"position", "Position of the first surface, world space."},
        {"uv", "Texture coordinates of the first surface."},
        {"denoise_albedo",
         "Approximate reflectance of the first surface that is neither a mirror nor "
         "clear glass, in the colours of those before it."},
        {"denoise_normal", "Shading normal of the same surface, world space."},
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
    return average_eye_paths(scene, layers, samples, seed, threads, false, value);
}

std::vector<AovImage> render_aovs(const Scene& scene, const std::vector<std::string>& names,
                                  int samples, uint64_t seed, int threads) {
    std::vector<AovImage> images;
    for (const std::string& n : names)
        if (n != "variance") images.push_back({n, {}});
    if (images.empty()) return images;
    for (const bool looks_on : {false, true}) {
        std::vector<AovImage*> of;
        for (AovImage& a : images)
            if (looks_through(a.name) == looks_on) of.push_back(&a);
        if (of.empty()) continue;
        auto pixels = average_eye_paths(
            scene, of.size(), samples, seed, threads, looks_on, [&](const SubPath& z, size_t i) {
                return looks_on ? seen_value(of[i]->name, z) : value(of[i]->name, z[1], z, scene);
            });
        for (size_t i = 0; i < of.size(); ++i) of[i]->pixels = std::move(pixels[i]);
    }
    return images;
}

}  // namespace etendue
