#include "integrator/specular.h"

namespace etendue {

std::vector<ParamInfo> Specular::params() {
    return {
        {"specular_connections", ParamKind::String, "off",
         "`on`: eye vertices are also connected to lamps by way of smooth glass and mirrors, for "
         "light that otherwise only hits find. See the page on specular connections."},
        {"specular_depth", ParamKind::Int, "4",
         "Largest number of reflections and refractions of such a connection, in [1, 8]."}};
}

Specular::Specular(const IntegratorParams& p) {
    constexpr std::array<Choice<bool>, 2> kChoices{{{"off", false}, {"on", true}}};
    const int depth = p.integer("specular_depth", 1, ChainEvents::kMost);
    depth_ = p.choice("specular_connections", kChoices) ? depth : 0;
}

void Specular::add(const SampleContext& c, int t, int max_depth, const TechniqueCounts& counts,
                   Workspace& work) const {
    if (!is_on()) return;
    constexpr float kThreshold = 0.1f;  // of the pixel's luminance
    const SpecularLimits limits{max_depth, kThreshold * c.expected_of_pixel()};
    if (const auto j = join_specular(c.scene, work.z, t, limits, c.sampler, counts, work))
        c.sink.add(*j, j->contribution);
}

}  // namespace etendue
