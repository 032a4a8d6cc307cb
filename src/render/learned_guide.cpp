#include "render/learned_guide.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "film/parallel_for.h"
#include "film/thread_arena.h"
#include "integrator/markov.h"
#include "math/hash.h"
#include "render/aov.h"
#include "render/renderer.h"

namespace etendue {
namespace {

constexpr std::array<Choice<GuidedWalks>, 10> kMethods{{{"path", GuidedWalks::Eye},
                                                        {"light", GuidedWalks::Light},
                                                        {"bdpt", GuidedWalks::Both},
                                                        {"vcm", GuidedWalks::Both},
                                                        {"upg", GuidedWalks::BothWithPairs},
                                                        {"upg+bdpt", GuidedWalks::BothWithPairs},
                                                        {"pcbpt", GuidedWalks::Both},
                                                        {"pssmlt", GuidedWalks::Both},
                                                        {"mmlt", GuidedWalks::Both},
                                                        {"mlt", GuidedWalks::Both}}};

GuidedWalks guided_walks(const std::string& method) {
    std::vector<std::string> names;
    for (const auto& m : kMethods) {
        if (method == m.name) return m.value;
        names.push_back(m.name);
    }
    throw std::runtime_error(
        fmt::format("integrator \"{}\" has no guide; choose one that has (-i): {}", method,
                    fmt::join(names, ", ")));
}

IntegratorParams guided_params(IntegratorSpec& spec) {
    std::string& guide = spec.params["guide"];
    if (guide != "hp02") guide = "on";
    return {spec, integrator_entry(spec.name).info};
}

Guiding train(const Scene& scene, IntegratorSpec& spec, uint64_t seed, int threads) {
    const GuidedWalks walks = guided_walks(spec.name);
    const IntegratorParams params = guided_params(spec);
    Guiding guiding(params);
    const std::unique_ptr<Integrator> integrator = make_integrator(spec);
    // As in MarkovIntegrator.
    const bool is_chain = integrator->error_groups() > 0;
    const DepthOptions of_method = DepthOptions::from(params),
                       depth = is_chain ? MarkovIntegrator::pilot_depth(of_method) : of_method;
    const GuidedLight light = is_chain ? GuidedLight::Indirect : GuidedLight::All;
    const Film film(scene.film(), scene.filter());
    ThreadArena arena(threads);
    const auto for_each = [&](uint64_t count, const PassContext::Task& task) {
        parallel_for(count, [&](uint64_t i) {
            Sampler sampler(SamplerKind::Independent, seed);
            Workspace work;
            task(i, sampler, work);
        });
    };
    arena.execute([&] {
        guiding.train({.scene = scene,
                       .film = film,
                       .index = 0,
                       .light_paths = integrator->light_paths(scene),
                       .pixels = scene.film().pixel_count(),
                       .seed = seed,
                       .for_each_sample = {},
                       .chunks = {},
                       .for_each_other_path = for_each,
                       .for_each_chain = {}},
                      integrator->counts(scene, integrator->light_paths(scene)), depth, walks,
                      light);
    });
    const Guide* guide = guiding.guide();
    if (!guide || (guide->surfaces.is_empty() && guide->lights.is_empty()))
        throw NothingToLearn(
            fmt::format("{}: a guide has nothing to learn from: {}", scene.file(),
                        scene.has_emitters() ? "no walk met a surface" : "there are no emitters"));
    return guiding;
}

std::string name_of(const Scene& scene, const Emitter& emitter) {
    for (const auto& shape : scene.shapes())
        if (shape.emitter == &emitter && !shape.name.empty()) return shape.name;
    return fmt::format("emitter {}", emitter.index);
}

/// A colour by the number of a cell.
Rgb cell_color(uint64_t cell) {
    const auto channel = [&](uint64_t i) { return to_unit_float(uint32_t(hash_combine(cell, i))); };
    return {channel(0), channel(1), channel(2)};
}

/// Direction of a point of the latitude-longitude image.
Vec3 map_direction(float u, float v) {
    const float phi = 2 * kPi * u, theta = kPi * v;
    return {std::sin(phi) * std::sin(theta), std::cos(theta), -std::cos(phi) * std::sin(theta)};
}

}  // namespace

std::vector<GuidedPlace::Lobe> GuidedPlace::Field::lobes() const {
    std::vector<Lobe> all;
    const auto seen = mixture.seen_lobes(view);
    for (int k = 0; k < mixture.size(); ++k) {
        const GuideMixture::Lobe lobe = mixture.lobe(k);
        all.push_back({.direction = seen[size_t(k)].mean,
                       .share = seen[size_t(k)].share,
                       .weight = lobe.weight,
                       .kappa = lobe.kappa,
                       .distance = lobe.inv_r > 0 ? 1 / lobe.inv_r : kInf});
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Lobe& a, const Lobe& b) { return a.share > b.share; });
    return all;
}

