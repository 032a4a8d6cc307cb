#include "render/technique_images.h"

namespace etendue {
namespace {

/// Place of a technique in the triangle of (vertices, s): n vertices have s = 0 … n.
size_t triangle_index(const Technique& q) {
    const size_t n = size_t(q.vertices());
    return (n - 2) * (n + 3) / 2 + size_t(q.s);
}

}  // namespace

struct TechniqueImages::Layer {
    Layer(const Technique& q, uint64_t pixels)
        : technique(q), pass_weighted(pixels), pass_unweighted(pixels), weighted(pixels),
          unweighted(pixels) {}

    Technique technique;
    SplatBuffer pass_weighted, pass_unweighted;
    std::vector<Rgb> weighted, unweighted;
    std::atomic<bool> is_used{false};
};

TechniqueImages::TechniqueImages(const FilmGeometry& geometry, const ReconstructionFilter& filter,
                                 int max_edges)
    : geometry_(geometry), filter_(filter), max_edges_(max_edges) {
    for (int n = 2; n <= max_edges + 1; ++n)
        for (int s = 0; s <= n; ++s)
            layers_.push_back(
                std::make_unique<Layer>(connection_technique(s, n - s), geometry.pixel_count()));
}

TechniqueImages::~TechniqueImages() = default;

size_t TechniqueImages::memory_bytes(uint64_t pixels, int max_edges) {
    const size_t layers = triangle_index({Strategy::Hit, 0, max_edges + 2});
    return layers * pixels * 2 * (3 * sizeof(int64_t) + sizeof(Rgb));
}

TechniqueImages::Layer* TechniqueImages::layer(const Technique& q) const {
    return q.vertices() - 1 <= max_edges_ ? layers_[triangle_index(q)].get() : nullptr;
}

void TechniqueImages::add_eye(uint64_t pixel, const Technique& q, Rgb contribution,
                              float mis_weight) {
    Layer* l = layer(q);
    if (!l) return;
    l->is_used.store(true, std::memory_order_relaxed);
    l->pass_weighted.add(pixel, contribution * mis_weight);
    l->pass_unweighted.add(pixel, contribution);
}

void TechniqueImages::add_splat(Vec2 film, const Technique& q, Rgb contribution, float mis_weight,
                                float scale) {
    Layer* l = layer(q);
    if (!l) return;
    l->is_used.store(true, std::memory_order_relaxed);
    for_each_pixel(geometry_, filter_, film, [&](uint64_t pixel, float h) {
        l->pass_weighted.add(pixel, contribution * (mis_weight * scale * h));
        l->pass_unweighted.add(pixel, contribution * (scale * h));
    });
}

void TechniqueImages::end_pass() {
    ++passes_;
    for (auto& l : layers_) {
        if (!l->is_used.load()) continue;
        l->pass_weighted.fold_into(l->weighted);
        l->pass_unweighted.fold_into(l->unweighted);
    }
}

std::vector<TechniqueImages::Entry> TechniqueImages::images() const {
    std::vector<Entry> out;
    const float scale = passes_ > 0 ? 1 / float(passes_) : 0.0f;
    for (const auto& l : layers_) {
        if (!l->is_used.load()) continue;
        Entry e{l->technique, l->weighted, l->unweighted};
        for (Rgb& c : e.weighted) c *= scale;
        for (Rgb& c : e.unweighted) c *= scale;
        out.push_back(std::move(e));
    }
    return out;
}

}  // namespace etendue
