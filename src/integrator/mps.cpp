// Metropolis photon sampling [Fan et al. 2005]: photon mapping as in pm.cpp, whose photons come from Markov chains. With the
// target importons, a state is the set of random numbers of a light path. Small steps change all of them, block steps
// draw those of some vertices anew, and large steps draw a whole path anew. In primary sample space all steps are
// symmetric. A step that changes only late vertices keeps the beginning of the path, like the perturbations of [Fan et
// al. 2005]. With the target path, it is a full path, see path_photons.cpp. User paths are a second way to draw the
// beginning of a light path; the densities of both ways add up.
//
// The target of a photon with flux Φ at x is lum(Φ) times
// - importons: the density of importance I at x, plus a floor. The power of a photon is b Φ / (lum(Φ) I).
// - path: q a, with a = min(1, h/h_0) but at least 0.05, where q is the density of the remainder of the path from x to
//   the lens, and h the response of the lens to this remainder. The power of a photon is b Φ/lum(Φ) r, where r is the
//   number of trials of remainders until one succeeds with probability a, so that E[r] = 1/P(x). The printed power, Φ
//   times a ratio of path contributions, compares densities over spaces of different dimensions.
//
// Both are exact for any I > 0 and any a in [0, 1] that are fixed before the chains start. A state at which a chain
// stays accumulates its power on the same photons, and proposals leave their expected share. The densities of the maps
// are biased as in pm.cpp.

#include "integrator/mps.h"

#include "integrator/metropolis_photons.h"
#include "integrator/pm.h"

namespace etendue {
namespace {

constexpr std::array<Choice<PhotonTarget>, 2> kTargets{
    {{"importons", PhotonTarget::Importons}, {"path", PhotonTarget::Path}}};

MetropolisPhotonOptions options(const IntegratorParams& p, uint64_t max_bytes) {
    return {.target = p.choice("target", kTargets),
            .mutations = uint64_t(p.integer("mutations", 1, 1 << 30)),
            .chains = p.integer("chains", 1, 1 << 20),
            .p_large = double(p.number("p_large", 0.01f, 1.0f)),
            .precision = double(p.number("precision", 0.001f, 0.5f)),
            .least_share = double(p.number("least_share", 0, 1)),
            .max_bytes = max_bytes,
            .user_paths = p.string("user_paths"),
            .user_share = double(p.number("user_share", 0.01f, 0.99f))};
}

}  // namespace

IntegratorEntry mps_entry() {
    std::vector<ParamInfo> params = photon_map_params(
        {"mutations", ParamKind::Int, "500000", "Number of mutations that make the photons."});
    params.push_back(
        {"target", ParamKind::String, "importons",
         "Target function of the chains for a photon: importons (its flux times the density of "
         "importance at its position) or path (its flux times the clamped response of the lens "
         "to a path from there)."});
    params.push_back({"p_large", ParamKind::Float, "0.3",
                      "Probability of a large step, which is an independent light path; in [0.01, "
                      "1]."});
    params.push_back({"chains", ParamKind::Int, "256",
                      "Number of chains; it does not depend on the number of threads."});
    params.push_back(
        {"precision", ParamKind::Float, "0.02",
         "Required relative standard error of the normalisation, 0.001 to 0.5; determines the "
         "number of light paths of the start-up."});
    params.push_back(
        {"user_paths", ParamKind::String, "",
         "JSON file of important light sub-paths, which `etendue paths` makes and "
         "checks; a part of the independent light paths (with target=path, of the proposals, too) "
         "follows them."});
    params.push_back({"user_share", ParamKind::Float, "0.5",
                      "Fraction of the independent light paths that follow user paths, in [0.01, "
                      "0.99]; with target=path, also of proposals near user paths among these and "
                      "bidirectional mutations."});
    params.push_back(
        {"least_share", ParamKind::Float, "0.25",
         "A photon with less than this fraction, in [0, 1], of the power of one mutation is kept "
         "with a probability proportional to its power, which is increased accordingly.",
         true});
    return {{"integrator", "mps",
             "Metropolis photon sampling: photon mapping with photons where the image needs them. "
             "Biased.",
             params},
            [](const IntegratorParams& params_of_spec) {
                return make_photon_map_integrator(
                    params_of_spec,
                    [](const IntegratorParams& p, const PhotonMapping& mapping,
                       uint64_t max_bytes) -> std::unique_ptr<PhotonSource> {
                        return std::make_unique<MetropolisPhotons>(mapping, options(p, max_bytes));
                    });
            }};
}

}  // namespace etendue