Image GuidedPlace::directions(int width, int height) const {
    constexpr int kSteps = 4;  // in a pixel, since lobes may be narrower
    constexpr std::array<const char*, 3> kColors{"R", "G", "B"};
    Image image(width, height, {"R", "G", "B", "eye.Y", "light.Y", "emission.Y"});
    const std::array<const Field*, 3> fields{&eye, &light, &emission};
    for (int c = 0; c < int(kColors.size()); ++c) {
        const Field& field = *fields[size_t(c)];
        if (field.mixture.is_empty()) continue;
        float largest = 0;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                float sum = 0;
                for (int i = 0; i < kSteps * kSteps; ++i) {
                    const float dx = (float(i % kSteps) + 0.5f) / kSteps,
                                dy = (float(i / kSteps) + 0.5f) / kSteps;
                    sum += field.mixture.pdf(field.view,
                                             map_direction((float(x) + dx) / float(width),
                                                           (float(y) + dy) / float(height)));
                }
                largest = std::max(largest, image.at(x, y, c + 3) = sum / (kSteps * kSteps));
            }
        if (!(largest > 0)) continue;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) image.at(x, y, c) = image.at(x, y, c + 3) / largest;
    }
    return image;
}

LearnedGuide::LearnedGuide(const Scene& scene, IntegratorSpec spec, uint64_t seed, int threads)
    : scene_(scene), method_(spec.name), seed_(seed), threads_(threads),
      guiding_(train(scene, spec, seed, threads)) {}

bool LearnedGuide::may_gain() const {
    return Guiding::may_gain(guide(), guided_walks(method_));
}

