#include "integrator/guiding.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <map>

#include "integrator/guide_share.h"
#include "integrator/shared_by_pilots.h"
#include "math/hash.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

using Clock = std::chrono::steady_clock;

/// Walks of a block, which are recorded in order by one thread.
constexpr uint64_t kBlock = 256;
constexpr int kMostVertices = 10;

/// The start of a light walk, and its vertices with smooth lobes.
struct EmissionRecord {
    GuideSample sample;  ///< Of y_0, without weight; at infinity, of the direction to y_0.
    const Emitter* emitter;
    std::vector<PlacedWeight> reached;  ///< With the power that arrives there.
    PlacedWeight arrival;  ///< At y_1, with the part of the power that next events bring there.
};

struct Block {
    std::vector<GuideSample> samples;
    GuideTree::LeftOut left_out;     ///< What other joins find, and what the lens sees.
    std::vector<PlacedWeight> seen;  ///< By the lens.
    std::vector<EmissionRecord> emission;
    std::vector<ContributionRecord> contributions;
    double light_contribution = 0;  ///< Sum over the light walks.
};

/// Inverse of the distance along the edges from v_i to the next vertex where a walk scatters, with `step` 1 on the way or -1
/// back. Where there are mirrors or panes between, light seems to come from so far; curved ones may shift it.
float inv_seen_distance(const SubPath& path, int i, int step) {
    float distance = 0;
    for (int j = i + step; j >= 0 && j < path.size(); j += step) {
        if (path[j].is_infinite) return 0;
        distance += length(path[j].p - path[j - step].p);
        if (!path[j].is_delta) break;
    }
    return 1 / distance;
}

/// What walks in the other mode can learn at v_i of a walk in `mode`: the direction it came from. They would arrive from
/// where it went on to.
GuideSample sample_at(const SubPath& path, int i, TransportMode mode) {
    const Vertex& v = path[i];
    GuideSample s;
    s.p = v.p;
    s.inv_distance = inv_seen_distance(path, i, -1);
    s.direction = PackedDirection(v.wo);
    s.set_normal(side_normal(v));
    s.set_flux(luminance(v.beta));
    s.mode = uint8_t(mode == TransportMode::Radiance ? TransportMode::Importance
                                                     : TransportMode::Radiance);
    s.gloss_class = uint8_t(guide_class(v.gloss)) & 0xf;
    if (i + 1 < path.size() && !v.is_delta) {
        const Vec3 on = direction(v, path[i + 1]);
        s.unguided_pdf = v.eval_unguided(on, mode).pdf_rev /
                         (1 - v.bsdf.delta_probability(on, TransportMode(s.mode)));
    }
    return s;
}

/// Records what the walk can teach at v_i: the share of its light or importance that walks in the other mode find by the
/// direction. What the join with v_{i-1} finds is left out.
void record(const SubPath& path, int i, TransportMode mode, float share, Block& block) {
    GuideSample s = sample_at(path, i, mode);
    const Vertex& v = path[i];
    if (share < 1)
        block.left_out[s.mode].push_back({v.p, side_normal(v), luminance(v.beta) * (1 - share)});
    s.weight *= share;
    if (s.weight > 0) block.samples.push_back(s);
}

/// With the part of the light that next events bring.
Arrival arrival_of(const SubPath& y, float hits) {
    return {{y[1].p, side_normal(y[1]), luminance(y[1].beta) * (1 - hits)}, y[0].emitter->index};
}

