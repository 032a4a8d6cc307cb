#include "mcmc/mutation/lens_subpath.h"

namespace etendue {

int LensSubpathMutation::end(const PathState& x) {
    return x.before(x.last(), [](const Vertex& v) { return v.is_connectible; });
}

bool LensSubpathMutation::suits(const PathState& x) const {
    const int i = end(x);
    return i > 0 && x.is_connected_at(i - 1);
}

bool LensSubpathMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                                  MutationWay& way) const {
    const int k = x.last(), l = end(x) - 1;
    PathBuilder builder = c.builder(&x, l, k + 1);
    if (!builder.start_eye_anywhere()) return false;
    for (int n = l + 3; !builder.eye_end().is_connectible; ++n)
        if (n > c.measure.longest || !builder.sample_eye_step()) return false;
    if (!builder.finish(y)) return false;
    way = {.l = l, .m = k + 1, .m_y = y.last() + 1};
    return true;
}

PathDensity LensSubpathMutation::Q(const PathState&, const PathState& y,
                                   const MutationWay& way) const {
    PathDensity p = 1;
    for (int i = way.l + 1; i <= y.last(); ++i) p *= y.eye(i);
    return p;
}

}  // namespace etendue
