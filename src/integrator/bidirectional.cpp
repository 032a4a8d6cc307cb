#include "integrator/bidirectional.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

std::vector<ParamInfo> Bidirectional::params() {
    std::vector<ParamInfo> params = depth_params();
    params.push_back({"roulette", ParamKind::Float, "0.15",
                      "Joins that would add less than this share of the pixel's luminance (as "
                      "earlier passes have it) are tested "
                      "with a probability proportional to what they add; 0: all are tested."});
    params.push_back(
        {"eorr", ParamKind::Bool, "false",
         "Efficiency-optimised roulette: joins that would add less to their pixel than "
         "the root of its variance over the rays of a sample (as earlier passes have "
         "both), instead of `roulette`, which must not be 0."});
    return params;
}

Bidirectional::Bidirectional(const IntegratorParams& p)
    : depth_(DepthOptions::from(p)), roulette_(p.number("roulette")),
      is_optimised_(p.flag("eorr")) {
    if (!(roulette_ >= 0 && roulette_ <= 1))
        throw std::runtime_error(fmt::format("{}: roulette must lie in [0, 1]", p.integrator()));
}

void Bidirectional::light_path(const SampleContext& c, const TechniqueCounts& counts,
                               Workspace& work) const {
    const PhaseTimer timer(work.stats, &PhaseSeconds::light_paths);
    const auto splat = [&](int s) {
        if (counts.splat > 0)
            add_if_visible(c, join_splat(c.scene, work.y, s, c.sampler, counts), work);
    };
    const auto hit_lens = [&](int s) {
        add_if_visible(c, join_hit_lens(c.scene, work.y, s, counts), work);
    };
    walk_light_path(c.scene, c.sampler, counts, work.y, work.stats, splat, hit_lens);
}

void Bidirectional::add_next_event(const SampleContext& c, const TechniqueCounts& counts, int t,
                                   Workspace& work) const {
    if (counts.next_event > 0)
        add_if_visible(c, join_next_event(c.scene, work.z, t, c.sampler, counts), work);
}

void Bidirectional::connect_to_own(const SampleContext& c, const TechniqueCounts& counts, int t,
                                   Workspace& work) const {
    if (!(counts.connect > 0)) return;
    const PhaseTimer timer(work.stats, &PhaseSeconds::connections);
    const int longest = std::min(work.y.size(), depth_.max_depth + 1 - t);
    for (int s = 2; s <= longest; ++s)
        add_if_visible(c, join_connect(c.scene, work.y, s, work.z, t, counts), work);
}

void Bidirectional::begin_pass(const PassContext& pass) {
    if (!is_optimised_ || pass.film.passes() < 2) return;
    // Of one pass, averaged over a window, since few passes know little of a pixel's variance.
    constexpr int kReach = 3;
    const FilmGeometry& g = pass.film.geometry();
    const std::vector<Rgb> variance = pass.film.variance();
    thresholds_.resize(variance.size());
    // Variance of one pass over the rays of a sample.
    const double passes = double(pass.film.passes());
    const double samples = passes * double(g.pixel_count());
    const double scale = passes / (double(pass.so_far.rays()) / samples);
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

float Bidirectional::threshold(const SampleContext& c, const Vec2* splat) const {
    if (!is_optimised_ || roulette_ == 0)
        return roulette_ *
               (splat ? c.film.expected_luminance(*splat) : c.film.expected_luminance(c.pixel));
    // With a survival of q = C/δ the rays of a join fall to q, and its variance grows by C²(1/q - 1): the product of the
    // sample's rays T and variance V is least where δ² = V/T [Veach 1997, §10.4.2].
    if (thresholds_.empty()) return 0;
    return thresholds_[splat ? c.film.geometry().pixel_at(*splat) : c.pixel];
}

void Bidirectional::trace_light_paths(const PassContext& pass, const TechniqueCounts& counts,
                                      uint64_t kept, LightPathCollector& collector) const {
    pass.for_each_light_path([&](const SampleContext& c, Workspace& work) {
        light_path(c, counts, work);
        if (c.pixel < kept) collector.add(c.chunk, work.y);
    });
}

std::optional<Rgb> Bidirectional::test(const SampleContext& c, const Join& j, float scale,
                                       uint32_t number, Workspace& work) const {
    Rgb contribution = j.contribution;
    const bool is_splat = j.technique.t <= 1;
    if (is_splat) c.film.prefetch_splat(j.film);
    const float q = join_survival(luminance(contribution) * j.mis_weight * scale,
                                  threshold(c, is_splat ? &j.film : nullptr));
    if (q < 1) {
        c.sampler.seek(Stream::Roulette, number);
        if (!(c.sampler.next_1d_unstructured() < q)) {
            ++work.stats.joins_skipped;
            return {};
        }
        contribution *= 1 / q;
    }
    const float Tr = visibility(c.scene, j, work.stats);
    if (!(Tr > 0)) return {};
    return contribution * Tr;
}

void Bidirectional::add(const SampleContext& c, const std::optional<Join>& j, float factor,
                        uint32_t number, Workspace& work) const {
    if (!j) return;
    const float scale = j->technique.t <= 1 ? c.splat_scale : std::fabs(work.z.film_weight);
    if (const auto value = test(c, *j, scale * factor, number, work))
        c.sink.add(*j, *value * factor);
}

void Bidirectional::add_if_visible(const SampleContext& c, const std::optional<Join>& j,
                                   Workspace& work) const {
    if (j) add(c, j, 1, uint32_t(j->technique.s) << 16 | uint32_t(j->technique.t), work);
}

void Bidirectional::add_drawn(const SampleContext& c, const std::optional<Join>& j, float factor,
                              int draw, Workspace& work) const {
    // Beyond the numbers that s gives to other joins.
    if (j) add(c, j, factor, (0x8000u + uint32_t(draw)) << 16 | uint32_t(j->technique.t), work);
}

}  // namespace etendue