void record_light_walk(const SubPath& y, const TechniqueCounts& n, Block& block) {
    PlacedWeight arrival;
    for (int i = 1; i < y.size(); ++i) {
        if (!y[i].is_connectible) continue;
        const float share = share_of_walks<TransportMode::Importance>(y, i, n);
        if (i == 1) arrival = arrival_of(y, share).at;
        record(y, i, TransportMode::Importance, share, block);
    }
    if (y.size() < 2) return;
    EmissionRecord r{{}, y[0].emitter, {}, arrival};
    for (int i = 1; i < y.size(); ++i)
        if (y[i].is_connectible)
            r.reached.push_back({y[i].p, side_normal(y[i]), luminance(y[i].beta)});
    r.sample.mode = uint8_t(TransportMode::Importance);
    if (y[0].is_infinite) {
        r.sample.direction = PackedDirection(y[0].p);
        r.sample.unguided_pdf = y[0].emitter->eval_infinite(y[0].p).pdf_y0;
    } else {
        const Vec3 w = direction(y[0], y[1]);
        r.sample.p = y[0].p;
        r.sample.inv_distance = inv_seen_distance(y, 0, 1);
        r.sample.direction = PackedDirection(w);
        if (y[0].emitter->emits_by_cosine()) r.sample.set_normal(y[0].ng);
        r.sample.unguided_pdf = y[0].eval_unguided(w, TransportMode::Importance).pdf;
    }
    if (!r.reached.empty()) block.emission.push_back(std::move(r));
}

void record_eye_walk(const SubPath& z, const TechniqueCounts& n, Block& block) {
    bool is_seen = true;  // by the lens, perhaps in mirrors or through panes
    for (int i = 1; i < z.size(); ++i) {
        if (z[i].is_connectible && z[i].kind == Vertex::Kind::Surface) {
            if (is_seen) block.seen.push_back({z[i].p, side_normal(z[i]), luminance(z[i].beta)});
            // Light walks are connected to the lens. Few hit it, and even fewer by way of a mirror.
            const float share = is_seen ? 0.0f : share_of_walks<TransportMode::Radiance>(z, i, n);
            record(z, i, TransportMode::Radiance, share, block);
        }
        is_seen = is_seen && z[i].is_delta;
    }
}

/// The contributions of a light walk and an eye walk to the image, by the number of their vertices that take part.
struct Contributions {
    using Sums = std::array<float, kMostVertices + 3>;
    Sums by_light{}, by_eye{};
    Sums hits{};    ///< A part of by_eye.
    Sums direct{};  ///< The same: of light that comes from emitters to the last of these vertices.

    /// From these numbers of vertices on.
    static void accumulate(Sums& sums) {
        for (size_t i = sums.size() - 1; i > 0; --i) sums[i - 1] += sums[i];
    }
};

/// Joins both walks as bidirectional path tracing does, as far as the counts have its techniques; each eye vertex is
/// connected to one vertex of the light walk, which stands for all. Splats are divided by the number of light paths. So many
/// eye walks share each light walk.
Contributions join_walks(const WalkContext& walk, GuidedLight light, int max_depth, float eye_walks,
                         Sampler& sampler, const SubPath& y, const SubPath& z) {
    const TechniqueCounts& n = walk.counts;
    Contributions all;
    const int shortest = light == GuidedLight::Indirect ? 3 : 1;  // in edges
    const auto value = [&](const Join& j) {
        if (j.technique.vertices() - 1 < shortest) return 0.0f;
        const float weighted = luminance(j.contribution) * j.mis_weight;
        return weighted > 0 ? weighted * visibility(walk.scene, j, walk.stats) : 0.0f;
    };
    for (int t = 2; n.hit > 0 && t <= z.size(); ++t) {
        for_each_hit(walk.scene, z, t, n, [&](const Join& j) {
            if (t - 1 < shortest) return;
            const float v = luminance(j.contribution) * j.mis_weight;
            all.by_eye[size_t(t)] += v;
            all.hits[size_t(t)] += v;
            all.direct[size_t(t) - 1] += v;
        });
        if (t > max_depth || !z[t - 1].is_connectible) continue;
        if (const auto j = join_next_event(walk.scene, z, t, sampler, n)) {
            const float v = value(*j);
            all.by_eye[size_t(t)] += v;
            all.direct[size_t(t)] += v;
        }
        const int choices = std::min(y.size(), max_depth - t + 1) - 1;
        if (n.connect == 0 || choices < 1) continue;
        sampler.seek(Stream::Selection, uint64_t(t));
        const int s = 2 + std::min(int(sampler.next_1d() * float(choices)), choices - 1);
        if (const auto j = join_connect(walk.scene, y, s, z, t, n)) {
            const float v = value(*j);
            all.by_eye[size_t(t)] += v * float(choices);
            all.by_light[size_t(s)] += v * float(choices) * eye_walks;
        }
    }
    for (int s = 2; n.splat > 0 && s <= std::min(y.size(), max_depth); ++s)
        if (const auto j = join_splat(walk.scene, y, s, sampler, n))
            all.by_light[size_t(s)] += value(*j) / n.splat;
    Contributions::accumulate(all.by_light);
    Contributions::accumulate(all.by_eye);
    return all;
}

