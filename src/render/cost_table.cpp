#include "render/cost_table.h"

#include <array>
#include <stdexcept>

namespace etendue {
namespace {

/// Costs of what is counted, in seconds; fitted by bench/method-costs.
constexpr double kLightPath = 0.03e-6, kWalkRay = 0.36e-6, kShadowRay = 0.28e-6, kPair = 0.16e-6,
                 kTrialRay = 1.23e-6, kChainRay = 0.60e-6;
/// The same counters cost so much more with a guide: where directions at surfaces are guided, 1.25 times (`bdpt`) to 1.9 times
/// on six scenes, and otherwise 1.1 to 1.4 times.
constexpr double kWithSurfaces = 1.5, kWithoutSurfaces = 1.15;

struct MethodCost {
    const char* method;
    double factor;          ///< What no counter counts, relative to `path`.
    double sample_seconds;  ///< Of a pixel, in the middle of the scenes of the fit.
};
constexpr std::array<MethodCost, 10> kMethodCosts{{{"path", 1.00, 1.5e-6},
                                                   {"bdpt", 1.22, 3.6e-6},
                                                   {"pcbpt", 1.27, 4.0e-6},
                                                   {"upg+bdpt", 1.66, 8.0e-6},
                                                   {"vcm", 1.56, 4.0e-6},
                                                   {"mlt", 1.52, 8.0e-6},
                                                   {"mmlt", 0.98, 9.0e-6},
                                                   {"light", 1.23, 1.7e-6},
                                                   {"upg", 1.45, 6.0e-6},
                                                   {"pssmlt", 1.37, 6.0e-6}}};

const MethodCost& cost_of(const std::string& method) {
    for (const MethodCost& m : kMethodCosts)
        if (method == m.method) return m;
    throw std::logic_error("there are no costs of " + method);
}

}  // namespace

double guided_factor(GuideUse guide) {
    switch (guide) {
    case GuideUse::None: break;
    case GuideUse::WithoutSurfaces: return kWithoutSurfaces;
    case GuideUse::WithSurfaces: return kWithSurfaces;
    }
    return 1;
}

double simulated_seconds(const std::string& method, GuideUse guide, const RenderStats& s) {
    return cost_of(method).factor * guided_factor(guide) *
           (kLightPath * double(s.light_paths) + kWalkRay * double(s.walk_rays) +
            kShadowRay * double(s.shadow_rays) + kPair * double(s.pairs) +
            kTrialRay * double(s.trial_rays) + kChainRay * double(s.chain_rays));
}

double typical_sample_seconds(const std::string& method) {
    return cost_of(method).sample_seconds;
}

double typical_specular_pilot_seconds() {
    return 0.03;
}

double specular_photon_seconds() {
    return 0.1;
}

double training_seconds(uint64_t walks) {
    constexpr double kWalks = 8e-6;  // of each kind one
    return kWalks * double(walks);
}

}  // namespace etendue
