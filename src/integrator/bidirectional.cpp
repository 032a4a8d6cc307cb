#include "integrator/bidirectional.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "pathspace/eye_paths.h"

namespace etendue {

std::vector<ParamInfo> Bidirectional::params() {
    std::vector<ParamInfo> params = sub_path_params();
    params.push_back(
        {"roulette", ParamKind::Float, "0.15",
         "Threshold of the Russian roulette before shadow rays, in [0, 1], as a fraction of the "
         "pixel's luminance in earlier passes: a join that would contribute less is tested with a "
         "probability proportional to its contribution; 0: all joins are tested."});
    params.push_back({"eorr", ParamKind::Bool, "false",
                      "Efficiency-optimised roulette: the threshold is √(V/T) instead, where V is "
                      "the variance of the pixel and T the number of rays of a sample, both from "
                      "earlier passes. Has no effect if `roulette` is 0.",
                      true});
    return params;
}

Bidirectional::Bidirectional(const IntegratorParams& p, Guiding guiding)
    : depth_(DepthOptions::from(p)), guiding_(std::move(guiding)), roulette_(p.number("roulette")),
      is_optimised_(p.flag("eorr") && roulette_ > 0) {
    if (!(roulette_ >= 0 && roulette_ <= 1))
        throw std::runtime_error(fmt::format("{}: roulette must lie in [0, 1]", p.integrator()));
}

void Bidirectional::trace_light_path(const SampleContext& c, const TechniqueCounts& counts,
                                     Workspace& work, const LearnedPlaces* learned) const {
    const PhaseTimer timer(work.stats, &PhaseSeconds::light_paths);
    const WalkContext walk = light_walk(c.scene, counts, work.stats, learned);
    SubPath& y = work.y;
    const bool adds = c.index < c.light_paths;
    Sampler sampler = c.sampler;
    if (!adds) sampler.start(c.own_light_path());
    if (!start_light_path(walk, sampler, y)) return;
    for (int s = 1; s <= y.size() && s <= depth_.max_depth; ++s) {
        if (adds && counts.splat > 0) add(c, join_splat(c.scene, y, s, sampler, counts), work);
        if (s >= 2) extend<TransportMode::Importance>(walk, sampler, y);
        if (adds) add(c, join_hit_lens(c.scene, y, s, counts), work);
    }
}

void Bidirectional::trace_further_light_paths(const SampleContext& c, const TechniqueCounts& counts,
                                              Workspace& work, const LearnedPlaces* learned) const {
    if (c.is_of_whole_film) return;
    const uint64_t samples = c.film.sample_count();
    for (uint64_t path = c.index + samples; path < c.light_paths; path += samples) {
        Sampler sampler = c.sampler;
        sampler.start(path);
        trace_light_path(c.with(sampler, c.sink), counts, work, learned);
    }
}

void Bidirectional::trace_eye_path(const SampleContext& c, const TechniqueCounts& counts,
                                   Workspace& work, const LearnedPlaces* learned) const {
    if (work.has_eye_path) return;
    etendue::trace_eye_paths(eye_walk(c.scene, counts, work.stats, learned), {&c, 1}, {&work.z, 1});
}

bool Bidirectional::trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                                    const TechniqueCounts& counts, RenderStats& stats,
                                    const LearnedPlaces* learned) const {
    const PhaseTimer timer(stats, &PhaseSeconds::eye_paths);
    etendue::trace_eye_paths(eye_walk(c[0].scene, counts, stats, learned), c, z);
    return true;
}

void Bidirectional::add_sample(const SampleContext& c, const TechniqueCounts& counts,
                               Workspace& work, const LearnedPlaces* learned) const {
    const bool has_light_path = counts.uses_light_paths();
    if (has_light_path) {
        trace_further_light_paths(c, counts, work, learned);  // C(s,1), C(s,0)
        trace_light_path(c, counts, work, learned);           // C(s,1), C(s,0)
    }
    const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
    trace_eye_path(c, counts, work, learned);
    for (int t = 2; t <= work.z.size(); ++t) {
        add_hits(c, counts, t, work);  // C(0,t)
        if (!is_joinable(work.z, t)) continue;
        add_next_events(c, counts, t, work);                      // C(1,t)
        if (has_light_path) add_connections(c, counts, t, work);  // C(s,t), s ≥ 2
    }
}

NextEventDraws Bidirectional::add_next_events(const SampleContext& c, const TechniqueCounts& counts,
                                              int t, Workspace& work) const {
    NextEventDraws draws;
    if (counts.next_event == 0) return draws;
    draws.count = work.z[t - 1].is_fixed_by_film ? uint32_t(counts.repeated_next_event) : 1;
    for (uint32_t i = 0; i < draws.count; ++i) {
        const auto join = join_next_event(c.scene, work.z, t, c.sampler, counts, i);
        const auto value = add(c, join, work, 1 / float(draws.count), i);
        if (!join) continue;
        NextEventDraw& draw = draws.draws[i];
        draw = {.contribution = luminance(join->contribution), .weight = join->mis_weight};
        if (value && draw.contribution > 0) draw.passed = luminance(*value) / draw.contribution;
    }
    return draws;
}

void Bidirectional::add_connections(const SampleContext& c, const TechniqueCounts& counts, int t,
                                    Workspace& work) const {
    const PhaseTimer timer(work.stats, &PhaseSeconds::connections);
    for (int s = 2; s <= work.y.size() && s + t - 1 <= max_depth(); ++s)
        add(c, join_connect(c.scene, work.y, s, work.z, t, counts), work);
}