/// What is not expected at a vertex of an eye walk. The expectation is that at z_1, since roulette compares with it: hits of
/// the vertex itself are over, and without direct light, none of what emitters send straight to it counts.
Contributions::Sums left_out_at_vertices(const Contributions& c, GuidedLight light) {
    Contributions::Sums sums = c.hits;
    if (light == GuidedLight::Indirect)
        for (size_t i = 0; i < sums.size(); ++i) sums[i] += c.direct[i];
    return sums;
}

/// Records what the walk contributed from its vertices on, at a vertex without `left_out`. Not of the later half, which the
/// limit of its length cuts short.
void record_contributions(const SubPath& path, TransportMode mode, int max_vertices,
                          const Contributions::Sums& sums, const Contributions::Sums& left_out,
                          std::vector<ContributionRecord>& records) {
    for (int i = 1; i < std::min(path.size(), std::max(2, max_vertices / 2)); ++i) {
        const Vertex& v = path[i];
        if (!v.is_connectible || v.kind != Vertex::Kind::Surface) continue;
        const auto vertices = size_t(i + 1);
        records.push_back({v.p, luminance(v.beta), sums[vertices] - left_out[vertices],
                           sums[vertices + 1], uint8_t(mode),
                           uint8_t(cube_face(facing_normal(v)))});
    }
}

/// Of the techniques of the method, those of bidirectional path tracing.
TechniqueCounts joins_of(GuidedWalks walks, uint64_t light_paths) {
    const float N = float(light_paths);
    switch (walks) {
    case GuidedWalks::Eye: return {.hit = 1, .next_event = 1};
    case GuidedWalks::Light: return {.splat = N};
    case GuidedWalks::Both:
    case GuidedWalks::BothWithPairs: break;
    }
    return {.hit = 1, .next_event = 1, .connect = 1, .splat = N};
}

/// Whether a method joins eye walks to light walks.
bool joins_both(GuidedWalks walks) {
    return walks == GuidedWalks::Both || walks == GuidedWalks::BothWithPairs;
}

/// Guided directions take time, so they must gain a little, and more where light walks have no other use than splats. With
/// 0.1 nats instead of 0.3, error times time of `path` was 18 % less on two-rooms and 13 % less on veach-bidir, and 5 % more
/// on veach-ajar, with a standard error of 6 %.
GuideLearning learning_at_surfaces(GuidedWalks walks, bool has_footprints) {
    GuideLearning learning{.has_footprints = has_footprints};
    if (walks != GuidedWalks::Light) learning.least_gain = 0.1f;
    return learning;
}

/// Light paths are learned by their splats, but other techniques need other ones. Pairs find the useful ones among all light
/// paths of a pass, which must not be alike.
GuideLearning learning_of_emission(GuidedWalks walks) {
    GuideLearning learning;
    if (walks == GuidedWalks::Both) learning.most_share = 0.7f;
    if (walks == GuidedWalks::BothWithPairs) learning.most_share = 0.3f;
    return learning;
}

