#pragma once
// Metropolis photon sampling [Fan et al. 2005]: photons of Markov chains, as many as matter to the image, into the same maps
// as those of traced light paths. See mps.cpp for the method.

#include "integrator/markov.h"
#include "integrator/photon_source.h"

namespace etendue {

/// What a photon is worth to chains.
enum class PhotonTarget : uint8_t {
    Importons,  ///< Its flux times a density of importons.
    Path,       ///< Its flux where a random path from it to the lens is not blocked.
};

struct MetropolisPhotonOptions {
    PhotonTarget target = PhotonTarget::Importons;
    uint64_t mutations = 500000;
    int chains = 256;
    double p_large = 0.3;
    double precision = 0.02;    ///< Relative standard error of B* that the start-up must reach.
    double least_share = 0.25;  ///< Photons of smaller shares of a step have roulette.
    uint64_t max_bytes = uint64_t(1) << 32;
};

class PhotonSpace;

class MetropolisPhotons final : public PhotonSource {
public:
    /// trace() throws std::runtime_error where the photons would take more than max_bytes.
    MetropolisPhotons(const PhotonMapping& mapping, const MetropolisPhotonOptions& options);
    ~MetropolisPhotons() override;

    MapPhotons trace(const PassContext& context, uint32_t pass,
                     const std::function<std::vector<Importon>()>& importons) override;
    uint64_t light_paths() const override { return options_.mutations; }
    Figures figures() const override;

private:
    /// Of the target, from independent samples that are thrown away.
    struct Pilot {
        double b = 0, relative_variance = 0;
        uint64_t samples = 0;
    };
    Pilot run_pilot(const PassContext& context, const PhotonSpace& space) const;

    const PhotonMapping& mapping_;
    MetropolisPhotonOptions options_;
    std::optional<PhotonImportance> importance_;  ///< Once there is a map; the same for all.

    // Of the last trace.
    Pilot pilot_;
    uint64_t pool_ = 0, photons_ = 0, deposits_ = 0, trials_ = 0;
    double b_ = 0;
    ChainStats stats_;
};

}  // namespace etendue
