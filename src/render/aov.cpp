#include "render/aov.h"

#include <algorithm>
#include <array>
#include <memory>
#include <stdexcept>

#include <fmt/format.h>

#include "film/parallel_chunks.h"
#include "film/parallel_for.h"
#include "film/thread_arena.h"
#include "pathspace/walk.h"
#include "render/renderer.h"

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

/// The images of the layers under construction: sums of passes, one at a time.
class LayerImages {
public:
    LayerImages(const Scene& scene, size_t layers, uint64_t samples)
        : sums_(layers, std::vector<Rgb>(scene.film().pixel_count())) {
        for (size_t i = 0; i < layers; ++i)
            passes_.push_back(
                std::make_unique<PassImage>(scene.film(), scene.filter(), 1, samples));
    }
    PassImage& pass(size_t layer) { return *passes_[layer]; }
    void begin(const SampleGrid* grid) {
        for (const auto& pass : passes_) pass->begin(0, grid);
    }
    /// Adds `factor` times the pass.
    void end(float factor) {
        for (size_t layer = 0; layer < sums_.size(); ++layer) {
            std::vector<Rgb>& sum = sums_[layer];
            for_film_chunks(sum.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
                std::array<Rgb, kFilmChunk> pixels;
                const std::span<Rgb> of_pass(pixels.data(), size_t(end - begin));
                passes_[layer]->eye(begin, of_pass);
                for (uint64_t i = begin; i < end; ++i) sum[i] += of_pass[i - begin] * factor;
            });
            passes_[layer]->clear();
        }
    }
    std::vector<std::vector<Rgb>> take() { return std::move(sums_); }

private:
    std::vector<std::vector<Rgb>> sums_;
    std::vector<std::unique_ptr<PassImage>> passes_;
};

/// average_first_hits(); if `looks_on`, paths continue by pass_delta_surfaces() before `value` is called. A ray contributes
/// to all pixels that the filter reaches, since the weights of its own pixel would be noisy if they have two signs.
std::vector<std::vector<Rgb>> average_eye_paths(const Scene& scene, size_t layers, int samples,
                                                uint64_t seed, int threads, bool looks_on,
                                                const FirstHitValue& value) {
    constexpr int kMostVertices = 16;
    constexpr uint64_t kChunk = 256;
    Film film(scene.film(), scene.filter(), 1, FilterMode::Spread);
    const uint64_t count = film.sample_count();
    LayerImages images(scene, layers, count);
    ThreadArena arena(threads);
    arena.execute([&] {
        for (int i = 0; i < samples; ++i) {
            const Vec2 offset = film_offset(SamplerKind::Sobol, seed, uint32_t(i));
            const SampleGrid grid(scene.film(), scene.filter(), offset);
            film.begin_pass(0, offset);
            images.begin(film.spreads() ? &grid : nullptr);
            parallel_for((count + kChunk - 1) / kChunk, [&](uint64_t chunk) {
                SubPath z;
                RenderStats stats;
                const TechniqueCounts counts;
                const WalkContext walk{scene, counts, stats, {kMostVertices, kMostVertices}};
                Sampler sampler(SamplerKind::Sobol, seed);
                const uint64_t end = std::min(count, (chunk + 1) * kChunk);
                for (uint64_t index = chunk * kChunk; index < end; ++index) {
                    sampler.start(uint32_t(i), index);
                    start_eye_path(walk, film, index, sampler, z);
                    if (z.size() < 2 || z[1].kind != Vertex::Kind::Surface) continue;
                    if (looks_on) pass_delta_surfaces(walk, sampler, z);
                    for (size_t layer = 0; layer < layers; ++layer)
                        images.pass(layer).add_eye(index, value(z, layer) * z.film_weight);
                }
            });
            images.end(1 / float(samples));
        }
    });
    return images.take();
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