/// What some walks record, by blocks. `trace(walk, i, sampler, work, records)` traces the i-th walk.
template <class Records, class Trace>
std::vector<Records> trace_in_blocks(const PassContext& pass, const TechniqueCounts& counts,
                                     const WalkOptions& options, uint64_t walks, uint64_t seed,
                                     const Trace& trace) {
    std::vector<Records> blocks((walks + kBlock - 1) / kBlock);
    pass.for_each_other_path(blocks.size(), [&](uint64_t b, Sampler&, Workspace& work) {
        Sampler sampler(SamplerKind::Independent, seed);
        RenderStats stats;  // not of the image
        const WalkContext walk{pass.scene, counts, stats, options};
        for (uint64_t i = b * kBlock; i < std::min(walks, (b + 1) * kBlock); ++i) {
            sampler.start(0, i);
            trace(walk, i, sampler, work, blocks[b]);
        }
    });
    return blocks;
}

template <class T>
void move_to_end(std::vector<T>& to, std::vector<T>& from) {
    to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
    from = {};
}

/// Evenly chosen pointers to at most so many of the samples.
std::vector<const GuideSample*> thinned(const std::vector<GuideSample>& samples) {
    constexpr size_t kMost = 8192;
    const size_t step = (samples.size() + kMost - 1) / kMost;
    std::vector<const GuideSample*> chosen;
    for (size_t i = 0; i < samples.size(); i += step) chosen.push_back(&samples[i]);
    return chosen;
}

double sum_of_flux(const std::vector<GuideSample>& samples) {
    double sum = 0;
    for (const GuideSample& s : samples) sum += double(s.flux());
    return sum;
}

/// Emission is learned by what walks bring to the places that the lens sees: an estimate of their splats.
void learn_emission(const Scene& scene, const std::vector<EmissionRecord>& records,
                    const PlacedDensity& importance, const GuideLearning& learning, uint64_t seed,
                    Guide& guide) {
    constexpr double kUnguided = 0.3;
    std::vector<GuideSample> finite;
    std::map<uint32_t, std::vector<GuideSample>> at_infinity;  // by Emitter::index
    std::vector<double> by_emitter(scene.emitters().size());
    double sum = 0;
    for (const EmissionRecord& r : records) {
        GuideSample s = r.sample;
        float flux = 0;
        for (const PlacedWeight& v : r.reached) flux += v.weight * float(importance(v.p, v.n));
        if (!(flux > 0 && flux < kInf)) continue;
        s.set_flux(flux);
        by_emitter[r.emitter->index] += double(flux);
        sum += double(flux);
        if (!r.emitter->is_infinite())
            finite.push_back(s);
        else if (!r.emitter->is_delta())
            at_infinity[r.emitter->index].push_back(s);
    }
    if (!(sum > 0)) return;
    guide.emission = GuideTree(finite, seed, learning);
    double gain = sum_of_flux(finite) * double(guide.emission.gain(TransportMode::Importance));
    for (const auto& [emitter, samples] : at_infinity) {
        const GuideFit fit = fit_guide(FitSamples::held_out(thinned(samples)), {},
                                       hash_combine(seed, emitter), learning);
        gain += sum_of_flux(samples) * double(fit.gain);
        guide.add_at_infinity({emitter, fit});
    }
    guide.emission_gain = float(gain / sum);
    if (!scene.has_emitter_choice()) return;
    for (size_t i = 0; i < by_emitter.size(); ++i)
        by_emitter[i] = kUnguided * double(scene.emitters()[i]->selection_pmf) +
                        (1 - kUnguided) * by_emitter[i] / sum;
    guide.set_emission(std::move(by_emitter));
}

/// The selection of emitters by next events is learned from the light that they bring. Where it gains little, that of
/// everywhere stays, which takes less time; the result is then empty.
LightSelections learned_lights(const Scene& scene, std::vector<Arrival> arrivals) {
    constexpr float kLeastGain = 0.1f;  // in nats
    std::vector<float> pmf;
    for (const auto& e : scene.emitters()) pmf.push_back(e->selection_pmf);
    LightSelections lights(std::move(arrivals), pmf);
    return lights.gain() >= kLeastGain ? std::move(lights) : LightSelections();
}

