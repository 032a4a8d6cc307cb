#include "integrator/bidirectional.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

std::vector<ParamInfo> Bidirectional::params() {
    std::vector<ParamInfo> params = sub_path_params();
    params.push_back(
        {"roulette", ParamKind::Float, "0.15",
         "Shadow rays of small contributions are skipped at random, and the others weighted up. "
         "Threshold, in [0, 1], as a fraction of the pixel's luminance in earlier passes; 0 traces "
         "all."});
    params.push_back({"eorr", ParamKind::Bool, "false",
                      "Efficiency-optimised roulette: the threshold is √(V/T) instead, where V is "
                      "the variance of the pixel and T the number of rays of a sample, both from "
                      "earlier passes. Has no effect if `roulette` is 0.",
                      true});
    return params;
}

Bidirectional::Bidirectional(const IntegratorParams& p, Guiding guiding, const Specular& specular)
    : depth_(DepthOptions::from(p)), guiding_(std::move(guiding)), specular_(specular),
      roulette_(p.number("roulette")), is_optimised_(p.flag("eorr") && roulette_ > 0) {
    if (!(roulette_ >= 0 && roulette_ <= 1))
        throw std::runtime_error(fmt::format("{}: roulette must lie in [0, 1]", p.integrator()));
}

void Bidirectional::trace_eye_paths(std::span<const SampleContext> c, const TechniqueCounts& counts,
                                    std::span<SubPath> z, RenderStats& stats,
                                    const LearnedPlaces* learned) const {
    const PhaseTimer timer(stats, &PhaseSeconds::eye_paths);
    etendue::trace_eye_paths(eye_walk(c[0].scene, counts, stats, learned), c, z);
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
        if (!survives_roulette(q, number, c.sampler, work.stats)) return {};
        contribution *= 1 / q;
    }
    const float Tr = visibility(c.scene, j, work.stats);
    if (!(Tr > 0)) return {};
    return contribution * Tr;
}

std::optional<Rgb> Bidirectional::add_join(const SampleContext& c, const Join& j, Workspace& work,
                                           float factor, uint32_t draw) const {
    if (j.technique.vertices() - 1 < shortest_) return {};
    const float splat_scale = c.is_of_whole_film ? 1.0f : c.splat_scale,
                scale = j.technique.t <= 1 ? splat_scale : std::fabs(work.z.film_weight);
    const uint64_t number = join_number(j.technique.s, j.technique.t, draw);
    const auto value = test(c, j, scale * factor, number, work);
    if (value) c.sink.add(j, *value * factor);
    return value;
}

void Bidirectional::add_connection(const SampleContext& c, const TechniqueCounts& counts,
                                   const SubPath& y, int s, int t, const Roulette& roulette,
                                   Workspace& work, float factor, uint32_t draw) const {
    if (s + t - 1 < shortest_) return;
    const uint64_t number = join_number(s, t, draw);
    const float scale = roulette.scale * factor;
    const EarlyRoulette early{roulette.threshold, scale, number, c.sampler, work.stats};
    const auto join = join_connect(c.scene, y, s, work.z, t, counts, &early);
    if (!join) return;
    // Whether the join is ended with its weight is decided by the same number.
    const float q =
        join_survival(luminance(join->contribution) * join->mis_weight * scale, roulette.threshold);
    const auto value = test_with_survival(c, *join, q, number, work);
    if (value) c.sink.add(*join, *value * factor);
}

}  // namespace etendue
