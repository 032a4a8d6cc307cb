#pragma once
// Common parts of the photon mapping methods: which surfaces are diffuse enough for photons, and the eye path to the
// first of these surfaces.
//
// Every path is made in one way. Let x_m be the first vertex from the eye that is diffuse enough and scatters by a
// smooth event.
// - If x_m exists, photons make the path; for m = 1, next event estimation makes it instead, if it is enabled.
// - Otherwise hits and next events make the path, combined by MIS.
// - Neither of these can make a path that leads from an emitter without extent to a glossy vertex by delta events alone.
//   Photons at the glossy vertex make such a path.

#include "integrator/bidirectional.h"

namespace etendue {

class PhotonMapping {
public:
    static std::vector<ParamInfo> params();
    PhotonMapping(const IntegratorParams& params, bool next_event);

    void learn(const LearnContext& pass) { paths_.learn(pass); }
    void learn(const LearnContext& pass, uint64_t rays) { paths_.learn(pass, rays); }
    void load(LearnedState& from) { paths_.load(from); }

    /// Sample counts of the techniques that use no photons.
    TechniqueCounts counts() const { return {.hit = 1, .next_event = next_event_ ? 1.0f : 0.0f}; }
    /// Number of light vertices of the shortest path that photons make.
    int shortest() const { return next_event_ ? 3 : 2; }

    bool is_diffuse(const Vertex& v) const { return v.bsdf.roughness() >= roughness_; }
    /// Whether z_{t-1} can be joined and is diffuse enough.
    bool takes_photons(const SubPath& z, int t) const {
        return paths_.is_joinable(z, t) && is_diffuse(z[t - 1]);
    }

    /// Adds C(0,t), and C(1,t) if z_{t-1} can be joined.
    void add_direct(const SampleContext& c, int t, Workspace& work) const;

    /// Appends a vertex to the eye path z. With `only_delta`, the path continues by a delta event only, because photons
    /// contribute the light of smooth events. False if the path ends.
    bool walk_on(const WalkContext& walk, Sampler& sampler, SubPath& z, bool only_delta) const;

    const Bidirectional& paths() const { return paths_; }

private:
    Bidirectional paths_;
    float roughness_;
    bool next_event_;
};

}  // namespace etendue
