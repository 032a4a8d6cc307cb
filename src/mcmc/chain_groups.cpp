#include "mcmc/chain_groups.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

#include "math/hash.h"
#include "math/statistics.h"
#include "mcmc/whole_film.h"

namespace etendue {
namespace {

/// Finds that are kept for each chain of a class; and at most of one chain in a pass.
constexpr size_t kFindsOfChain = 16, kFindsOfPass = 4 * kFindsOfChain;

/// Generations start before the turns 0, 1, 4, 16 …
bool begins_generation(uint32_t turn) {
    return turn == 0 || (std::has_single_bit(turn) && std::countr_zero(turn) % 2 == 0);
}

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

/// Keys of the random numbers of a turn, one for each purpose. What is numbered has a key hash_combine(purpose, number), and
/// no key is used for two things.
struct ChainGroups::TurnKeys {
    uint64_t pool, resampling, steps, thinning, later, thinning_of_chains;

    explicit TurnKeys(uint64_t turn)
        : pool(hash_combine(turn, 0)), resampling(hash_combine(turn, 1)),
          steps(hash_combine(turn, 2)), thinning(hash_combine(turn, 3)),
          later(hash_combine(turn, 4)), thinning_of_chains(hash_combine(turn, 5)) {}
};

struct ChainGroups::Turn {
    size_t group;
    TurnKeys keys;
    bool is_new;       ///< Whether the group begins with a pool.
    bool starts;       ///< Whether its chains start anew.
    uint64_t steps;    ///< Of each chain.
    uint64_t samples;  ///< Later ones.
};

/// What the steps of each chain have made.
struct ChainGroups::Steps {
    std::vector<double> scales;  ///< By class.
    std::vector<ChainStats> stats;
    std::vector<std::vector<Find>> finds;
};

std::vector<ClassPlan> share_out(double b, std::vector<double> b_of_class,
                                 std::span<const double> cost, int chains) {
    constexpr int kFewest = 4;
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
        plan.push_back({.chains = of_class, .c = b_of_class[k]});
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

void ChainGroups::Normalisation::pool_all() {
    pool_sum += later_sum, pool += later;
    later_sum = later = 0;
}

void ChainGroups::sample(const PassContext& pass, uint64_t key, uint64_t count,
                         Group& group) const {
    constexpr uint64_t kChunk = 64, kChunks = 4096;
    constexpr size_t kMost = 16;  // finds of a class that a chunk keeps
    // What thins out samples must not depend on their numbers, which are hashes of the key of the sample.
    const uint64_t of_samples = hash_combine(key, 0), of_chunks = hash_combine(key, 1),
                   of_batches = hash_combine(key, 2);
    struct Chunk {
        std::vector<std::vector<Find>> finds;
        std::vector<double> sums;
    };
    std::vector<Chunk> chunks;
    for (uint64_t first = 0; first < count; first += kChunk * kChunks) {
        const uint64_t end = std::min(count, first + kChunk * kChunks);
        chunks.assign((end - first + kChunk - 1) / kChunk, {});
        pass.for_each_other_path(chunks.size(), [&](uint64_t i, Sampler&, Workspace& work) {
            const WholeFilm whole(pass);
            Chunk& chunk = chunks[i];
            chunk.finds.resize(plan_.size());
            chunk.sums.resize(plan_.size());
            std::vector<Find> found;
            const uint64_t begin = first + i * kChunk;
            for (uint64_t at = begin; at < std::min(end, begin + kChunk); ++at)
                space_.sample(hash_combine(of_samples, at), {whole.sample, work}, found);
            for (const Find& f : found) {
                chunk.finds[size_t(f.chain_class)].push_back(f);
                chunk.sums[size_t(f.chain_class)] += f.weight;
            }
            const double u = to_unit_double(hash_combine(of_chunks, begin));
            for (auto& finds : chunk.finds) thin(finds, kMost, u);
        });
        for (size_t k = 0; k < plan_.size(); ++k)
            for (const Chunk& chunk : chunks) {
                group.finds[k].insert(group.finds[k].end(), chunk.finds[k].begin(),
                                      chunk.finds[k].end());
                group.normalisation[k].later_sum += chunk.sums[k];
            }
        thin_finds(hash_combine(of_batches, end), group);
    }
    for (Normalisation& n : group.normalisation) n.later += double(count);
}

void ChainGroups::thin_finds(uint64_t key, Group& group) const {
    for (size_t k = 0; k < plan_.size(); ++k)
        thin(group.finds[k], kFindsOfChain * size_t(plan_[k].chains),
             to_unit_double(hash_combine(key, k)));
}

void ChainGroups::start(const PassContext& pass, uint64_t key, Group& group) const {
    size_t first = 0;
    for (size_t k = 0; k < plan_.size(); ++k) {
        const int count = plan_[k].chains;
        const std::vector<Find>& finds = group.finds[k];
        group.normalisation[k].pool_all();
        const double u = to_unit_double(hash_combine(key, k));
        const std::vector<size_t> seeds = resample(finds, size_t(count), u);
        for (int i = 0; i < count; ++i) group.chains[first + size_t(i)].start_black();
        pass.for_each_other_path(seeds.size(), [&](uint64_t i, Sampler&, Workspace& work) {
            const WholeFilm whole(pass);
            group.chains[first + i].start(finds[seeds[i]], {whole.sample, work});
        });
        first += size_t(count);
    }
}

double ChainGroups::scale(size_t g, const Group& group, int chain_class) const {
    const size_t k = size_t(chain_class);
    double shift = 0;
    for (size_t h = 0; h < groups_.size(); ++h) {
        if (h == g || !groups_[h].has_begun()) continue;
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
    const Turn turn = begin_turn(pass);
    if (turn.is_new) sample(pass, turn.keys.pool, options_.pool, working_);
    sample(pass, turn.keys.later, turn.samples, working_);
    if (turn.starts) start(pass, turn.keys.resampling, working_);
    settle(turn, step(pass, turn, make_sink));
}

ChainGroups::Turn ChainGroups::begin_turn(const PassContext& pass) {
    const size_t g = pass.index % groups_.size();
    const Group& group = groups_[g];
    const bool is_new = options_.starts == Starts::EachPass || !group.has_begun();
    const bool has_generations = options_.starts == Starts::ByGeneration;
    working_group_ = g;
    working_.turns = group.turns;
    if (is_new) {
        working_.normalisation.assign(plan_.size(), {});
        working_.finds.assign(plan_.size(), {});
    } else {
        for (size_t i = 0; i < working_.chains.size(); ++i)
            working_.chains[i].copy(group.chains[i]);
        working_.normalisation = group.normalisation;
        working_.finds = group.finds;
    }
    // Made before the pass, so that nothing can fail once it is finished.
    if (group.chains.empty())
        for (size_t i = spare_.size(); i < class_of_chain_.size(); ++i)
            spare_.emplace_back(space_, class_of_chain_[i]);

    const auto chains = double(working_.chains.size());
    const auto steps = uint64_t(std::ceil(options_.mutations * double(pass.pixels) / chains));
    const auto samples =
        has_generations ? uint64_t(std::ceil(options_.later * double(steps) * chains)) : 0;
    const uint64_t key =
        hash_combine(hash_combine(hash_combine(pass.seed, 0x636861696e), uint64_t(g)), group.turns);
    return {.group = g,
            .keys = TurnKeys(key),
            .is_new = is_new,
            .starts = is_new || (has_generations && begins_generation(group.turns)),
            .steps = steps,
            .samples = samples};
}

ChainGroups::Steps ChainGroups::step(const PassContext& pass, const Turn& turn,
                                     const MakeSink& make_sink) {
    const size_t chains = working_.chains.size();
    Steps made{.scales = {},
               .stats = std::vector<ChainStats>(chains),
               .finds = std::vector<std::vector<Find>>(chains)};
    for (size_t k = 0; k < plan_.size(); ++k)
        made.scales.push_back(scale(turn.group, working_, int(k)));
    const bool keeps_finds = options_.starts == Starts::ByGeneration;
    pass.for_each_chain(chains, [&](uint64_t i, SplatSink& splats, Workspace& work) {
        const WholeFilm whole(pass);
        const auto k = size_t(class_of_chain_[i]);
        const double mean = 1 / (double(turn.steps) * double(plan_[k].chains));
        const ChainContext c{whole.sample, work};
        const auto states = make_sink(i, class_of_chain_[i], c, splats);
        std::vector<Find>& finds = made.finds[i];
        working_.chains[i].advance({options_.p_large, plan_[k].c}, made.scales[k],
                                   mean * double(pass.light_paths),
                                   hash_combine(turn.keys.steps, i), turn.steps, c, *states,
                                   made.stats[i], keeps_finds ? &finds : nullptr);
        // In a long pass, all chains together would find very many.
        thin(finds, kFindsOfPass, to_unit_double(hash_combine(turn.keys.thinning_of_chains, i)));
        finds.shrink_to_fit();
    });
    return made;
}

void ChainGroups::settle(const Turn& turn, const Steps& made) {
    working_stats_ = {};
    working_stats_.later_samples = turn.samples;
    double own = 0, all = 0;
    for (size_t i = 0; i < made.stats.size(); ++i) {
        const auto k = size_t(class_of_chain_[i]);
        const ChainStats& s = made.stats[i];
        const double scale = made.scales[k], chains = double(plan_[k].chains),
                     chain_light = s.chain_light / chains, large_light = s.large_light / chains;
        all += chain_light + large_light;
        own += large_light +
               (scale != 0 ? chain_light * working_.normalisation[k].later_b() / scale : 0.0);
        working_stats_ += s;
    }
    own_scale_ = all > 0 ? own / all : 1.0;
    for (size_t i = 0; i < made.stats.size(); ++i) {
        const auto k = size_t(class_of_chain_[i]);
        Normalisation& n = working_.normalisation[k];
        n.later_sum += options_.large_step * made.stats[i].large_sum;
        n.later += options_.large_step * double(made.stats[i].large_steps);
        for (Find f : made.finds[i]) {
            f.weight *= options_.large_step;
            working_.finds[k].push_back(f);
        }
    }
    if (options_.starts == Starts::ByGeneration)
        thin_finds(turn.keys.thinning, working_);
    else
        working_.finds.clear();
    ++working_.turns;
}

void ChainGroups::commit() noexcept {
    Group& group = groups_[working_group_];
    if (group.chains.empty()) group.chains.swap(spare_);
    group.chains.swap(working_.chains);
    group.normalisation.swap(working_.normalisation);
    group.finds.swap(working_.finds);
    group.turns = working_.turns;
    stats_ += working_stats_;
}

void ChainGroups::save(LearnedState& to) const {
    for (const Group& g : groups_) {
        const size_t kept = options_.starts == Starts::EachPass ? 0 : g.chains.size();
        to.put(uint64_t(kept));
        to.put(g.normalisation);
        to.put(g.turns);
        to.put(uint64_t(g.finds.size()));
        for (const auto& finds : g.finds) to.put(finds);
        for (size_t i = 0; i < kept; ++i) g.chains[i].save(to);
    }
    to.put(stats_);
    to.put(own_scale_);
}

void ChainGroups::load(LearnedState& from) {
    const auto fail = [] { throw std::runtime_error("the learned state is that of other chains"); };
    for (Group& g : groups_) {
        uint64_t chains = 0, classes = 0;
        from.get(chains);
        from.get(g.normalisation);
        from.get(g.turns);
        from.get(classes);
        if (classes > plan_.size() || chains > class_of_chain_.size()) fail();
        g.finds.resize(size_t(classes));
        for (auto& finds : g.finds) from.get(finds);
        g.chains.clear();
        for (uint64_t i = 0; i < chains; ++i)
            g.chains.emplace_back(space_, class_of_chain_[i]).load(from);
        if (!is_consistent(g)) fail();
    }
    from.get(stats_);
    from.get(own_scale_);
}

bool ChainGroups::is_consistent(const Group& g) const {
    const bool keeps_chains = g.has_begun() && options_.starts != Starts::EachPass,
               keeps_finds = g.has_begun() && options_.starts == Starts::ByGeneration;
    if (g.chains.size() != (keeps_chains ? class_of_chain_.size() : 0)) return false;
    if (g.normalisation.size() != (g.has_begun() ? plan_.size() : 0)) return false;
    if (g.finds.size() != (keeps_finds ? plan_.size() : 0)) return false;
    for (size_t k = 0; k < g.finds.size(); ++k)
        for (const Find& f : g.finds[k])
            if (f.chain_class != int(k)) return false;
    return true;
}

double ChainGroups::later_b(const Group& group) const {
    double sum = 0;
    for (const Normalisation& n : group.normalisation) sum += n.later_b();
    return sum;
}

double ChainGroups::b() const {
    Moments m;
    for (const Group& g : groups_)
        if (g.has_begun()) m.add(later_b(g));
    return m.mean();
}

double ChainGroups::relative_error_of_b() const {
    Moments m;
    for (const Group& g : groups_)
        if (g.has_begun()) m.add(later_b(g));
    return m.count() > 1 && m.mean() > 0 ? std::sqrt(m.squared_error()) / m.mean() : 0.0;
}

}  // namespace etendue
