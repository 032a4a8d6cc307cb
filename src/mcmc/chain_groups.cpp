#include "mcmc/chain_groups.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "math/hash.h"
#include "math/statistics.h"
#include "mcmc/whole_film.h"

namespace etendue {
namespace {

/// Purposes of the random numbers of a group.
enum Purpose : uint64_t { kPool, kResampling, kSteps };

class StatesToFilm final : public StateSink {
public:
    StatesToFilm(const StateSpace& space, int chain_class, const ChainContext& c, SplatSink& film)
        : space_(space), class_(chain_class), c_(c), film_(film) {}
    void add(const ChainState& state, double factor) override {
        space_.contribute(class_, state, factor, c_, film_);
    }

private:
    const StateSpace& space_;
    int class_;
    ChainContext c_;
    SplatSink& film_;
};

}  // namespace

std::vector<size_t> resample(std::span<const double> weights, size_t count, double u) {
    const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
    std::vector<size_t> out;
    if (!(total > 0)) return out;
    size_t item = 0;
    double sum = weights[0];
    for (size_t i = 0; i < count; ++i) {
        const double at = (double(i) + u) / double(count) * total;
        while (sum <= at && item + 1 < weights.size()) sum += weights[++item];
        // By rounding, the last item may be one without weight.
        size_t chosen = item;
        while (!(weights[chosen] > 0)) --chosen;
        out.push_back(chosen);
    }
    return out;
}

std::vector<ClassPlan> share_out(double b, std::vector<double> b_of_class,
                                 std::span<const double> cost, uint64_t pool, int chains) {
    constexpr int kFewest = 4;
    constexpr uint64_t kSmallestPool = 64;
    constexpr double kLeast = 0.25;
    const int classes = int(b_of_class.size());
    double total = 0;
    std::vector<double> shares;
    for (size_t k = 0; k < b_of_class.size(); ++k) {
        b_of_class[k] = std::max(b_of_class[k], kLeast * b / double(classes));
        total += shares.emplace_back(b_of_class[k] / std::sqrt(cost[k]));
    }
    const int spare = std::max(0, chains - kFewest * classes);
    std::vector<ClassPlan> plan;
    double sum = 0;
    int given = 0;
    for (size_t k = 0; k < b_of_class.size(); ++k) {
        sum += shares[k] / total;
        const int upto = int(std::lround(sum * spare)), of_class = kFewest + upto - given;
        given = upto;
        plan.push_back(
            {.chains = of_class,
             .pool = std::max(kSmallestPool, pool * uint64_t(of_class) / uint64_t(chains)),
             .c = b_of_class[k]});
    }
    return plan;
}

ChainGroups::ChainGroups(const StateSpace& space, const ChainOptions& options,
                         std::vector<ClassPlan> plan)
    : space_(space), options_(options), plan_(std::move(plan)), groups_(size_t(options.groups)) {
    for (size_t k = 0; k < plan_.size(); ++k)
        class_of_chain_.insert(class_of_chain_.end(), size_t(plan_[k].chains), int(k));
    for (const int k : class_of_chain_) working_.chains.emplace_back(space_, k);
}

void ChainGroups::start(const PassContext& pass, uint64_t key, Group& group) const {
    group.normalisation.assign(plan_.size(), {});
    group.steps = 0;
    size_t first = 0;
    for (size_t k = 0; k < plan_.size(); ++k) {
        const ClassPlan& plan = plan_[k];
        const uint64_t pool_key = hash_combine(hash_combine(key, kPool), k);
        std::vector<double> importance(plan.pool);
        pass.for_each_other_path(plan.pool, [&](uint64_t i, Sampler&, Workspace& work) {
            const WholeFilm whole(pass);
            const auto state = space_.make_state();
            space_.draw(int(k), hash_combine(pool_key, i), {whole.sample, work}, *state);
            importance[i] = state->target;
        });
        Normalisation& n = group.normalisation[k];
        n.pool = plan.pool;
        for (const double v : importance) n.pool_sum += v;

        const double u = to_unit_double(hash_combine(hash_combine(key, kResampling), k));
        const std::vector<size_t> seeds = resample(importance, size_t(plan.chains), u);
        for (int i = 0; i < plan.chains; ++i) group.chains[first + size_t(i)].start_black();
        pass.for_each_other_path(seeds.size(), [&](uint64_t i, Sampler&, Workspace& work) {
            const WholeFilm whole(pass);
            group.chains[first + i].start(hash_combine(pool_key, seeds[i]), {whole.sample, work});
        });
        first += size_t(plan.chains);
    }
}

double ChainGroups::scale(size_t g, const Group& group, int chain_class) const {
    const size_t k = size_t(chain_class);
    double shift = 0;
    for (size_t h = 0; h < groups_.size(); ++h) {
        if (h == g || groups_[h].normalisation.empty()) continue;
        const Normalisation& n = groups_[h].normalisation[k];
        shift += (n.later_b() - n.b()) / double(groups_.size() - 1);
    }
    return group.normalisation[k].b() + shift;
}

void ChainGroups::advance(const PassContext& pass) {
    advance(pass, [this](uint64_t, int chain_class, const ChainContext& c, SplatSink& film) {
        return std::make_unique<StatesToFilm>(space_, chain_class, c, film);
    });
}

void ChainGroups::advance(const PassContext& pass, const MakeSink& make_sink) {
    const size_t g = pass.index % groups_.size();
    const uint64_t key = hash_combine(hash_combine(pass.seed, 0x636861696e),
                                      options_.restarts ? pass.index : uint64_t(g));
    working_group_ = g;
    if (options_.restarts || groups_[g].chains.empty()) {
        start(pass, key, working_);
    } else {
        for (size_t i = 0; i < working_.chains.size(); ++i)
            working_.chains[i].copy(groups_[g].chains[i]);
        working_.normalisation = groups_[g].normalisation;
        working_.steps = groups_[g].steps;
    }

    // Made before the pass, so that nothing can fail once it is finished.
    if (groups_[g].chains.empty())
        for (size_t i = spare_.size(); i < class_of_chain_.size(); ++i)
            spare_.emplace_back(space_, class_of_chain_[i]);

    const size_t chains = working_.chains.size();
    const uint64_t steps =
        uint64_t(std::ceil(options_.mutations * double(pass.pixels) / double(chains)));
    std::vector<double> scales;
    for (size_t k = 0; k < plan_.size(); ++k) scales.push_back(scale(g, working_, int(k)));
    std::vector<ChainStats> stats(chains);
    pass.for_each_chain(chains, [&](uint64_t i, SplatSink& splats, Workspace& work) {
        const WholeFilm whole(pass);
        const size_t k = size_t(class_of_chain_[i]);
        const double mean = 1 / (double(steps) * double(plan_[k].chains));
        const ChainContext c{whole.sample, work};
        const auto states = make_sink(i, class_of_chain_[i], c, splats);
        working_.chains[i].advance({options_.p_large, plan_[k].c}, scales[k],
                                   mean * double(pass.light_paths),
                                   hash_combine(hash_combine(key, kSteps), i), working_.steps,
                                   steps, c, *states, stats[i]);
    });

    working_stats_ = {};
    double own = 0, all = 0;
    for (size_t i = 0; i < chains; ++i) {
        const size_t k = size_t(class_of_chain_[i]);
        const ChainStats& s = stats[i];
        const double chain_light = s.chain_light / double(plan_[k].chains),
                     large_light = s.large_light / double(plan_[k].chains);
        all += chain_light + large_light;
        own +=
            large_light +
            (scales[k] != 0 ? chain_light * working_.normalisation[k].later_b() / scales[k] : 0.0);
        working_stats_ += s;
    }
    own_scale_ = all > 0 ? own / all : 1.0;
    for (size_t i = 0; i < chains; ++i) {
        Normalisation& n = working_.normalisation[size_t(class_of_chain_[i])];
        n.large_sum += stats[i].large_sum;
        n.large += stats[i].large_steps;
    }
    working_.steps += steps;
}

void ChainGroups::commit() noexcept {
    Group& group = groups_[working_group_];
    if (group.chains.empty()) group.chains.swap(spare_);
    group.chains.swap(working_.chains);
    group.normalisation.swap(working_.normalisation);
    group.steps = working_.steps;
    stats_ += working_stats_;
}

void ChainGroups::save(LearnedState& to) const {
    for (const Group& g : groups_) {
        const size_t kept = options_.restarts ? 0 : g.chains.size();
        to.put(uint64_t(kept));
        to.put(g.normalisation);
        to.put(g.steps);
        for (size_t i = 0; i < kept; ++i) g.chains[i].save(to);
    }
    to.put(stats_);
    to.put(own_scale_);
}

void ChainGroups::load(LearnedState& from) {
    for (Group& g : groups_) {
        uint64_t chains = 0;
        from.get(chains);
        from.get(g.normalisation);
        from.get(g.steps);
        if (chains != 0 && chains != class_of_chain_.size())
            throw std::runtime_error("the learned state is of another number of chains");
        g.chains.clear();
        for (uint64_t i = 0; i < chains; ++i)
            g.chains.emplace_back(space_, class_of_chain_[i]).load(from);
    }
    from.get(stats_);
    from.get(own_scale_);
}

double ChainGroups::later_b(const Group& group) const {
    double sum = 0;
    for (const Normalisation& n : group.normalisation) sum += n.later_b();
    return sum;
}

double ChainGroups::b() const {
    Moments m;
    for (const Group& g : groups_)
        if (!g.normalisation.empty()) m.add(later_b(g));
    return m.mean();
}

double ChainGroups::relative_error_of_b() const {
    Moments m;
    for (const Group& g : groups_)
        if (!g.normalisation.empty()) m.add(later_b(g));
    return m.count() > 1 && m.mean() > 0 ? std::sqrt(m.squared_error()) / m.mean() : 0.0;
}

}  // namespace etendue
