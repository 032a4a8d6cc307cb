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

/// Purposes of the random numbers of a group.
enum Purpose : uint64_t { kPool, kResampling, kSteps, kThinning, kLater };

/// Finds that are kept for each chain.
constexpr size_t kFindsOfChain = 16;

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
                space_.sample(hash_combine(key, at), {whole.sample, work}, found);
            for (const Find& f : found) {
                chunk.finds[size_t(f.chain_class)].push_back(f);
                chunk.sums[size_t(f.chain_class)] += f.weight;
            }
            const double u = to_unit_double(hash_combine(hash_combine(key, kThinning), begin));
            for (auto& finds : chunk.finds) thin(finds, kMost, u);
        });
        for (size_t k = 0; k < plan_.size(); ++k)
            for (const Chunk& chunk : chunks) {
                group.finds[k].insert(group.finds[k].end(), chunk.finds[k].begin(),
                                      chunk.finds[k].end());
                group.normalisation[k].later_sum += chunk.sums[k];
            }
        thin_finds(hash_combine(key, end), group);
    }
    for (Normalisation& n : group.normalisation) n.later += double(count);
}

void ChainGroups::thin_finds(uint64_t key, Group& group) const {
    for (size_t k = 0; k < plan_.size(); ++k)
        thin(group.finds[k], kFindsOfChain * size_t(plan_[k].chains),
             to_unit_double(hash_combine(hash_combine(key, kThinning), k)));
}

void ChainGroups::start(const PassContext& pass, uint64_t key, Group& group) const {
    size_t first = 0;
    for (size_t k = 0; k < plan_.size(); ++k) {
        const int count = plan_[k].chains;
        const std::vector<Find>& finds = group.finds[k];
        group.normalisation[k].pool_all();
        const double u = to_unit_double(hash_combine(hash_combine(key, kResampling), k));
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
    const size_t g = pass.index % groups_.size();
    const bool starts_each_pass = options_.starts == Starts::EachPass;
    working_group_ = g;
    const bool is_new = starts_each_pass || !groups_[g].has_begun();
    working_.turns = groups_[g].turns;
    if (is_new) {
        working_.normalisation.assign(plan_.size(), {});
        working_.finds.assign(plan_.size(), {});
    } else {
        for (size_t i = 0; i < working_.chains.size(); ++i)
            working_.chains[i].copy(groups_[g].chains[i]);
        working_.normalisation = groups_[g].normalisation;
        working_.finds = groups_[g].finds;
    }
    const bool starts =
        is_new || (options_.starts == Starts::ByGeneration && begins_generation(working_.turns));
    const uint64_t key = hash_combine(
        hash_combine(hash_combine(pass.seed, 0x636861696e), uint64_t(g)), working_.turns);

    // Made before the pass, so that nothing can fail once it is finished.
    if (groups_[g].chains.empty())
        for (size_t i = spare_.size(); i < class_of_chain_.size(); ++i)
            spare_.emplace_back(space_, class_of_chain_[i]);

    const size_t chains = working_.chains.size();
    const uint64_t steps =
        uint64_t(std::ceil(options_.mutations * double(pass.pixels) / double(chains)));
    if (is_new) sample(pass, hash_combine(key, kPool), options_.pool, working_);
    const auto later = options_.starts == Starts::ByGeneration
                           ? uint64_t(std::ceil(options_.later * double(steps * chains)))
                           : 0;
    sample(pass, hash_combine(key, kLater), later, working_);
    if (starts) start(pass, key, working_);

    std::vector<double> scales;
    for (size_t k = 0; k < plan_.size(); ++k) scales.push_back(scale(g, working_, int(k)));
    std::vector<ChainStats> stats(chains);
    const bool keeps_finds = options_.starts == Starts::ByGeneration;
    std::vector<std::vector<Find>> finds(chains);
    pass.for_each_chain(chains, [&](uint64_t i, SplatSink& splats, Workspace& work) {
        const WholeFilm whole(pass);
        const size_t k = size_t(class_of_chain_[i]);
        const double mean = 1 / (double(steps) * double(plan_[k].chains));
        const ChainContext c{whole.sample, work};
        const auto states = make_sink(i, class_of_chain_[i], c, splats);
        working_.chains[i].advance({options_.p_large, plan_[k].c}, scales[k],
                                   mean * double(pass.light_paths),
                                   hash_combine(hash_combine(key, kSteps), i), steps, c, *states,
                                   stats[i], keeps_finds ? &finds[i] : nullptr);
    });

    working_stats_ = {};
    working_stats_.later_samples = later;
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
        n.later_sum += options_.large_step * stats[i].large_sum;
        n.later += options_.large_step * double(stats[i].large_steps);
        for (Find& f : finds[i]) {
            f.weight *= options_.large_step;
            working_.finds[size_t(class_of_chain_[i])].push_back(f);
        }
    }
    if (keeps_finds)
        thin_finds(key, working_);
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
    for (Group& g : groups_) {
        uint64_t chains = 0;
        from.get(chains);
        from.get(g.normalisation);
        from.get(g.turns);
        uint64_t classes = 0;
        from.get(classes);
        if (classes > plan_.size())
            throw std::runtime_error("the learned state is of another number of classes");
        g.finds.resize(size_t(classes));
        for (auto& finds : g.finds) from.get(finds);
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