/// A guide of next events alone; nullptr where they select by power.
std::unique_ptr<Guide> guide_of_lights(LightSelections lights) {
    if (lights.is_empty()) return nullptr;
    auto guide = std::make_unique<Guide>();
    guide->lights = std::move(lights);
    return guide;
}

}  // namespace

std::vector<ParamInfo> Guiding::params(GuideRefits refits) {
    const char* walks =
        refits == GuideRefits::Never
            ? "Number of light walks, and of eye walks, that train the guide before the first pass."
            : "Number of light walks, and of eye walks, that train the guide before the first "
              "pass. A refit traces as many, before the first of passes 1, 4, 16, 64 … at which "
              "the image has had 8, 64, 512 … times as many samples.";
    return {{"guide", ParamKind::String, "off",
             "Learned directions for the walks: off, on, or auto (pilots compare both). hp02 "
             "(experimental, for comparisons) guides eye walks "
             "alone, by footprints of photons [Hey & Purgathofer 2002]."},
            {"guide_walks", ParamKind::Int, "100000", walks},
            {"guide_roulette", ParamKind::Bool, "true",
             "Adjoint-driven Russian roulette of guided walks: by the contribution that earlier "
             "walks had from the same place on. Has no effect if `guide` is off."}};
}

std::vector<ParamInfo> Guiding::lights_params() {
    return {{"lights", ParamKind::String, "learned",
             "How next events select one of several emitters. learned: by the light that some "
             "walks before the first pass bring to each place, if that gains enough. power: by "
             "power, at every place. See the page on guided walks."}};
}

Guiding::Guiding(const IntegratorParams& p) {
    // Before there is an integrator, pilots replace auto by off or on; see with_chosen_method().
    constexpr std::array<Choice<Mode>, 4> kModes{
        {{"off", Mode::Off}, {"on", Mode::On}, {"auto", Mode::Off}, {"hp02", Mode::Footprints}}};
    mode_ = p.choice("guide", kModes);
    walks_ = uint64_t(p.integer("guide_walks", 256, 1 << 20));
    has_roulette_ = p.flag("guide_roulette");
    constexpr std::array<Choice<bool>, 2> kLights{{{"learned", true}, {"power", false}}};
    learns_lights_ = p.has("lights") && p.choice("lights", kLights);
    given_ = p.given_guide();
    pilots_ = p.shared_by_pilots();
}

bool Guiding::may_gain(const Guide& guide, GuidedWalks walks) {
    constexpr float kLeastGain = 0.01f;  // in nats; less is what samples happen to say
    const bool eye = guide.surfaces.gain(TransportMode::Radiance) >= kLeastGain,
               light = guide.surfaces.gain(TransportMode::Importance) >= kLeastGain,
               emission = guide.emission_gain >= kLeastGain;
    switch (walks) {
    case GuidedWalks::Eye: return eye;
    case GuidedWalks::Light: return light || emission;
    case GuidedWalks::Both:
    case GuidedWalks::BothWithPairs: break;
    }
    return eye || light || emission;
}

bool Guiding::gains_nothing(const Guide& guide, GuidedWalks walks) const {
    // Neither what emission gains nor adjoint-driven roulette depends on them. Of the scenes in docs/guiding.md, one gains 3
    // nats, and all others at most 1.2: on mirror-box, with 1.1, guided directions make a sample worse.
    constexpr float kLeastGain = 2;
    return joins_both(walks) && mode_ != Mode::Footprints &&
           std::max(guide.surfaces.gain(TransportMode::Radiance),
                    guide.surfaces.gain(TransportMode::Importance)) < kLeastGain;
}

void Guiding::train(const PassContext& pass, const TechniqueCounts& counts,
                    const DepthOptions& depth, GuidedWalks walks, GuidedLight light) {
    if (!pass.scene.has_emitters()) return;
    const auto begin = Clock::now();
    const bool selects = counts.next_event > 0 && selects_lights(pass.scene);
    if (is_on())
        train_walks(pass, depth, walks, light, selects);
    else if (selects && pass.film.passes() == 0)
        guide_ = guide_of_lights(trained_lights(pass, depth));
    else
        return;
    seconds_ += std::chrono::duration<double>(Clock::now() - begin).count();
}

