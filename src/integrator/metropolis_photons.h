#pragma once
// Metropolis photon sampling [Fan et al. 2005]: a source of photons from Markov chains, for the same maps as photons of
// traced light paths. See mps.cpp for the method.

#include "integrator/markov.h"
#include "integrator/photon_deposits.h"
#include "mcmc/user_paths.h"

namespace etendue {

/// The target function of the chains for a photon.
enum class PhotonTarget : uint8_t {
    Importons,  ///< Its flux times a density of importons.
    Path,       ///< Its flux times the clamped response of the lens to a path from it.
};

struct MetropolisPhotonOptions {
    PhotonTarget target = PhotonTarget::Importons;
    uint64_t mutations = 500000;
    int chains = 256;
    double p_large = 0.3;
    double precision = 0.02;    ///< Required relative standard error of the normalisation b.
    double least_share = 0.25;  ///< Photons with a smaller share of a step's power pass roulette.
    uint64_t max_bytes = uint64_t(1) << 32;
    std::string user_paths;  ///< File; empty: none.
    /// Target Importons: fraction of the independent light paths that follow user paths; Path: fraction of their proposals
    /// among these and bidirectional mutations.
    double user_share = 0.5;
};

class MetropolisPhotons final : public PhotonSource {
public:
    /// trace() throws std::runtime_error if the photons need more than max_bytes, or if a user path cannot be used.
    MetropolisPhotons(const PhotonMapping& mapping, const MetropolisPhotonOptions& options);
    ~MetropolisPhotons() override;

    MapPhotons trace(const PassContext& context, uint32_t pass,
                     const std::function<std::vector<Importon>()>& importons) override;
    uint64_t light_paths() const override { return options_.mutations; }
    Figures figures() const override;

private:
    /// Statistics of the target, from independent samples that are then discarded.
    struct Pilot {
        double b = 0, relative_variance = 0;
        uint64_t samples = 0;
    };
    Pilot run_pilot(const PassContext& context, const StateSpace& space) const;
    /// nullptr if no path stores a photon.
    std::unique_ptr<PhotonStates>
    make_states(const PassContext& context,
                const std::function<std::vector<Importon>()>& importons);

    const PhotonMapping& mapping_;
    MetropolisPhotonOptions options_;
    std::optional<PhotonImportance> importance_;  ///< Set by the first trace(), then fixed.
    std::optional<UserPaths> user_paths_;         ///< The same.
    std::unique_ptr<PhotonStates> states_;        ///< The same.

    // Statistics of the last trace().
    Pilot pilot_;
    uint64_t pool_ = 0, photons_ = 0, reciprocals_ = 0, trials_ = 0;
    double b_ = 0;
    ChainStats stats_;
};

}  // namespace etendue
