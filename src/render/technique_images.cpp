#include "render/technique_images.h"

#include <fmt/format.h>

#include "system/section_file.h"

namespace etendue {
namespace {

/// Index of a technique in the triangle of (vertices, s), where n vertices have s = 0 … n. Pairs, for which s ≥ 2, and
/// connections to y_0 have separate indices; so have specular connections.
constexpr size_t kKinds = 3;
size_t triangle_index(const Technique& q) {
    const size_t n = size_t(q.vertices());
    const bool is_second = is_pair(q.strategy) || (q.strategy == Strategy::Connect && q.s == 1);
    const size_t kind = q.strategy == Strategy::Specular ? 2 : is_second;
    return kKinds * ((n - 2) * (n + 3) / 2 + size_t(q.s)) + kind;
}

}  // namespace

struct TechniqueImages::Layer {
    Layer(const Technique& q, const FilmGeometry& g, double typical_radiance)
        : technique{q.strategy, q.s, q.t},
          pass_weighted(g.crop_width, g.crop_height, typical_radiance),
          pass_unweighted(g.crop_width, g.crop_height, typical_radiance), weighted(g.pixel_count()),
          unweighted(g.pixel_count()) {}

    Technique technique;  ///< Gathers that drop either vertex share an image; drops_eye is false.
    bool is_folded = false;  ///< Whether a finished pass has contributed to it.
    SplatBuffer pass_weighted, pass_unweighted;
    std::vector<SplatBuffer::Sum> weighted, unweighted;
};

namespace {

std::vector<Rgb> mean_of(const std::vector<SplatBuffer::Sum>& sums, uint64_t passes) {
    std::vector<Rgb> mean;
    mean.reserve(sums.size());
    const double scale = passes > 0 ? 1 / double(passes) : 0.0;
    for (const auto& s : sums)
        mean.emplace_back(float(s[0] * scale), float(s[1] * scale), float(s[2] * scale));
    return mean;
}

}  // namespace

TechniqueImages::TechniqueImages(const FilmGeometry& geometry, const ReconstructionFilter& filter,
                                 int max_edges, double typical_radiance)
    : geometry_(geometry), filter_(filter), max_edges_(max_edges),
      typical_radiance_(typical_radiance) {
    layers_ = std::vector<std::atomic<Layer*>>(triangle_index({Strategy::Hit, 0, max_edges + 2}));
}

TechniqueImages::~TechniqueImages() = default;

size_t TechniqueImages::memory_bytes(uint64_t pixels, int max_edges) {
    const size_t layers = triangle_index({Strategy::Hit, 0, max_edges + 2}) / kKinds;
    return layers * pixels * 2 * (3 * sizeof(int64_t) + sizeof(SplatBuffer::Sum));
}

TechniqueImages::Layer* TechniqueImages::layer(const Technique& q) {
    if (q.vertices() - 1 > max_edges_) return nullptr;
    std::atomic<Layer*>& place = layers_[triangle_index(q)];
    Layer* found = place.load(std::memory_order_acquire);
    if (found) return found;
    const std::lock_guard lock(creation_);
    if (!place.load()) {
        owned_.push_back(std::make_unique<Layer>(q, geometry_, typical_radiance_));
        place.store(owned_.back().get(), std::memory_order_release);
    }
    return place.load();
}

void TechniqueImages::add(const FilmTarget& target, const Technique& q, Rgb contribution,
                          float mis_weight, float scale) {
    Layer* l = layer(q);
    if (!l) return;
    for_each_pixel(geometry_, filter_, target, [&](uint64_t pixel, float h) {
        l->pass_weighted.add(pixel, contribution * (mis_weight * scale * h));
        l->pass_unweighted.add(pixel, contribution * (scale * h));
    });
}

void TechniqueImages::end_pass() {
    ++passes_;
    for (const auto& l : owned_) {
        l->pass_weighted.fold_into(l->weighted);
        l->pass_unweighted.fold_into(l->unweighted);
        l->is_folded = true;
    }
}

void TechniqueImages::drop_pass() {
    for (const auto& l : owned_) {
        l->pass_weighted.clear();
        l->pass_unweighted.clear();
    }
}

void TechniqueImages::save(SectionWriter& to) const {
    to.begin("techniques");
    to.put(passes_);
    const auto is_kept = [](const Layer* l) { return l && l->is_folded; };
    to.put(uint64_t(std::count_if(layers_.begin(), layers_.end(), is_kept)));
    for (const Layer* l : layers_) {
        if (!is_kept(l)) continue;
        to.put(uint32_t(l->technique.strategy));
        to.put(l->technique.s);
        to.put(l->technique.t);
        to.put(l->weighted);
        to.put(l->unweighted);
    }
}

void TechniqueImages::add_saved(SectionReader& from) {
    from.open("techniques");
    const auto passes = from.get<uint64_t>(), count = from.get<uint64_t>();
    std::vector<SplatBuffer::Sum> saved;
    std::vector<const Layer*> known;
    for (uint64_t i = 0; i < count; ++i) {
        const auto strategy = from.get<uint32_t>();
        const auto s = from.get<int>(), t = from.get<int>();
        const bool is_one = strategy <= uint32_t(Strategy::Specular) && s >= 0 && t >= 0 &&
                            s <= max_edges_ + 2 && t <= max_edges_ + 2;
        const Technique q{is_one ? Strategy(strategy) : Strategy::Hit, s, t};
        Layer* const l = is_one && q.vertices() >= 2 && s <= q.vertices() ? layer(q) : nullptr;
        if (!l || l->technique != q || std::find(known.begin(), known.end(), l) != known.end())
            from.fail(fmt::format("({}, {}) is no technique for paths of up to {} edges", s, t,
                                  max_edges_));
        known.push_back(l);
        l->is_folded = true;
        for (auto* sums : {&l->weighted, &l->unweighted}) {
            from.get(saved, geometry_.pixel_count(), "pixels");
            for (size_t p = 0; p < saved.size(); ++p)
                for (size_t c = 0; c < 3; ++c) (*sums)[p][c] += saved[p][c];
        }
    }
    from.finish();
    passes_ += passes;
}

std::vector<TechniqueImages::Entry> TechniqueImages::images() const {
    std::vector<Entry> out;
    for (const Layer* l : layers_)
        if (l && l->is_folded)
            out.push_back(
                {l->technique, mean_of(l->weighted, passes_), mean_of(l->unweighted, passes_)});
    return out;
}

}  // namespace etendue
