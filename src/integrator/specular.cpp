#include "integrator/specular.h"

#include "integrator/specular_pilot.h"

namespace etendue {

std::vector<ParamInfo> Specular::params() {
    return {
        {"specular_connections", ParamKind::String, "off",
         "`on`: eye vertices are also connected to lamps by way of smooth glass and mirrors, for "
         "light that otherwise only hits find. `auto`: on where some walks before the first pass "
         "show that it helps. See the page on specular connections."},
        {"specular_depth", ParamKind::Int, "4",
         "Largest number of reflections and refractions of such a connection, in [1, 8]."}};
}

Specular::Specular(const IntegratorParams& p) {
    constexpr std::array<Choice<Mode>, 3> kModes{
        {{"off", Mode::Off}, {"on", Mode::On}, {"auto", Mode::Auto}}};
    mode_ = p.choice("specular_connections", kModes);
    is_used_ = mode_ != Mode::Off;
    depth_ = p.integer("specular_depth", 1, ChainEvents::kMost);
}

void Specular::decide(const PassContext& pass, const DepthOptions& depth,
                      const TechniqueCounts& counts) {
    if (mode_ != Mode::Auto || pass.film.passes() > 0 || counts.specular_depth == 0) return;
    is_used_ = run_specular_pilot(pass, depth, counts).is_worthwhile();
}

void Specular::save(LearnedState& to) const {
    if (mode_ == Mode::Auto) to.put(is_used_);
}

void Specular::load(LearnedState& from) {
    if (mode_ == Mode::Auto) from.get(is_used_);
}

void Specular::add_figures(std::vector<std::pair<std::string, double>>& figures) const {
    if (mode_ == Mode::Auto) figures.push_back({"specular_connections", is_used_ ? 1 : 0});
}

}  // namespace etendue
