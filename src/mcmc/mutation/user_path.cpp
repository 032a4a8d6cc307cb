#include "mcmc/mutation/user_path.h"

namespace etendue {

int UserPathMutation::kept(const PathState& x) {
    int m = x.last() - 1;
    while (m > 0 && x[m].v.is_delta) --m;
    return m;
}

bool UserPathMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                               MutationWay& way) const {
    const int m = kept(x);
    PathBuilder builder = c.builder(&x, -1, m);
    if (!builder.follow(paths_) || !builder.finish(y)) return false;
    way = {.l = -1, .m = m, .m_y = y.last() - (x.last() - m)};
    return true;
}

double UserPathMutation::Q(const PathState& x, const PathState& y, const MutationWay& way) const {
    if (!is_way(x, way)) return 0;
    std::vector<const Vertex*> light;
    double factor = 1;
    for (int i = 0; i < way.m_y; ++i) {
        light.push_back(&y[i].v);
        factor *= measure_.unit_area;
        if (i > 0) factor *= double(y[i - 1].transmittance * y[i].opacity);
    }
    return light.size() < 2 ? 0.0 : factor * paths_.density(light);
}

}  // namespace etendue