LightSelections Guiding::trained_lights(const PassContext& pass, const DepthOptions& depth) const {
    constexpr uint64_t kWalks = 20000;
    if (pilots_ && pilots_->lights) return *pilots_->lights;
    const uint64_t seed = pilot_seed(pass.seed, PilotUse::Lights);
    WalkOptions options = depth.walk();
    options.max_vertices = std::min(options.max_vertices, 3);
    auto blocks = trace_in_blocks<std::vector<Arrival>>(
        pass, joins_of(GuidedWalks::Both, 1), options, kWalks, seed,
        [](const WalkContext& walk, uint64_t, Sampler& sampler, Workspace& work,
           std::vector<Arrival>& block) {
            trace_light_path(walk, sampler, work.y);
            if (work.y.size() > 1 && work.y[1].is_connectible)
                block.push_back(arrival_of(
                    work.y, share_of_walks<TransportMode::Importance>(work.y, 1, walk.counts)));
        });
    std::vector<Arrival> arrivals;
    for (std::vector<Arrival>& b : blocks) move_to_end(arrivals, b);
    LightSelections lights = learned_lights(pass.scene, std::move(arrivals));
    if (pilots_) pilots_->lights = lights;
    return lights;
}

void Guiding::train_walks(const PassContext& pass, const DepthOptions& depth, GuidedWalks walks,
                          GuidedLight light, bool selects_lights) {
    constexpr int kRounds = 4;  // Each has twice the walks of the last.
    constexpr uint64_t kFirstPart = (1 << kRounds) - 1;
    const auto passes = uint32_t(pass.film.passes());
    const uint64_t refits =
        (std::bit_width(std::max<uint64_t>(1, passes * pass.pixels / walks_)) - 1) / 3;
    // As many walks would not gain more where a guide gains nothing.
    const bool has_gain = guide_ && (guide_->uses_surfaces || !guide_->lights.is_empty()),
               is_due = passes == 0 || (has_gain && refits > refits_);
    if (!is_due) return;
    const uint64_t seed = pilot_seed(pass.seed, PilotUse::Guide, passes);
    // The pass may be dropped at any time, and traced again: nothing may be left of this training then.
    std::unique_ptr<Guide> next;
    if (given_) {
        next = std::make_unique<Guide>(*given_);
    } else if (passes == 0) {
        for (int round = 0; round < kRounds; ++round) {
            if (next) next->make_teacher();
            next = trained(pass, depth, walks, light, next.get(), (walks_ / kFirstPart) << round,
                           hash_combine(seed, uint64_t(round)),
                           has_roulette_ && round == kRounds - 1, selects_lights);
        }
    } else {
        Guide teacher = *guide_;
        teacher.make_teacher();
        next = trained(pass, depth, walks, light, &teacher, walks_, seed, has_roulette_,
                       selects_lights);
    }
    next->has_roulette = has_roulette_;
    if (!given_) next->uses_surfaces = !gains_nothing(*next, walks);
    guide_ = std::move(next);
    refits_ = refits;
}

