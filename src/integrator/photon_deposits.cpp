#include "integrator/photon_deposits.h"

#include <bit>

#include "math/hash.h"

namespace etendue {

void PhotonDeposits::add(const ChainState& state, double factor) {
    const uint64_t key = hash_combine(terms_.key, number_++);
    // A few photons of equal power give less noise than many photons of small power.
    const double share = factor * state.target / terms_.unit, least = terms_.least_share;
    if (share < least) {
        if (!(to_unit_double(hash_combine(key, 0)) * least < share)) return;
        factor *= least / share;
    }
    deposit(state, factor, share, key);
}

void PhotonDeposits::store(const MapPhoton& photon, Maps maps) {
    bool is_new = maps.global && global_.store(photon, terms_.out.photons.global);
    if (maps.caustic) is_new |= caustic_.store(photon, terms_.out.photons.caustic);
    if (is_new) terms_.memory.add(1);
}

bool PhotonDeposits::Repeats::store(const MapPhoton& photon, std::vector<MapPhoton>& map) {
    const auto [at, is_new] = places_.try_emplace(place_key(photon), map.size());
    if (is_new)
        map.push_back(photon);
    else
        map[at->second].power += photon.power;
    return is_new;
}

uint64_t place_key(const MapPhoton& photon) {
    uint64_t key = uint64_t(photon.s);
    for (const float x : {photon.p.x, photon.p.y, photon.p.z, photon.wi.x, photon.wi.y})
        key = hash_combine(key, std::bit_cast<uint32_t>(x));
    return key;
}

}  // namespace etendue