template <class Pmf>
std::vector<EmitterChoice> LearnedGuide::most_probable(size_t most, const Pmf& pmf) const {
    std::vector<std::pair<float, const Emitter*>> learned;
    for (const auto& e : scene_.emitters()) learned.push_back({pmf(*e), e.get()});
    std::stable_sort(learned.begin(), learned.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    learned.resize(std::min(learned.size(), most));
    std::vector<EmitterChoice> choices;
    for (const auto& [p, e] : learned)
        choices.push_back({name_of(scene_, *e), p, e->selection_pmf});
    return choices;
}

std::vector<EmitterChoice> LearnedGuide::emitter_choices(size_t most) const {
    if (!guide().chooses_emitters()) return {};
    return most_probable(most, [&](const Emitter& e) { return emission_pmf(&guide(), e); });
}

Image LearnedGuide::shares() const {
    const GuideTree& tree = guide().surfaces;
    const auto value = [&](const SubPath& z, size_t layer) -> Rgb {
        if (tree.is_empty()) return {};
        const GuideCell& cell = tree.cell(z[1].p);
        if (layer == 1) return cell_color(uint64_t(&cell - tree.cells().data()));
        if (!z[1].is_connectible) return {};
        return {guide_share(z[1], cell, TransportMode::Radiance),
                guide_share(z[1], cell, TransportMode::Importance), 0};
    };
    const auto layers = average_first_hits(scene_, 2, kAovSamples, seed_, threads_, value);
    const FilmGeometry& film = scene_.film();
    Image image = rgb_image(film.crop_width, film.crop_height, layers[0]);
    add_rgb_layer(image, film.crop_width, film.crop_height, "cells", layers[1]);
    return image;
}

std::array<double, 2> LearnedGuide::mean_shares(const Image& shares) {
    std::array<double, 2> mean{};
    for (int y = 0; y < shares.height; ++y)
        for (int x = 0; x < shares.width; ++x)
            for (int c = 0; c < 2; ++c)
                mean[size_t(c)] += double(shares.at(x, y, c)) / double(shares.pixel_count());
    return mean;
}

GuidedPlace LearnedGuide::at_pixel(int x, int y) const {
    const FilmGeometry& film = scene_.film();
    if (x < 0 || y < 0 || x >= film.width || y >= film.height)
        throw std::runtime_error(fmt::format("pixel {},{} lies outside the image of {} x {} pixels",
                                             x, y, film.width, film.height));
    constexpr int kMostVertices = 32;
    const TechniqueCounts counts;
    RenderStats stats;
    const WalkContext walk{scene_, counts, stats, {kMostVertices, kMostVertices}};
    Sampler sampler(SamplerKind::Independent, seed_);
    sampler.start(0, 0);
    SubPath z;
    start_eye_path(walk, {{float(x) + 0.5f, float(y) + 0.5f}, 1}, Vec2{0.5f, 0.5f}, sampler, z);
    while (z.size() >= 2 && z[z.size() - 1].kind == Vertex::Kind::Surface &&
           !z[z.size() - 1].is_connectible && extend<TransportMode::Radiance>(walk, sampler, z)) {
    }
    const Vertex& v = z[z.size() - 1];
    GuidedPlace place;
    place.delta_events = std::max(0, z.size() - 2);
    constexpr size_t kOnlyClass = 0;
    if (z.size() >= 2 && v.is_infinite) {
        for (const Emitter* e : scene_.infinite_emitters())
            if (const GuideFit* fit = guide().at_infinity(e->index))
                place.emission = {fit->share[kOnlyClass], fit->mixture, {}};
        return place;
    }
    if (z.size() < 2 || !v.is_connectible)
        throw std::runtime_error(
            fmt::format("no surface that can be guided is seen at pixel {},{}", x, y));
    place.is_surface = true;
    place.shape = v.shape->name;
    place.p = v.p;
    place.normal = dot(v.ng, v.wo) < 0 ? -v.ng : v.ng;
    place.gloss_class = guide_class(v.gloss);
    if (!guide().surfaces.is_empty()) {
        const GuideCell& cell = guide().surfaces.cell(v.p);
        const GuideView view = guide_view(v, cell, v.wo);
        const auto field = [&](TransportMode mode) -> GuidedPlace::Field {
            return {guide_share(v, cell, mode), cell.field(mode).mixture, view};
        };
        place.cell_center = cell.center;
        place.eye = field(TransportMode::Radiance);
        place.light = field(TransportMode::Importance);
    }
    constexpr size_t kMostLights = 5;
    if (const LightSelection* lights = guide().lights_at(v.p, side_normal(v)))
        place.lights = most_probable(
            kMostLights, [&](const Emitter& e) { return learned_selection_pmf(*lights, e); });
    if (v.emitter && !guide().emission.is_empty()) {
        const GuideCell& at = guide().emission.cell(v.p);
        const GuideCell::Field& f = at.field(TransportMode::Importance);
        place.emission = {f.share[kOnlyClass], f.mixture, emission_view(*v.emitter, at, v.p, v.ng)};
    }
    return place;
}

}  // namespace etendue
