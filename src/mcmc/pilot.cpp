#include "mcmc/pilot.h"

#include <algorithm>
#include <cmath>

#include "math/statistics.h"
#include "mcmc/whole_film.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

struct PilotSplat {
    Vec2 film;
    float luminance;
    int edges, s;
};
using PilotSplats = std::vector<PilotSplat>;

/// One sample of the pilot, and two of direct light through the same film point.
struct PilotSample {
    PilotSplats splats, direct, other_direct;
};

PilotSplats draw(const PassContext& pass, const PrimarySample& sample, NumberSource& source,
                 const ChainContext& c) {
    PilotSplats splats;
    ChainState state;
    SplatCollector collector(pass.film, nullptr, state, c.work);
    collector.observer = [&](const Join& j, double luminance) {
        splats.push_back({j.film, float(luminance), j.technique.vertices() - 1, j.technique.s});
    };
    evaluate_sample(sample, 0, source, c, collector);
    return splats;
}

PilotSample draw(const PassContext& pass, const PrimarySample& sample, const PrimarySample& direct,
                 uint64_t key, Workspace& work) {
    const WholeFilm whole(pass);
    const ChainContext c{whole.sample, work};
    PilotSample out;
    NumberTable numbers;
    NumberSource source(NumberStep::Fresh, key, nullptr, &numbers);
    out.splats = draw(pass, sample, source, c);

    constexpr uint64_t kDirect = 0x646972656374;
    const uint64_t direct_key = hash_combine(key, kDirect);
    NumberTable film_point;
    for (uint32_t slot : {0u, 1u})
        film_point.set(NumberTable::place(Stream::Eye, 0, slot),
                       uint32_t(hash_combine(direct_key, slot) >> 32));
    for (PilotSplats* to : {&out.direct, &out.other_direct}) {
        const uint64_t k = hash_combine(direct_key, to == &out.direct ? 2 : 3);
        NumberSource others(NumberStep::Same, k, &film_point, &numbers);
        *to = draw(pass, direct, others, c);
    }
    return out;
}

double weighted(const PilotSplats& splats, const TargetMap& map) {
    double sum = 0;
    for (const PilotSplat& s : splats) sum += double(s.luminance) * map(s.film);
    return sum;
}

}  // namespace

void Pilot::save(LearnedState& to) const {
    map.save(to);
    to.put(b);
    to.put(relative_variance);
    to.put(direct_variance);
    to.put(chain_variance);
    to.put(typical);
    to.put(samples);
    to.put(precise_samples);
    for (const TechniqueLight* light : {&by_technique, &by_unguided_technique}) {
        to.put(uint64_t(light->size()));
        for (const auto& [technique, value] : *light) {
            to.put(technique.first);
            to.put(technique.second);
            to.put(value);
        }
    }
}

void Pilot::load(LearnedState& from) {
    map.load(from);
    from.get(b);
    from.get(relative_variance);
    from.get(direct_variance);
    from.get(chain_variance);
    from.get(typical);
    from.get(samples);
    from.get(precise_samples);
    for (TechniqueLight* light : {&by_technique, &by_unguided_technique}) {
        uint64_t techniques = 0;
        from.get(techniques);
        light->clear();
        for (uint64_t i = 0; i < techniques; ++i) {
            std::pair<int, int> technique;
            from.get(technique.first);
            from.get(technique.second);
            from.get((*light)[technique]);
        }
    }
}

uint64_t pool_samples(uint64_t precise_samples, const ChainOptions& options) {
    return std::max(precise_samples / 4, uint64_t(4 * options.chains));
}

TechniqueLight unguided_light(const PassContext& pass, const PrimarySample& unguided,
                              const Pilot& pilot) {
    const uint64_t seed = hash_combine(pilot_seed(pass.seed, PilotUse::Chains), 1);
    std::vector<PilotSplats> drawn(pilot.precise_samples);
    pass.for_each_other_path(drawn.size(), [&](uint64_t i, Sampler&, Workspace& work) {
        const WholeFilm whole(pass);
        NumberTable numbers;
        NumberSource source(NumberStep::Fresh, hash_combine(seed, i), nullptr, &numbers);
        drawn[i] = draw(pass, unguided, source, {whole.sample, work});
    });
    TechniqueLight light;
    for (const PilotSplats& splats : drawn)
        for (const PilotSplat& s : splats)
            light[{s.edges, s.s}] += double(s.luminance) * pilot.map(s.film) / double(drawn.size());
    return light;
}

Pilot run_pilot(const PassContext& pass, const PrimarySample& sample, const PrimarySample& direct) {
    constexpr uint64_t kFewest = 1024, kMost = uint64_t(1) << 18;
    constexpr double kPrecision = 0.02;
    const uint64_t most = std::clamp(2 * pass.pixels, kFewest, kMost);
    const uint64_t seed = pilot_seed(pass.seed, PilotUse::Chains);
    std::vector<PilotSample> drawn;
    Pilot pilot{.map = TargetMap(pass.film.geometry()), .by_technique = {}};
    while (true) {
        const uint64_t done = drawn.size();
        drawn.resize(std::min(most, std::max(kFewest, 2 * done)));
        pass.for_each_other_path(drawn.size() - done, [&](uint64_t i, Sampler&, Workspace& work) {
            drawn[done + i] = draw(pass, sample, direct, hash_combine(seed, done + i), work);
        });
        pilot.map = TargetMap(pass.film.geometry(), drawn.size());
        TargetMap all = pilot.map;  // with direct light
        for (const PilotSample& of : drawn) {
            for (const PilotSplat& s : of.splats) {
                pilot.map.add(s.film, double(s.luminance));
                all.add(s.film, double(s.luminance));
            }
            for (const PilotSplats* splats : {&of.direct, &of.other_direct})
                for (const PilotSplat& s : *splats) all.add(s.film, double(s.luminance) / 2);
        }
        pilot.map.learn();
        all.learn();

        Moments target, direct_variance, chain_variance;
        pilot.by_technique.clear();
        std::vector<WeightedValue> targets;
        for (const PilotSample& of : drawn) {
            double sum = 0, noise = 0;
            for (const PilotSplat& s : of.splats) {
                const double W = pilot.map(s.film), value = double(s.luminance) * W;
                sum += value;
                noise += value * sqr(all(s.film) / W);
                pilot.by_technique[{s.edges, s.s}] += value / double(drawn.size());
            }
            target.add(sum);
            targets.push_back({sum, sum});
            chain_variance.add(noise);
            direct_variance.add(sqr(weighted(of.direct, all) - weighted(of.other_direct, all)) / 2);
        }
        pilot.samples = drawn.size();
        pilot.typical = weighted_median(std::move(targets));
        pilot.b = target.mean();
        pilot.relative_variance = pilot.b > 0 ? target.variance() / sqr(pilot.b) : 0;
        pilot.direct_variance = direct_variance.mean();
        pilot.chain_variance = pilot.b * chain_variance.mean();
        // As many again have the same error.
        const double error = std::sqrt(pilot.relative_variance / double(pilot.samples));
        const bool is_precise = pilot.b > 0 && error <= kPrecision;
        if (!is_precise || pilot.precise_samples == 0) pilot.precise_samples = pilot.samples;
        if (pilot.samples >= most || (is_precise && pilot.samples >= pass.pixels)) return pilot;
    }
}

}  // namespace etendue