std::unique_ptr<Guide> Guiding::trained(const PassContext& pass, const DepthOptions& depth,
                                        GuidedWalks guided, GuidedLight light, const Guide* teacher,
                                        uint64_t walks, uint64_t seed, bool for_roulette,
                                        bool selects_lights) const {
    TechniqueCounts counts = joins_of(for_roulette ? guided : GuidedWalks::Both, pass.light_paths);
    TechniqueCounts competing = joins_of(GuidedWalks::Both, pass.light_paths);
    if (!joins_both(guided)) competing.connect = 0;
    counts.guide = teacher;
    const float eye_walks = float(pass.pixels) / float(std::max<uint64_t>(pass.light_paths, 1));
    WalkOptions options = depth.walk();
    options.max_vertices = std::min(options.max_vertices, kMostVertices + 1);
    const auto trace = [&](const WalkContext& walk, uint64_t i, Sampler& sampler, Workspace& work,
                           Block& block) {
        trace_light_path(walk, sampler, work.y);
        record_light_walk(work.y, competing, block);
        trace_eye_path(walk, pass.film, mix64(seed + i) % pass.pixels, sampler, work.z);
        record_eye_walk(work.z, competing, block);
        if (!for_roulette) return;
        const Contributions c =
            join_walks(walk, light, depth.max_depth, eye_walks, sampler, work.y, work.z);
        // As in the records, one value that is not finite would be all that is learned.
        if (c.by_light[0] < kInf) block.light_contribution += double(c.by_light[0]);
        record_contributions(work.y, TransportMode::Importance, options.max_vertices, c.by_light,
                             {}, block.contributions);
        record_contributions(work.z, TransportMode::Radiance, options.max_vertices, c.by_eye,
                             left_out_at_vertices(c, light), block.contributions);
    };
    Block all;
    for (Block& b : trace_in_blocks<Block>(pass, counts, options, walks, seed, trace)) {
        move_to_end(all.samples, b.samples);
        for (size_t m = 0; m < 2; ++m) move_to_end(all.left_out[m], b.left_out[m]);
        move_to_end(all.seen, b.seen);
        move_to_end(all.emission, b.emission);
        move_to_end(all.contributions, b.contributions);
        all.light_contribution += b.light_contribution;
    }
    auto guide = std::make_unique<Guide>();
    guide->surfaces = GuideTree(
        all.samples, seed, learning_at_surfaces(guided, mode_ == Mode::Footprints), all.left_out);
    if (!guide->surfaces.is_empty()) guide->surfaces.set_contributions(all.contributions);
    guide->light_contribution = float(all.light_contribution / double(walks));
    if (selects_lights) {
        std::vector<Arrival> arrivals;
        for (const EmissionRecord& r : all.emission)
            arrivals.push_back({r.arrival, r.emitter->index});
        guide->lights = learned_lights(pass.scene, std::move(arrivals));
    }
    if (mode_ != Mode::Footprints) {
        learn_emission(pass.scene, all.emission, PlacedDensity(std::move(all.seen)),
                       learning_of_emission(guided), hash_combine(seed, 1), *guide);
    }
    return guide;
}

void Guiding::save(LearnedState& to) const {
    to.put(refits_);
    to.put(seconds_);
    to.put(guide_ != nullptr);
    if (guide_) guide_->save(to);
}

void Guiding::load(LearnedState& from) {
    from.get(refits_);
    from.get(seconds_);
    bool has_guide = false;
    from.get(has_guide);
    guide_ = has_guide ? std::make_unique<Guide>() : nullptr;
    if (guide_) guide_->load(from);
}

std::vector<std::pair<std::string, double>> Guiding::figures() const {
    std::vector<std::pair<std::string, double>> figures;
    add_figures(figures);
    return figures;
}

void Guiding::add_figures(std::vector<std::pair<std::string, double>>& figures) const {
    if (is_on() || seconds_ > 0) {
        figures.push_back({"guided", guides_walks() ? 1 : 0});
        figures.push_back({"guide_seconds", seconds_});
        figures.push_back({"guide_gain_lights", guide_ ? double(guide_->lights.gain()) : 0.0});
    }
    if (guide_) figures.push_back({"guide_bytes", double(guide_->memory_bytes())});
    if (!guides_walks()) return;
    figures.push_back({"guided_surfaces", guide_->guides_surfaces() ? 1 : 0});
    figures.push_back({"guide_cells", double(guide_->surfaces.cells().size())});
    figures.push_back({"guide_gain_eye", double(guide_->surfaces.gain(TransportMode::Radiance))});
    figures.push_back(
        {"guide_gain_light", double(guide_->surfaces.gain(TransportMode::Importance))});
    figures.push_back({"guide_gain_emission", double(guide_->emission_gain)});
}

}  // namespace etendue
