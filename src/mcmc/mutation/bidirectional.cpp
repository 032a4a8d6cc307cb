#include "mcmc/mutation/bidirectional.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace etendue {
namespace {

/// Weight of deleting this number of edges, where an edge beyond the emitter or the lens counts, too.
double deletion_weight(int edges) {
    return edges == 1 ? 0.25 : edges == 2 ? 0.5 : std::exp2(-edges);
}

/// Weight of inserting `more` edges more than are deleted.
constexpr int kMostMore = 12;
double insertion_weight(int more) {
    const int n = std::abs(more);
    return n == 0 ? 0.5 : n == 1 ? 0.15 : n <= kMostMore ? 0.2 * std::exp2(-n) : 0.0;
}

/// Largest number of edges that can be deleted, including those to x_{-1} and x_{k+1}, which are not vertices.
int most_deleted(int edges) {
    return edges + 2;
}

double deletion_sum(int edges) {
    double sum = 0;
    for (int d = 1; d <= most_deleted(edges); ++d) sum += deletion_weight(d);
    return sum;
}

/// p_d(l, m | x)
double deletion_pmf(int deleted, int edges) {
    const int places = most_deleted(edges) + 1 - deleted;
    return deletion_weight(deleted) / (deletion_sum(edges) * places);
}

}  // namespace

BidirectionalMutation::BidirectionalMutation(const PathMeasure& measure)
    : measure_(measure), hits_(false), hits_lens_(measure.scene.sensor().has_finite_lens()) {
    for (const auto& e : measure.scene.emitters()) hits_ |= !e->is_delta();
}

bool BidirectionalMutation::is_possible(int inserted, int deleted, int edges) const {
    // One edge for one is the same path.
    const int k = edges - deleted + inserted;
    return inserted >= 1 && !(inserted == 1 && deleted == 1) && k >= measure_.shortest &&
           k <= measure_.longest;
}

double BidirectionalMutation::insertion_pmf(int inserted, int deleted, int edges) const {
    if (!is_possible(inserted, deleted, edges)) return 0;
    double sum = 0;
    for (int a = deleted - kMostMore; a <= deleted + kMostMore; ++a)
        if (is_possible(a, deleted, edges)) sum += insertion_weight(a - deleted);
    return insertion_weight(inserted - deleted) / sum;
}

BidirectionalMutation::Splits BidirectionalMutation::splits(const PathState& x, int l, int m,
                                                            int n) const {
    // If no vertex is sampled on a side, the kept vertex there is connected; if none is kept, the emitter or lens is hit.
    const bool joins_light = l >= 0 ? x[l].v.is_connectible : hits_;
    const bool joins_eye = m <= x.last() ? x[m].v.is_connectible : hits_lens_;
    return {joins_light ? 0 : 1, joins_eye ? n : n - 1};
}

bool BidirectionalMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                                    MutationWay& way) const {
    const int k = x.last();
    c.sampler.seek(Stream::Selection, 1);
    double u = double(c.sampler.next_1d()) * deletion_sum(k);
    int deleted = 1;
    for (; deleted < most_deleted(k); ++deleted)
        if ((u -= deletion_weight(deleted)) < 0) break;
    const int places = most_deleted(k) + 1 - deleted;
    way.l = std::min(int(c.sampler.next_1d() * float(places)), places - 1) - 1;
    way.m = way.l + deleted;

    double v = c.sampler.next_1d();
    int inserted = 0;
    for (int a = std::max(1, deleted - kMostMore); a <= deleted + kMostMore; ++a) {
        const double p = insertion_pmf(a, deleted, k);
        if (p > 0) inserted = a;
        if ((v -= p) < 0) break;
    }
    if (inserted == 0) return false;
    way.m_y = way.l + inserted;
    const int n = inserted - 1;
    const Splits s = splits(x, way.l, way.m, n);
    if (s.last < s.first) return false;
    const int from_light =
        std::min(s.first + int(c.sampler.next_1d() * float(s.last - s.first + 1)), s.last);

    PathBuilder builder = c.builder(&x, way.l, way.m);
    const int from_eye = n - from_light;
    const bool ends_at_lens = way.m > k && from_eye == 0;
    return builder.sample_light(from_light, ends_at_lens) && builder.sample_eye(from_eye) &&
           builder.finish(y);
}

double BidirectionalMutation::Q(const PathState& x, const PathState& y,
                                const MutationWay& way) const {
    const int deleted = way.m - way.l, inserted = way.m_y - way.l, n = inserted - 1;
    const Splits s = splits(x, way.l, way.m, n);
    if (s.last < s.first) return 0;
    const auto from_light = [&](int i, int count) {
        // If x_0 is the only vertex on the light's side, a next event samples it.
        if (i == 0) return count == 1 ? y[0].next_event : y[0].light;
        return y[i].light * double(y[i - 1].transmittance * y[i].opacity);
    };
    const auto from_eye = [&](int i) {
        return i == y.last() ? y[i].eye : y[i].eye * double(y[i].transmittance * y[i].opacity);
    };
    double sum = 0;
    for (int count = s.first; count <= s.last; ++count) {
        const int joint = way.l + count;  // The vertex before the edge that joins both sides.
        const bool is_hit = joint < 0 || joint == y.last();
        if (is_hit ? joint < 0 && y.emitter().is_delta() : !y.is_connected_at(joint)) continue;
        double p = 1;
        for (int i = way.l + 1; i <= joint; ++i) p *= from_light(i, joint + 1);
        for (int i = joint + 1; i < way.m_y; ++i) p *= from_eye(i);
        sum += p;
    }
    return deletion_pmf(deleted, x.last()) * insertion_pmf(inserted, deleted, x.last()) * s.pmf() *
           sum;
}

}  // namespace etendue