void Bidirectional::add_technique(const SampleContext& c, const TechniqueCounts& counts, int s,
                                  int t, float factor, Workspace& work) const {
    SubPath &y = work.y, &z = work.z;
    // The last flight of C(s,0) ends on the lens. Its ray also hits the surface behind the lens, which is not needed.
    const WalkContext light{c.scene, counts, work.stats, {s, depth_.rr_depth}};
    const WalkContext eye{c.scene, counts, work.stats, {t, depth_.rr_depth}};
    if (s >= 2) {
        if (!start_light_path(light, c.sampler, y)) return;
        // The loop must not take another step, since that would overwrite y.flight.
        while (y.size() < s && extend<TransportMode::Importance>(light, c.sampler, y)) {
        }
        if (t == 0 && y.size() >= s - 1) {
            add(c, join_hit_lens(c.scene, y, s - 1, counts), work, factor);
            return;
        }
        if (y.size() < s) return;
        if (t == 1) {
            add(c, join_splat(c.scene, y, s, c.sampler, counts), work, factor);
            return;
        }
    }
    etendue::trace_eye_paths(eye, {&c, 1}, {&z, 1});
    if (z.size() < t) return;
    if (s == 0)
        add_hits(c, counts, t, work, factor);
    else if (is_joinable(z, t))
        add(c,
            s == 1 ? join_next_event(c.scene, z, t, c.sampler, counts)
                   : join_connect(c.scene, y, s, z, t, counts),
            work, factor);
}

void Bidirectional::learn(const LearnContext& pass, uint64_t rays) {
    if (!is_optimised_ || pass.film.passes() < 2) return;
    // With a survival probability q = C/δ, the expected number of rays of a join is q, and its variance increases by
    // C²(1/q - 1). The product of the number of rays T and the variance V of a sample is minimal for δ² = V/T
    // [Veach 1997, §10.4.2].
    // The variance of one sample, averaged over a window, because few passes give a poor estimate for a single pixel.
    constexpr int kReach = 3;
    const FilmGeometry& g = pass.film.geometry();
    const std::vector<Rgb> variance = pass.film.variance();
    thresholds_.resize(variance.size());
    // Factor from film.variance() to the variance of one sample divided by its number of rays.
    const double passes = double(pass.film.passes());
    const double samples = passes * double(g.pixel_count());
    const double scale = passes / (pass.film.variance_of_pixels() * double(rays) / samples);
    for (int y = 0; y < g.crop_height; ++y)
        for (int x = 0; x < g.crop_width; ++x) {
            double sum = 0;
            int count = 0;
            for (int v = std::max(0, y - kReach); v <= std::min(g.crop_height - 1, y + kReach); ++v)
                for (int u = std::max(0, x - kReach); u <= std::min(g.crop_width - 1, x + kReach);
                     ++u, ++count)
                    sum +=
                        double(luminance(variance[size_t(v) * size_t(g.crop_width) + size_t(u)]));
            thresholds_[size_t(y) * size_t(g.crop_width) + size_t(x)] =
                float(std::sqrt(scale * sum / count));
        }
}

float Bidirectional::threshold(const SampleContext& c, const Vec2* film) const {
    if (!thresholds_.empty())
        return thresholds_[film ? c.film.geometry().pixel_at(*film) : c.film.pixel_of(c.index)];
    if (is_optimised_ || roulette_ == 0) return 0;
    return roulette_ * (film ? c.expected.at(*film) : c.expected_of_pixel());
}

void Bidirectional::trace_light_paths(const PassContext& pass, const TechniqueCounts& counts,
                                      uint64_t kept, LightVertexCache& cache,
                                      const LearnedPlaces* learned) const {
    pass.for_each_light_path([&](const SampleContext& c, Workspace& work) {
        trace_light_path(c, counts, work, learned);
        if (c.index < kept) cache.add(c.chunk, work.y);
    });
}

std::optional<Rgb> Bidirectional::test(const SampleContext& c, const Join& j, float scale,
                                       uint64_t number, Workspace& work) const {
    const bool is_splat = j.technique.t <= 1;
    if (is_splat) c.film.prefetch_splat(j.film);
    const float q = join_survival(luminance(j.contribution) * j.mis_weight * scale,
                                  threshold(c, is_splat || c.is_of_whole_film ? &j.film : nullptr));
    return test_with_survival(c, j, q, number, work);
}

std::optional<Rgb> Bidirectional::test_with_survival(const SampleContext& c, const Join& j, float q,
                                                     uint64_t number, Workspace& work) {
    Rgb contribution = j.contribution;
    if (q < 1) {
        c.sampler.seek(Stream::Roulette, number);
        if (!(c.sampler.next_1d_unstructured() < double(q))) {
            ++work.stats.joins_skipped;
            return {};
        }
        contribution *= 1 / q;
    }
    const float Tr = visibility(c.scene, j, work.stats);
    if (!(Tr > 0)) return {};
    return contribution * Tr;
}

std::optional<Rgb> Bidirectional::add(const SampleContext& c, const std::optional<Join>& j,
                                      Workspace& work, float factor, uint32_t draw) const {
    if (!j || j->technique.vertices() - 1 < shortest_) return {};
    const float splat_scale = c.is_of_whole_film ? 1.0f : c.splat_scale,
                scale = j->technique.t <= 1 ? splat_scale : std::fabs(work.z.film_weight);
    const uint64_t number = join_number(j->technique.s, j->technique.t, draw);
    const auto value = test(c, *j, scale * factor, number, work);
    if (value) c.sink.add(*j, *value * factor);
    return value;
}

}  // namespace etendue
