#pragma once
// What the pilots of one choice learn or decide once for all of them.

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "guide/light_selection.h"
#include "integrator/specular_pilot.h"
#include "manifold/seed_photons.h"

namespace etendue {

/// Not for two renderings at a time.
struct SharedByPilots {
    std::shared_ptr<const SeedPhotons> photons;
    std::map<std::string, SpecularPilot> specular;  ///< By specular_pilot_name().
    std::optional<LightSelections> lights;          ///< Of next events.
};

/// With a guide, walks can find what otherwise connections find.
inline std::string specular_pilot_name(const std::string& method, bool is_guided) {
    return method + (is_guided ? ":guide=on" : "");
}

}  // namespace etendue
