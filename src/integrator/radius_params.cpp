#include "integrator/radius_params.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

std::vector<ParamInfo> radius_params(const char* doc) {
    return {{"radius", ParamKind::Float, "0", doc},
            {"alpha", ParamKind::Float, "0.75",
             "Controls how fast the radius shrinks: in pass i it is radius·i^((alpha-1)/2). 1: it "
             "stays constant, and the image stays biased."}};
}

RadiusParams::RadiusParams(const IntegratorParams& p, float share)
    : first(p.number("radius")), alpha(p.number("alpha")), default_share(share) {
    if (!(first >= 0))
        throw std::runtime_error(fmt::format("{}: radius must not be negative", p.integrator()));
    if (!(alpha > 0 && alpha <= 1))
        throw std::runtime_error(fmt::format("{}: alpha must lie in (0, 1]", p.integrator()));
}

}  // namespace etendue
