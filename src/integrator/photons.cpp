#include "integrator/photons.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

void Photons::trace(const PassContext& pass, const Bidirectional& paths,
                    const TechniqueCounts& counts, float radius, uint64_t max_bytes) {
    radius_ = radius;
    // A vertex is in a chunk, which may have as much to spare, among all, and in the grid, whose entries were a list. There
    // are up to four buckets for it, in the last pass's counts too, and twice while the grid is built.
    constexpr uint64_t kVertexBytes =
        3 * sizeof(LightVertex) + 2 * sizeof(PointGrid::Entry) + 13 * sizeof(uint32_t);
    paths.trace_light_paths(pass, counts, pass.light_paths, kVertexBytes, max_bytes, chunks_,
                            paths_);

    std::vector<PointGrid::Entry> entries;
    const auto vertices = paths_.vertices();
    for (uint32_t i = 0; i < vertices.size(); ++i)
        if (vertices[i].may_connect)
            entries.push_back({vertices[i].p, i,
                               uint32_t(paths_.depth(i) + 1) << 8 | paths_.gloss_before(i),
                               luminance(vertices[i].beta) *
                                   std::max(1.0f, kPi * sqr(radius) * vertices[i].pdf_fwd)});
    grid_.build(entries, radius);
}

void Photons::learn_density(float radius) {
    if (!paths_.vertices().empty()) density_ = PairDensity(grid_.take_cells(), radius);
}

std::vector<ParamInfo> RadiusSchedule::params(const char* doc) {
    return {{"radius", ParamKind::Float, "0", doc},
            {"alpha", ParamKind::Float, "0.75",
             "The radius of pass i is radius·i^((alpha-1)/2); 1: it does not shrink, and the image "
             "stays biased."}};
}

RadiusSchedule::RadiusSchedule(const IntegratorParams& p, float default_share)
    : first_(p.number("radius")), alpha_(p.number("alpha")), default_share_(default_share) {
    if (!(first_ >= 0))
        throw std::runtime_error(fmt::format("{}: radius must not be negative", p.integrator()));
    if (!(alpha_ > 0 && alpha_ <= 1))
        throw std::runtime_error(fmt::format("{}: alpha must lie in (0, 1]", p.integrator()));
}

float RadiusSchedule::radius(const Scene& scene, uint32_t pass) const {
    const float first = first_ > 0 ? first_ : default_share_ * scene.bounds().radius();
    return first * std::pow(float(pass + 1), (alpha_ - 1) / 2);
}

}  // namespace etendue
