#include "mcmc/mutation/user_path.h"

namespace etendue {

int UserPathMutation::kept(const PathState& x) {
    return x.before(x.last(), [](const Vertex& v) { return !v.is_delta; });
}

bool UserPathMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                               MutationWay& way) const {
    const int m = kept(x);
    PathBuilder builder = c.builder(&x, -1, m);
    if (!builder.follow(paths_) || !builder.finish(y)) return false;
    way = {.l = -1, .m = m, .m_y = y.last() - (x.last() - m)};
    return true;
}

PathDensity UserPathMutation::Q(const PathState& x, const PathState& y,
                                const MutationWay& way) const {
    return is_way(x, way) ? y.density(paths_, way.m_y) : 0;
}

}  // namespace etendue
