// Multiplexed Metropolis light transport [Hachisuka et al. 2014]: a state is one path made by one technique, which one
// of its random numbers chooses. Each path length has its own chains. Unbiased.
//
// The contribution of C(s,t) of length k is C·w/p(s|k), with the weights of bidirectional path tracing. A pilot fixes
// p(s|k): four fifths are proportional to the energy of each technique, and one fifth is uniform. The walks of states have no
// Russian roulette, not even that of a guide; those of the samples in which chains find their first states have. The last class
// contains all longer paths; its states also choose their length, four fifths in proportion to the energy of each length, and
// one fifth from a geometric distribution. Only large and block steps change the technique and the length.

#include "integrator/mmlt.h"

#include <algorithm>
#include <cmath>

#include "integrator/markov.h"
#include "math/hash.h"
#include "mcmc/addresses.h"
#include "mcmc/technique_choice.h"

namespace etendue {
namespace {

/// Length and technique of a path.
class PathChoice {
public:
    /// The classes are the lengths from `shortest` on. The last class also contains all longer paths, up to `longest`.
    PathChoice(const Scene& scene, int shortest, int classes, int longest,
               const TechniqueLight& light)
        : shortest_(shortest), classes_(classes), longest_(longest),
          longer_(shortest + classes - 1, longest, light),
          technique_(scene, shortest, classes + kTabulated, light) {}

    struct Chosen {
        int s, t;
        double pmf;
    };
    /// Reads `u_length` only if has_length_choice().
    Chosen choose(int chain_class, double u_length, double u_s) const {
        const bool has_choice = has_length_choice(chain_class);
        const int k = has_choice ? longer_.choose(u_length) : shortest_ + chain_class;
        const int s = technique_.choose(k, u_s);
        return {s, k + 1 - s, (has_choice ? longer_.pmf(k) : 1.0) * technique_.pmf(k, s)};
    }
    int class_of(int k) const { return std::min(k - shortest_, classes_ - 1); }
    /// The inverse of choose(): numbers that choose C(s, k+1-s), uniformly distributed among these if v is so.
    double length_number(int k, double v) const { return longer_.number(k, v); }
    double technique_number(int k, int s, double v) const { return technique_.number(k, s, v); }
    bool has_length_choice(int chain_class) const {
        return chain_class == classes_ - 1 && shortest_ + chain_class < longest_;
    }

private:
    /// Number of lengths of the last class for which the pilot's statistics of techniques are used.
    static constexpr int kTabulated = 16;

    int shortest_, classes_, longest_;
    LengthChoice longer_;  ///< Of the last class.
    TechniqueChoice technique_;
};

/// States of single techniques, which samples of bidirectional path tracing find: the numbers of such a sample are those of
/// a state for each of its joins, together with numbers that choose the technique.
class TechniqueSpace final : public PrimarySpace {
public:
    TechniqueSpace(int classes, PrimarySample state, WeighedSample samples,
                   std::shared_ptr<const PathChoice> choice)
        : PrimarySpace(classes, std::move(state), samples.map), samples_(std::move(samples)),
          choice_(std::move(choice)) {}

    void sample(uint64_t key, const ChainContext& c, std::vector<Find>& finds) const override {
        NumberTable numbers;
        int32_t part = 0;
        for_each_part(key, c, numbers, [&](const Join& join, double weight) {
            finds.push_back(
                {key, part++, choice_->class_of(join.technique.vertices() - 1), weight});
        });
    }
    void recall(const Find& find, const ChainContext& c, ChainState& y) const override {
        if (find.part == Find::kLargeStep) return draw(find.chain_class, find.key, c, y);
        NumberTable numbers;
        int32_t part = 0;
        int k = 0, s = 0;
        for_each_part(find.key, c, numbers, [&](const Join& join, double) {
            if (part++ == find.part) k = join.technique.vertices() - 1, s = join.technique.s;
        });
        const auto choose = [&](uint32_t slot, double number) {
            numbers.set(NumberTable::place(Stream::Selection, addresses::kKind, slot),
                        uint32_t(std::min(number * 0x1p32, 0x1p32 - 1)));
        };
        const uint64_t key = hash_combine(find.key, uint64_t(find.part));
        choose(0, choice_->length_number(k, to_unit_double(hash_combine(key, 0))));
        choose(1, choice_->technique_number(k, s, to_unit_double(hash_combine(key, 1))));
        NumberSource source(NumberStep::Same, key, &numbers, &static_cast<NumberState&>(y).numbers);
        evaluate(find.chain_class, source, c, y);
    }

private:
    template <class Use>
    void for_each_part(uint64_t key, const ChainContext& c, NumberTable& numbers,
                       const Use& use) const {
        NumberSource source(NumberStep::Fresh, key, nullptr, &numbers);
        Sampler sampler(source);
        samples_.for_each_part(sampler, c, use);
    }

