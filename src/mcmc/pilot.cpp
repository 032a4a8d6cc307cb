#include "mcmc/pilot.h"

#include <algorithm>
#include <cmath>

#include "math/statistics.h"
#include "mcmc/whole_film.h"

namespace etendue {
namespace {

struct PilotSplat {
    Vec2 film;
    float luminance;
    int edges, s;
};

}  // namespace

void Pilot::save(LearnedState& to) const {
    map.save(to);
    to.put(b);
    to.put(relative_variance);
    to.put(samples);
    to.put(precise_samples);
    to.put(uint64_t(by_technique.size()));
    for (const auto& [technique, value] : by_technique) {
        to.put(technique.first);
        to.put(technique.second);
        to.put(value);
    }
}

void Pilot::load(LearnedState& from) {
    map.load(from);
    from.get(b);
    from.get(relative_variance);
    from.get(samples);
    from.get(precise_samples);
    uint64_t techniques = 0;
    from.get(techniques);
    by_technique.clear();
    for (uint64_t i = 0; i < techniques; ++i) {
        std::pair<int, int> technique;
        from.get(technique.first);
        from.get(technique.second);
        from.get(by_technique[technique]);
    }
}

uint64_t pool_samples(uint64_t precise_samples, const ChainOptions& options) {
    return std::max(precise_samples / 4, uint64_t(4 * options.chains));
}

Pilot run_pilot(const PassContext& pass, const PrimarySample& sample) {
    constexpr uint64_t kFewest = 1024, kMost = uint64_t(1) << 18;
    constexpr double kPrecision = 0.02;
    const uint64_t most = std::clamp(2 * pass.pixels, kFewest, kMost);
    const uint64_t seed = hash_combine(pass.seed, 0x70696c6f74);
    std::vector<std::vector<PilotSplat>> splats;
    Pilot pilot{.map = TargetMap(pass.film.geometry()), .by_technique = {}};
    while (true) {
        const uint64_t done = splats.size();
        splats.resize(std::min(most, std::max(kFewest, 2 * done)));
        const auto trace = [&](uint64_t i, Sampler&, Workspace& work) {
            const WholeFilm whole(pass);
            NumberTable numbers;
            NumberSource source(NumberStep::Fresh, hash_combine(seed, done + i), nullptr, &numbers);
            ChainState state;
            SplatCollector collector(pass.film, nullptr, state, work);
            collector.observer = [&](const Join& j, double luminance) {
                splats[done + i].push_back(
                    {j.film, float(luminance), j.technique.vertices() - 1, j.technique.s});
            };
            evaluate_sample(sample, 0, source, {whole.sample, work}, collector);
        };
        pass.for_each_other_path(splats.size() - done, trace);
        pilot.map = TargetMap(pass.film.geometry(), splats.size());
        for (const auto& of_sample : splats)
            for (const PilotSplat& s : of_sample) pilot.map.add(s.film, double(s.luminance));
        pilot.map.learn();

        Moments target;
        pilot.by_technique.clear();
        for (const auto& of_sample : splats) {
            double sum = 0;
            for (const PilotSplat& s : of_sample) {
                const double value = double(s.luminance) * pilot.map(s.film);
                sum += value;
                pilot.by_technique[{s.edges, s.s}] += value / double(splats.size());
            }
            target.add(sum);
        }
        pilot.samples = splats.size();
        pilot.b = target.mean();
        pilot.relative_variance = pilot.b > 0 ? target.variance() / sqr(pilot.b) : 0;
        // As many again have the same error.
        const double error = std::sqrt(pilot.relative_variance / double(pilot.samples));
        const bool is_precise = pilot.b > 0 && error <= kPrecision;
        if (!is_precise || pilot.precise_samples == 0) pilot.precise_samples = pilot.samples;
        if (pilot.samples >= most || (is_precise && pilot.samples >= pass.pixels)) return pilot;
    }
}

}  // namespace etendue
