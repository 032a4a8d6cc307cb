#pragma once
// Integrators of tests by name.

#include <memory>
#include <string>

#include "integrator/integrator.h"
#include "random_guide.h"

namespace etendue::test {

/// What `text` says; here, there is also guide=random.
inline IntegratorSpec spec_of(const Scene& scene, const std::string& text) {
    IntegratorSpec spec = IntegratorSpec::parse(text);
    if (const auto guide = spec.params.find("guide");
        guide != spec.params.end() && guide->second == "random") {
        guide->second = "on";
        constexpr float kKappa = 1000;
        spec.guide = std::make_shared<const Guide>(random_guide(scene, kKappa, 1));
    }
    return spec;
}

}  // namespace etendue::test
