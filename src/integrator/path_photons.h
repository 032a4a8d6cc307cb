#pragma once
// Complete paths from an emitter to the lens as the states of chains that store photons [Fan et al. 2005].

#include "integrator/photon_deposits.h"
#include "mcmc/user_paths.h"

namespace etendue {

/// `user_share`: fraction of proposals near user paths among these and bidirectional mutations. nullptr if no path that
/// stores a photon is short enough.
std::unique_ptr<PhotonStates> path_photons(const PassContext& context, const PhotonMapping& mapping,
                                           const std::optional<UserPaths>& user_paths,
                                           double user_share);

}  // namespace etendue
