#include "integrator/photons.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

void Photons::trace(const PassContext& pass, const Bidirectional& paths,
                    const TechniqueCounts& counts, float radius, uint64_t max_bytes) {
    radius_ = radius;
    max_bytes_ = max_bytes;
    begin_keeping(pass);
    paths.trace_light_paths(pass, counts, pass.light_paths, collector_);
    take_kept();
}

void Photons::trace_apart(const PassContext& pass, const Bidirectional& paths,
                          const TechniqueCounts& counts, float radius, uint64_t max_bytes) {
    radius_ = radius;
    max_bytes_ = max_bytes;
    begin_keeping(pass);
    const uint64_t count = pass.light_paths, chunks = pass.chunks(count);
    const auto none = [](int) {};
    pass.for_each_other_path(chunks, [&](uint64_t chunk, Sampler& sampler, Workspace& work) {
        for (uint64_t i = count * chunk / chunks; i < count * (chunk + 1) / chunks; ++i) {
            work.stats.is_timed = i % RenderStats::kTimedSamples == 0;
            const PhaseTimer timer(work.stats, &PhaseSeconds::light_paths);
            sampler.start(pass.index, pass.pixels + i);
            paths.walk_light_path(pass.scene, sampler, counts, work.y, work.stats, none, none);
            collector_.add(chunk, work.y);
        }
    });
    take_kept();
}

void Photons::begin_keeping(const PassContext& pass) {
    // A vertex is in a chunk, which may have as much to spare, among all, and in the grid, whose entries were a list. There
    // are up to four buckets for it, twice while the grid is built, and in bytes for the density.
    constexpr uint64_t kVertexBytes =
        3 * sizeof(LightVertex) + 2 * sizeof(PointGrid::Entry) + 10 * sizeof(uint32_t);
    collector_.begin(pass, kVertexBytes, max_bytes_);
}

void Photons::take_kept() {
    collector_.assemble(paths_);
    std::vector<PointGrid::Entry> entries;
    double flux = 0, flux2 = 0;
    const auto vertices = paths_.vertices();
    for (uint32_t i = 0; i < vertices.size(); ++i) {
        const LightVertex& v = vertices[i];
        if (!v.may_connect) continue;
        const float clamped = luminance(v.beta) * std::max(1.0f, kPi * sqr(radius_) * v.pdf_fwd);
        flux += double(clamped), flux2 += sqr(double(clamped));
        entries.push_back(
            {v.p, i, uint32_t(paths_.depth(i) + 1) << 8 | paths_.gloss_before(i), clamped});
    }
    typical_flux_ = flux > 0 ? float(flux2 / flux) : 0.0f;
    grid_.build(entries, radius_);
}

void Photons::learn_density(float radius) {
    if (!paths_.vertices().empty()) density_ = PairDensity(grid_, radius);
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
