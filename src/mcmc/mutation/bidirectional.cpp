#include "mcmc/mutation/bidirectional.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "mcmc/addresses.h"

namespace etendue {
namespace {

/// Weight of deleting this number of edges, where an edge beyond the emitter or the lens counts, too.
double deletion_weight(int edges) {
    return edges == 1 ? 0.25 : edges == 2 ? 0.5 : std::ldexp(1.0, -edges);
}

/// Weights of inserting up to this many edges more or fewer than are deleted.
constexpr int kMostMore = 12;
constexpr auto kInsertionWeights = [] {
    std::array<double, kMostMore + 1> weights{0.5, 0.15};
    for (size_t n = 2; n < weights.size(); ++n) weights[n] = 0.2 / double(uint64_t(1) << n);
    return weights;
}();
double insertion_weight(int more) {
    return std::abs(more) <= kMostMore ? kInsertionWeights[size_t(std::abs(more))] : 0.0;
}

/// Largest number of edges that can be deleted, including those to x_{-1} and x_{k+1}, which are not vertices.
int most_deleted(int edges) {
    return edges + 2;
}

/// Σ deletion_weight
double deletion_sum(int edges) {
    return 1 - std::ldexp(1.0, -most_deleted(edges));
}

/// Where this number of edges can be deleted: the smallest index l, and the number of places. Nothing is kept beyond the
/// emitter or the lens: l < k and m > 0.
struct Places {
    int first, count;
    Places(int deleted, int edges)
        : first(std::max(-1, 1 - deleted)),
          count(std::min(edges - 1, edges + 1 - deleted) - first + 1) {}
};

/// p_d(l, m | x)
double deletion_pmf(int deleted, int edges) {
    return deletion_weight(deleted) / (deletion_sum(edges) * Places(deleted, edges).count);
}

}  // namespace

BidirectionalMutation::BidirectionalMutation(const PathMeasure& measure)
    : measure_(measure), hits_(hits_emitters(measure.scene)),
      hits_lens_(measure.scene.sensor().has_finite_lens()),
      has_one_origin_(measure.scene.emitters().size() == 1 && !hits_) {}

bool BidirectionalMutation::is_possible(const Gap& gap, int inserted) const {
    const int k = gap.edges - gap.deleted() + inserted;
    if (inserted < 1 || k < measure_.shortest || k > measure_.longest) return false;
    // Without a new vertex, both sides need a kept one. One edge for one is the same path, as is another end of the path if
    // there is only one.
    if (inserted == 1) return gap.deleted() > 1 && gap.l >= 0 && gap.m <= gap.edges;
    if (inserted == 2 && gap.deleted() == 2)
        return gap.m > gap.edges ? hits_lens_ : gap.l >= 0 || !has_one_origin_;
    return true;
}

double BidirectionalMutation::insertion_sum(const Gap& gap) const {
    double sum = 0;
    for (int more = -kMostMore; more <= kMostMore; ++more)
        if (is_possible(gap, gap.deleted() + more)) sum += insertion_weight(more);
    return sum;
}

BidirectionalMutation::Splits BidirectionalMutation::splits(const PathState& x, const Gap& gap,
                                                            int n) const {
    // If no vertex is sampled on a side, the kept vertex there is connected; if none is kept, the emitter or lens is hit.
    const bool joins_light = gap.l >= 0 ? x[gap.l].v.is_connectible : hits_;
    const bool joins_eye = gap.m <= x.last() ? x[gap.m].v.is_connectible : hits_lens_;
    return {joins_light ? 0 : 1, joins_eye ? n : n - 1};
}

bool BidirectionalMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                                    MutationWay& way) const {
    const int k = x.last();
    c.sampler.seek(Stream::Selection, addresses::kPart);
    double u = double(c.sampler.next_1d()) * deletion_sum(k);
    int deleted = 1;
    for (; deleted < most_deleted(k); ++deleted)
        if ((u -= deletion_weight(deleted)) < 0) break;
    const Places places(deleted, k);
    const int place = std::min(int(c.sampler.next_1d() * float(places.count)), places.count - 1);
    const Gap gap{places.first + place, places.first + place + deleted, k};

    double v = double(c.sampler.next_1d()) * insertion_sum(gap);
    int inserted = 0;
    for (int more = -kMostMore; more <= kMostMore; ++more) {
        if (!is_possible(gap, deleted + more)) continue;
        inserted = deleted + more;
        if ((v -= insertion_weight(more)) < 0) break;
    }
    if (inserted == 0) return false;
    way = {.l = gap.l, .m = gap.m, .m_y = gap.l + inserted};
    const int n = inserted - 1;
    const Splits s = splits(x, gap, n);
    if (s.last < s.first) return false;
    const int from_light =
        std::min(s.first + int(c.sampler.next_1d() * float(s.last - s.first + 1)), s.last);
    PathBuilder builder = c.builder(&x, way.l, way.m);
    return builder.sample(from_light, n - from_light) && builder.finish(y);
}

PathDensity BidirectionalMutation::Q(const PathState& x, const PathState& y,
                                     const MutationWay& way) const {
    const Gap gap{way.l, way.m, x.last()};
    const int inserted = way.m_y - way.l;
    const Splits s = splits(x, gap, inserted - 1);
    if (s.last < s.first || !is_possible(gap, inserted)) return 0;
    PathDensity sum = 0;
    for (int count = s.first; count <= s.last; ++count) {
        const int joint = way.l + count;  // The vertex before the edge that joins both sides.
        const bool is_hit = joint < 0 || joint == y.last();
        if (is_hit ? joint < 0 && y.emitter().is_delta() : !y.is_connected_at(joint)) continue;
        PathDensity p = 1;
        // If x_0 is the only vertex on the light's side, a next event samples it.
        for (int i = way.l + 1; i <= joint; ++i) p *= joint == 0 ? y.next_event() : y.light(i);
        for (int i = joint + 1; i < way.m_y; ++i) p *= y.eye(i);
        sum += p;
    }
    return deletion_pmf(gap.deleted(), gap.edges) *
           (insertion_weight(inserted - gap.deleted()) / insertion_sum(gap)) * s.pmf() * sum;
}

}  // namespace etendue
