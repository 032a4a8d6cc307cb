// Multiplexed Metropolis light transport [Hachisuka et al. 2014]: a state is one path of one technique, which a number of
// its own chooses; each path length has chains of its own. Unbiased.
//
// C(s,t) of length k brings C·w/p(s|k), with the weights of bidirectional path tracing. p(s|k) is fixed by a pilot: by the
// energy of each technique, and a fifth uniformly. Walks have no roulette. The last class holds all longer paths: its
// states choose their length too, from a geometric distribution. Technique and length change in large and block steps only.

#include "integrator/mmlt.h"

#include <algorithm>
#include <cmath>

#include "integrator/markov.h"
#include "mcmc/technique_choice.h"

namespace etendue {
namespace {

/// Length and technique of a path.
class PathChoice {
public:
    /// Classes are the lengths from `shortest` on, the last one all that are longer too, up to `longest`.
    PathChoice(int shortest, int classes, int longest, const TechniqueChoice& technique)
        : shortest_(shortest), classes_(classes), longest_(longest), technique_(technique) {}

    struct Chosen {
        int s, t;
        double pmf;
    };
    /// `u_length` is read where has_length_choice().
    Chosen choose(int chain_class, double u_length, double u_s) const {
        int k = shortest_ + chain_class;
        double pmf = 1;
        if (has_length_choice(chain_class)) {
            // Geometric, cut off at the longest: P(k+j) = (1-r) r^j, all the rest at the last one.
            const int most = longest_ - k;
            const int j = std::min(most, int(std::log1p(-u_length) / std::log(kLonger)));
            pmf = std::pow(kLonger, j) * (j == most ? 1 : 1 - kLonger);
            k += j;
        }
        const int s = technique_.choose(k, u_s);
        return {s, k + 1 - s, pmf * technique_.pmf(k, s)};
    }
    bool has_length_choice(int chain_class) const {
        return chain_class == classes_ - 1 && shortest_ + chain_class < longest_;
    }
    /// Lengths of the last class whose techniques a pilot may have learned.
    static constexpr int kTabulated = 16;

private:
    static constexpr double kLonger = 0.75;

    int shortest_, classes_, longest_;
    TechniqueChoice technique_;
};

class MmltIntegrator final : public MarkovIntegrator {
public:
    explicit MmltIntegrator(const IntegratorParams& p)
        : MarkovIntegrator(p, DepthOptions::without_roulette(p)),
          lengths_(p.integer("lengths", 1, 64)) {}

protected:
    Chains begin(const PassContext& pass, const Pilot& pilot) override {
        const TechniqueCounts n = counts(pass.scene, 0);
        const int longest = paths_.max_depth();
        const int classes = std::min(lengths_, longest - kShortest + 1);
        const auto choice = std::make_shared<PathChoice>(
            kShortest, classes, longest,
            TechniqueChoice(kShortest, classes + PathChoice::kTabulated, hits_emitters(pass.scene),
                            n.hit_lens > 0, pilot));
        PrimarySample sample = [this, n, choice](int k, const SampleContext& c, Workspace& work) {
            c.sampler.seek(Stream::Selection, 0);
            const double u_length = c.sampler.next_1d_fine_if(choice->has_length_choice(k));
            const auto q = choice->choose(k, u_length, c.sampler.next_1d_fine());
            paths_.add_technique(c, n, q.s, q.t, float(1 / q.pmf), work);
        };
        std::vector<ClassPlan> plan = shared_out(pilot, classes);
        return {std::make_unique<PrimarySpace>(classes, std::move(sample), pilot.map),
                std::move(plan)};
    }

private:
    /// Chains by b_k/√k: steps on longer paths take longer.
    std::vector<ClassPlan> shared_out(const Pilot& pilot, int classes) const {
        constexpr int kFewest = 4;
        constexpr uint64_t kSmallestPool = 64;
        std::vector<double> b(size_t(classes), 0.0), share(b);
        for (const auto& [technique, value] : pilot.by_technique)
            b[size_t(std::clamp(technique.first - kShortest, 0, classes - 1))] += value;
        double total = 0;
        for (int i = 0; i < classes; ++i)
            total += share[size_t(i)] = b[size_t(i)] / std::sqrt(double(kShortest + i));
        const uint64_t pool = pool_samples(4 * pilot.samples, options_);
        const int spare = std::max(0, options_.chains - kFewest * classes);
        std::vector<ClassPlan> plan;
        double sum = 0;
        int given = 0;
        for (int i = 0; i < classes; ++i) {
            sum += total > 0 ? share[size_t(i)] / total : 1.0 / classes;
            const int upto = int(std::lround(sum * spare));
            const int chains = kFewest + upto - given;
            given = upto;
            plan.push_back({.chains = chains,
                            .pool = std::max(kSmallestPool,
                                             pool * uint64_t(chains) / uint64_t(options_.chains)),
                            .c = b[size_t(i)]});
        }
        return plan;
    }

    int lengths_;
};

}  // namespace

IntegratorEntry mmlt_entry() {
    std::vector<ParamInfo> params{depth_params()[0]};
    for (const ParamInfo& p : MarkovIntegrator::params()) params.push_back(p);
    params.push_back({"lengths", ParamKind::Int, "10",
                      "Path lengths, from three edges on, that have chains of their own; the last "
                      "of them are of all longer paths."});
    return {{"integrator", "mmlt",
             "Metropolis light transport on one path at a time, whose length has chains of its "
             "own, and whose technique is chosen. Unbiased.",
             params},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<MmltIntegrator>(p);
            }};
}

}  // namespace etendue
