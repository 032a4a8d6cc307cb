#include "integrator/bidirectional.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

std::vector<ParamInfo> Bidirectional::params() {
    std::vector<ParamInfo> params = depth_params();
    params.push_back({"roulette", ParamKind::Float, "0.05",
                      "Joins that would add less than this share of the pixel's luminance (as "
                      "earlier passes have it) are tested "
                      "with a probability proportional to what they add; 0: all are tested."});
    return params;
}

Bidirectional::Bidirectional(const IntegratorParams& p)
    : depth_(DepthOptions::from(p)), roulette_(p.number("roulette")) {
    if (!(roulette_ >= 0 && roulette_ <= 1))
        throw std::runtime_error(fmt::format("{}: roulette must lie in [0, 1]", p.integrator()));
}

void Bidirectional::light_path(const SampleContext& c, const TechniqueCounts& counts,
                               Workspace& work) const {
    SubPath& y = work.y;
    // The last vertex of the longest path is the lens: joined to by a splat, met by a ray if it is finite.
    const WalkOptions walk{depth_.max_depth + c.scene.sensor().has_finite_lens(), depth_.rr_depth};
    if (!start_light_path(c.scene, c.sampler, y, work.stats)) return;
    for (int s = 1; s <= y.size() && s <= depth_.max_depth; ++s) {
        if (counts.splat > 0) add_if_visible(c, join_splat(c.scene, y, s, c.sampler, counts), work);
        if (s >= 2)
            extend<TransportMode::Importance>(c.scene, c.sampler, walk, counts, y, work.stats);
        add_if_visible(c, join_hit_lens(c.scene, y, s, counts), work);
    }
}

void Bidirectional::connect_to_own(const SampleContext& c, const TechniqueCounts& counts, int t,
                                   Workspace& work) const {
    if (!(counts.connect > 0)) return;
    const int longest = std::min(work.y.size(), depth_.max_depth + 1 - t);
    for (int s = 2; s <= longest; ++s)
        add_if_visible(c, join_connect(c.scene, work.y, s, work.z, t, counts), work);
}

std::optional<Rgb> Bidirectional::test(const SampleContext& c, const Join& j, float scale,
                                       uint32_t number, Workspace& work) const {
    Rgb contribution = j.contribution;
    if (roulette_ > 0) {
        const float expected = j.technique.t <= 1 ? c.film.expected_luminance(j.film)
                                                  : c.film.expected_luminance(c.pixel);
        const float q =
            join_survival(luminance(contribution) * j.mis_weight * scale, roulette_ * expected);
        if (q < 1) {
            c.sampler.seek(Stream::Roulette, number);
            if (!(c.sampler.next_1d_unstructured() < q)) {
                ++work.stats.joins_skipped;
                return {};
            }
            contribution *= 1 / q;
        }
    }
    const float Tr = visibility(c.scene, j, work.stats);
    if (!(Tr > 0)) return {};
    return contribution * Tr;
}

void Bidirectional::add_if_visible(const SampleContext& c, const std::optional<Join>& j,
                                   Workspace& work) const {
    if (!j) return;
    const Technique& q = j->technique;
    const uint32_t number = uint32_t(q.s) << 16 | uint32_t(q.t);
    const float scale = q.t <= 1 ? c.splat_scale : std::fabs(work.z.film_weight);
    if (const auto value = test(c, *j, scale, number, work)) c.sink.add(*j, *value);
}

}  // namespace etendue
