#pragma once
// Some walks before the first pass, which tell whether specular connections are worth their time.

#include "integrator/integrator.h"
#include "manifold/seed_photons.h"

namespace etendue {

/// Result of run_specular_pilot(): sums over the walks.
struct SpecularPilot {
    double luminance =
        0;  ///< Mean of the image, without what the connections of two sub-paths would add.
    double light = 0;  ///< Contributions.
    double light_of_none =
        0;  ///< Of these, what nothing else makes: light of lamps without extent.
    /// Second moments of the contributions without and with specular connections, relative to the square of the brightness of
    /// their part of the image.
    double moment_without = 0, moment_with = 0;
    double moment_of_hits =
        0;  ///< Part of moment_without: of hits of paths that a specular connection may make.
    double rays_without = 0, rays_with = 0;  ///< As many as take the same time.

    static constexpr double kLeastShare = 0.01;

    bool is_worthwhile() const {
        if (light_of_none > kLeastShare * light) return true;
        return moment_of_hits > kLeastShare * moment_without &&
               moment_with * rays_with < moment_without * rays_without;
    }
    /// Of methods with light paths: whether the connections make light that hits and chains find so rarely that short pilots
    /// of chains tell nothing of it.
    bool is_beyond_chains() const {
        // 14 to 24 on lantern, where chains find all light; 117 to 185 on sms-plane, where they lack 4 % of it after 50
        // samples; at most 4 where connections make little of the light.
        constexpr double kMostGain = 50;
        return light_of_none > kLeastShare * light || moment_without > kMostGain * moment_with;
    }
};

/// Walks with random numbers that no pass uses. `counts` has specular connections, whose seeds are drawn from `photons`, too.
SpecularPilot run_specular_pilot(const PassContext& pass, const DepthOptions& depth,
                                 const TechniqueCounts& counts, const SeedPhotons& photons);

}  // namespace etendue
