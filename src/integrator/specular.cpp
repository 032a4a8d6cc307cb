#include "integrator/specular.h"

#include "integrator/seed_photon_walks.h"
#include "integrator/shared_by_pilots.h"

namespace etendue {

std::vector<ParamInfo> Specular::params() {
    return {
        {"specular_connections", ParamKind::String, "auto",
         "`on`: eye vertices are also connected to lamps by way of smooth glass and mirrors, for "
         "light that otherwise only hits find. `auto`: on where some walks before the first pass "
         "show that it helps. `off`: never. See the page on specular connections."},
        {"specular_depth", ParamKind::Int, "4",
         "Largest number of reflections and refractions of such a connection, in [1, 8]."}};
}

Specular::Specular(const IntegratorParams& p) {
    constexpr std::array<Choice<Mode>, 3> kModes{
        {{"off", Mode::Off}, {"on", Mode::On}, {"auto", Mode::Auto}}};
    mode_ = p.choice("specular_connections", kModes);
    is_used_ = mode_ != Mode::Off;
    depth_ = p.integer("specular_depth", 1, ChainEvents::kMost);
    method_ = specular_pilot_name(p.integrator(), p.given_guide() != nullptr);
    pilots_ = p.shared_by_pilots();
}

void Specular::prepare(const PassContext& pass, const DepthOptions& depth, TechniqueCounts counts) {
    // Few photons tell whether connections are worth their time, and are enough for pilots.
    constexpr uint64_t kWalks = 1 << 17, kWalksOfPilot = 1 << 14;
    if (mode_ == Mode::Off || pass.film.passes() > 0) return;
    is_used_ = pass.scene.may_have_chains();
    if (!is_used_) return;
    const auto photons = [&](uint64_t walks) {
        return std::make_shared<const SeedPhotons>(trace_seed_photons(pass, depth_, walks));
    };
    const bool is_pilot = pilots_ != nullptr;
    SharedByPilots own;
    SharedByPilots& pilots = is_pilot ? *pilots_ : own;
    if (!pilots.photons) pilots.photons = photons(kWalksOfPilot);
    auto known = pilots.specular.find(method_);
    if (known == pilots.specular.end()) {
        counts.specular_depth = depth_;
        known = pilots.specular
                    .emplace(method_, run_specular_pilot(pass, depth, counts, *pilots.photons))
                    .first;
    }
    luminance_ = float(known->second.luminance);
    if (mode_ == Mode::Auto) is_used_ = known->second.is_worthwhile();
    if (is_used_) photons_ = is_pilot ? pilots.photons : photons(kWalks);
}

void Specular::save(LearnedState& to) const {
    if (mode_ == Mode::Off) return;
    to.put(is_used_);
    to.put(luminance_);
    to.put(photons_ != nullptr);
    if (photons_) photons_->save(to);
}

void Specular::load(LearnedState& from) {
    if (mode_ == Mode::Off) return;
    bool has_photons = false;
    from.get(is_used_);
    from.get(luminance_);
    from.get(has_photons);
    if (!has_photons) return;
    SeedPhotons photons;
    photons.load(from);
    photons_ = std::make_shared<const SeedPhotons>(std::move(photons));
}

void Specular::add_figures(std::vector<std::pair<std::string, double>>& figures) const {
    if (mode_ == Mode::Auto) figures.push_back({"specular_connections", is_used_ ? 1 : 0});
}

}  // namespace etendue
