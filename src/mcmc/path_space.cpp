#include "mcmc/path_space.h"

#include <stdexcept>

#include "mcmc/addresses.h"
#include "mcmc/chain.h"
#include "mcmc/mutation/bidirectional.h"
#include "mcmc/mutation/caustic.h"
#include "mcmc/mutation/eye_chain.h"
#include "mcmc/mutation/lens_subpath.h"
#include "mcmc/mutation/manifold.h"
#include "mcmc/mutation/photon_map.h"
#include "mcmc/mutation/user_path.h"

namespace etendue {
namespace {

static_assert(1 + PathMutations::kCount <= ChainStats::kMutations);

bool is_same_place(const Vertex& a, const Vertex& b) {
    return a.p.x == b.p.x && a.p.y == b.p.y && a.p.z == b.p.z;
}

/// Throws std::logic_error if y does not have the kept ends of x where `way` says: Q would be that of another proposal.
void expect_announced(const PathState& x, const PathState& y, const MutationWay& way) {
    const int k = x.last(), k_y = y.last();
    const bool is_as_announced = k_y - way.m_y == k - way.m && way.l < way.m && way.l < way.m_y &&
                                 (way.l < 0 || is_same_place(x[way.l].v, y[way.l].v)) &&
                                 (way.m > k || is_same_place(x[way.m].v, y[way.m_y].v));
    if (!is_as_announced)
        throw std::logic_error("Markov chain: a mutation made another path than it announced");
}

}  // namespace

PathSpace::PathSpace(PathTarget target, const PathMutations& mutations, TechniqueCounts counts,
                     std::optional<WeighedSample> samples)
    : target_(std::move(target)), options_(mutations), samples_(std::move(samples)),
      counts_(counts) {
    const PathMeasure& measure = target_.measure;
    using EyeChain = EyeChainMutation;
    mutations_[PathMutations::Bidirectional] = std::make_unique<BidirectionalMutation>(measure);
    mutations_[PathMutations::Lens] = std::make_unique<EyeChain>(EyeChain::Kind::Lens, measure);
    mutations_[PathMutations::Caustic] =
        std::make_unique<CausticMutation>(Followed::Delta, measure);
    mutations_[PathMutations::MultiChain] =
        std::make_unique<EyeChain>(EyeChain::Kind::MultiChain, measure);
    mutations_[PathMutations::GlossyLens] =
        std::make_unique<EyeChain>(EyeChain::Kind::Glossy, measure);
    mutations_[PathMutations::GlossyCaustic] =
        std::make_unique<CausticMutation>(Followed::Glossy, measure);
    mutations_[PathMutations::Manifold] = std::make_unique<ManifoldMutation>(measure);
    mutations_[PathMutations::LensSubpath] = std::make_unique<LensSubpathMutation>();
    mutations_[PathMutations::PhotonMap] = std::make_unique<PhotonMapMutation>(target_.stores);
    if (target_.user.paths)
        mutations_[PathMutations::UserPath] =
            std::make_unique<UserPathMutation>(*target_.user.paths);
}

void PathSpace::draw(int, uint64_t key, const ChainContext& c, ChainState& state) const {
    auto& y = static_cast<PathState&>(state);
    Sampler sampler(SamplerKind::Independent, key);
    sampler.start(0, 0);
    sampler.seek(Stream::Selection, addresses::kKind);
    const double u_length = sampler.next_1d_fine(), u_technique = sampler.next_1d_fine();
    const bool follows_user = target_.user.paths && sampler.next_1d_fine() < target_.user.share;
    const MutationContext context{target_.measure, c, sampler};
    PathBuilder builder = context.builder(nullptr, -1, 0);
    y.set_black();
    if (follows_user) {
        y.edges = 0;
        if (draw_user_path(builder, sampler) && builder.finish(y)) y.finish(c.work.stats);
        return;
    }
    const int k = target_.lengths.choose(u_length);
    const int s = target_.techniques.choose(k, u_technique);
    y.edges = k;
    if (builder.sample(s, k + 1 - s) && builder.finish(y)) y.finish(c.work.stats);
}

void PathSpace::sample(uint64_t key, const ChainContext& c, std::vector<Find>& finds) const {
    if (!samples_) return StateSpace::sample(key, c, finds);
    Sampler sampler(SamplerKind::Independent, key);
    sampler.start(0, 0);
    int32_t part = 0;
    samples_->for_each_part(sampler, c, [&](const Join&, double weight) {
        finds.push_back({key, part++, 0, weight});
    });
}

void PathSpace::recall(const Find& find, const ChainContext& c, ChainState& state) const {
    if (!samples_ || find.part == Find::kLargeStep)
        return draw(find.chain_class, find.key, c, state);
    auto& y = static_cast<PathState&>(state);
    Sampler sampler(SamplerKind::Independent, find.key);
    sampler.start(0, 0);
    const MutationContext context{target_.measure, c, sampler};
    PathBuilder builder = context.builder(nullptr, -1, 0);
    std::optional<Join> join;
    Flight flight;
    int32_t part = 0;
    samples_->for_each_part(sampler, c, [&](const Join& j, double) {
        if (part++ != find.part) return;
        join = j;
        flight = c.work.y.flight;
    });
    y.set_black();
    if (!join) return;
    builder.take(*join, flight);
    if (builder.finish(y)) y.finish(c.work.stats);
}

bool PathSpace::draw_user_path(PathBuilder& builder, Sampler& sampler) const {
    if (!builder.follow(*target_.user.paths)) return false;
    const int s = builder.light_vertices(), longest = target_.measure.longest;
    int t = std::max(1, target_.measure.shortest + 1 - s);
    sampler.seek(Stream::Selection, addresses::kPart);
    for (double u = sampler.next_1d_fine(); u < UserSteps::kLonger && s + t <= longest + 1; ++t)
        u /= UserSteps::kLonger;
    return s + t <= longest + 1 && builder.sample_eye_path(t);
}

PathSpace::Choices PathSpace::choices(const PathState& x) const {
    Choices p{};
    double sum = 0;
    for (size_t i = 0; i < p.size(); ++i)
        if (options_.weights[i] > 0 && mutations_[i]->suits(x)) sum += p[i] = options_.weights[i];
    if (sum > 0)
        for (double& v : p) v /= sum;
    return p;
}

PathDensity PathSpace::Q(Kind kind, const Choices& at_x, const PathState& x, const PathState& y,
                         const MutationWay& way) const {
    const auto density = [&](Kind of) {
        return at_x[of] > 0 ? at_x[of] * mutations_[of]->Q(x, y, way) : PathDensity(0);
    };
    const bool is_either =
        (kind == PathMutations::Bidirectional || kind == PathMutations::UserPath) &&
        UserPathMutation::is_way(x, way);
    if (is_either) return density(PathMutations::Bidirectional) + density(PathMutations::UserPath);
    return density(kind);
}

Proposal PathSpace::propose(int, const ChainState& from, uint64_t key, const ChainContext& c,
                            ChainState& to) const {
    const auto& x = static_cast<const PathState&>(from);
    auto& y = static_cast<PathState&>(to);
    Sampler sampler(SamplerKind::Independent, key);
    sampler.start(0, 0);
    sampler.seek(Stream::Selection, addresses::kKind);
    double u = double(sampler.next_1d());
    const Choices p = choices(x);
    int chosen = 0;
    for (size_t i = 0; i < p.size(); u -= p[i], ++i) {
        if (p[i] > 0) chosen = int(i);
        if (u < p[i]) break;
    }
    const auto kind = Kind(chosen);
    Proposal proposal{.mutation = chosen};
    y.set_black();
    const MutationContext context{target_.measure, c, sampler};
    MutationWay way;
    if (!(p[size_t(kind)] > 0) || !mutations_[size_t(kind)]->propose(x, context, y, way)) {
        proposal.has_failed = true;
        return proposal;
    }
    expect_announced(x, y, way);
    y.finish(c.work.stats);
    if (!(y.target > 0)) return proposal;
    const PathDensity there = Q(kind, p, x, y, way), back = Q(kind, choices(y), y, x, way.back());
    proposal.Q_ratio =
        there > 0 ? double(back * y.large_step_density() / (there * x.large_step_density())) : 0.0;
    return proposal;
}

void PathSpace::repeat(int, const ChainState& x, const ChainContext& c,
                       ContributionSink& sink) const {
    static_cast<const PathState&>(x).tell(counts_, c.work, sink);
}

}  // namespace etendue