    WeighedSample samples_;
    std::shared_ptr<const PathChoice> choice_;
};

class MmltIntegrator final : public MarkovIntegrator {
public:
    explicit MmltIntegrator(const IntegratorParams& p)
        : MarkovIntegrator(p, DepthOptions::from(p), {.correlation = 15, .cost = 1.25}, Guiding(p)),
          lengths_(p.integer("lengths", 1, 64)) {}

protected:
    Chains begin(const PassContext& pass, const Pilot& pilot) override {
        const TechniqueCounts n = guided_counts(pass.scene);
        const int longest = paths_.max_depth();
        const int classes = std::min(lengths_, longest - kShortest + 1);
        const auto choice = std::make_shared<PathChoice>(pass.scene, kShortest, classes, longest,
                                                         pilot.by_technique);
        PrimarySample sample = [this, n, choice](int k, const SampleContext& c, Workspace& work) {
            c.sampler.seek(Stream::Selection, addresses::kKind);
            const double u_length = c.sampler.next_1d_fine_if(choice->has_length_choice(k));
            const auto q = choice->choose(k, u_length, c.sampler.next_1d_fine());
            add_technique(c, n, q.s, q.t, float(1 / q.pmf), work);
        };
        return chains_of_paths(std::make_unique<TechniqueSpace>(classes, std::move(sample),
                                                                samples_of_paths(pass.scene, pilot),
                                                                choice),
                               plan(pilot, classes), pool_samples(pilot.precise_samples, options_));
    }

private:
    /// Adds only C(s,t), times `factor`. Traces sub-paths of s and t vertices.
    void add_technique(const SampleContext& c, const TechniqueCounts& n, int s, int t, float factor,
                       Workspace& work) const {
        const auto add = [&](const std::optional<Join>& j) { paths_.add(c, j, work, factor); };
        SubPath &y = work.y, &z = work.z;
        // A state reads no numbers of roulette. Those of a find are not uniform: its walk, which has other probabilities of
        // survival, has left a part of them.
        const auto upto = [&](int vertices) {
            WalkOptions options = paths_.depth().walk();
            options.max_vertices = vertices;
            return options;
        };
        // The last flight of C(s,0) ends on the lens. Its ray also hits the surface behind the lens, which is not needed.
        const WalkContext light{c.scene, n, work.stats, upto(s)};
        const WalkContext eye{c.scene, n, work.stats, upto(t)};
        if (s >= 2) {
            if (!start_light_path(light, c.sampler, y)) return;
            // The loop must not take another step, since that would overwrite y.flight.
            while (y.size() < s && extend<TransportMode::Importance>(light, c.sampler, y)) {
            }
            if (t == 0 && y.size() >= s - 1) return add(join_hit_lens(c.scene, y, s - 1, n));
            if (y.size() < s) return;
            if (t == 1) return add(join_splat(c.scene, y, s, c.sampler, n));
        }
        trace_eye_path(eye, c, z);
        if (z.size() < t) return;
        if (s == 0)
            paths_.add_hits(c, n, t, work, factor);
        else if (paths_.is_joinable(z, t))
            add(s == 1 ? join_next_event(c.scene, z, t, c.sampler, n)
                       : join_connect(c.scene, y, s, z, t, n));
    }

    std::vector<ClassPlan> plan(const Pilot& pilot, int classes) const {
        std::vector<double> b(size_t(classes), 0.0), cost;
        for (const auto& [technique, value] : pilot.by_technique)
            b[size_t(std::clamp(technique.first - kShortest, 0, classes - 1))] += value;
        for (int i = 0; i < classes; ++i) cost.push_back(double(kShortest + i));
        return share_out(pilot.constant(), std::move(b), cost, options_.chains);
    }

    int lengths_;
};

}  // namespace

IntegratorEntry mmlt_entry() {
    return {{"integrator", "mmlt",
             "Multiplexed Metropolis light transport: each state is one path of one technique, and "
             "each path length has its own chains. Unbiased.",
             concat({{depth_params()[0]},
                     MarkovIntegrator::params(),
                     {{"lengths", ParamKind::Int, "10",
                       "Number of classes of path lengths, 1 to 64, from three edges on; each has "
                       "its own chains. The last class contains all longer paths."}},
                     Guiding::lights_params(),
                     Guiding::params(GuideRefits::Never)})},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<MmltIntegrator>(p);
            }};
}

}  // namespace etendue
