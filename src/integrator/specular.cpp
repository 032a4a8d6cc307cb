#include "integrator/specular.h"

#include "integrator/specular_pilot.h"
#include "pathspace/walk.h"
#include "sampler/pilot_seed.h"

namespace etendue {

std::vector<ParamInfo> Specular::params() {
    return {
        {"specular_connections", ParamKind::String, "off",
         "`on`: eye vertices are also connected to lamps by way of smooth glass and mirrors, for "
         "light that otherwise only hits find. `auto`: on where some walks before the first pass "
         "show that it helps. See the page on specular connections."},
        {"specular_depth", ParamKind::Int, "4",
         "Largest number of reflections and refractions of such a connection, in [1, 8]."}};
}

Specular::Specular(const IntegratorParams& p) {
    constexpr std::array<Choice<Mode>, 3> kModes{
        {{"off", Mode::Off}, {"on", Mode::On}, {"auto", Mode::Auto}}};
    mode_ = p.choice("specular_connections", kModes);
    is_used_ = mode_ != Mode::Off;
    depth_ = p.integer("specular_depth", 1, ChainEvents::kMost);
}

namespace {

/// Walks from lamps that go on by delta events alone, with random numbers that no pass uses.
SeedPhotons trace_photons(const PassContext& pass, const TechniqueCounts& counts) {
    constexpr uint64_t kWalks = 1 << 17, kBlock = 1024;
    const uint64_t seed = pilot_seed(pass.seed, PilotUse::SpecularSeeds);
    std::vector<std::vector<SeedPhoton>> blocks(kWalks / kBlock);
    const TechniqueCounts unguided{.connect = 1, .specular_depth = counts.specular_depth};
    pass.for_each_other_path(blocks.size(), [&](uint64_t b, Sampler&, Workspace& work) {
        Sampler sampler(SamplerKind::Independent, seed);
        RenderStats stats;  // not of the image
        const int longest = counts.specular_depth + 2;
        const WalkContext walk{pass.scene, unguided, stats, {longest, longest}};
        SubPath& y = work.y;
        for (uint64_t i = b * kBlock; i < (b + 1) * kBlock; ++i) {
            sampler.start(0, i);
            if (!start_light_path(walk, sampler, y)) continue;
            while (y.size() < longest && extend<TransportMode::Importance>(walk, sampler, y)) {
                const Vertex &v = y[y.size() - 1], &before = y[y.size() - 2];
                if (y.size() > 2 && !before.is_delta) break;
                if (y.size() > 2 && v.is_connectible)
                    blocks[b].push_back({v.p, side_normal(v), before.p, y[0].emitter->index});
            }
        }
    });
    std::vector<SeedPhoton> all;
    for (const std::vector<SeedPhoton>& block : blocks)
        all.insert(all.end(), block.begin(), block.end());
    return SeedPhotons(std::move(all));
}

}  // namespace

void Specular::prepare(const PassContext& pass, const DepthOptions& depth,
                       const TechniqueCounts& counts) {
    if (pass.film.passes() > 0 || counts.specular_depth == 0) return;
    photons_ = trace_photons(pass, counts);
    if (mode_ != Mode::Auto) return;
    is_used_ = run_specular_pilot(pass, depth, counts, photons_).is_worthwhile();
    if (!is_used_) photons_ = {};
}

void Specular::save(LearnedState& to) const {
    if (!is_on()) return;
    to.put(is_used_);
    if (is_used_) photons_.save(to);
}

void Specular::load(LearnedState& from) {
    if (!is_on()) return;
    from.get(is_used_);
    if (is_used_) photons_.load(from);
}

void Specular::add_figures(std::vector<std::pair<std::string, double>>& figures) const {
    if (mode_ == Mode::Auto) figures.push_back({"specular_connections", is_used_ ? 1 : 0});
}

}  // namespace etendue
