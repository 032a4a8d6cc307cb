#pragma once
// What the methods of photon mapping share: which surfaces are diffuse enough, and the eye path to the first of them.
//
// Every path is made in one way. Let x_m be its first vertex from the eye that is diffuse enough and scatters by a smooth
// event. Where there is one, photons bring the light to it; where m = 1 a next event does, if there are such. Where
// there is none, hits and next events share the path; and what neither can make (from an emitter without extent by delta
// events alone to a glossy vertex) photons bring to the glossy vertex.

#include "integrator/bidirectional.h"

namespace etendue {

class PhotonMapping {
public:
    static std::vector<ParamInfo> params();
    PhotonMapping(const IntegratorParams& params, bool next_event);

    void learn(const LearnContext& pass) { paths_.learn(pass); }
    void load(LearnedState& from) { paths_.load(from); }

    /// Samples of what is made without photons.
    TechniqueCounts counts() const { return {.hit = 1, .next_event = next_event_ ? 1.0f : 0.0f}; }
    /// Light vertices of the shortest path that photons make.
    int shortest() const { return next_event_ ? 3 : 2; }

    bool is_diffuse(const Vertex& v) const { return v.bsdf.roughness() >= roughness_; }
    /// Whether z_{t-1} may be joined, and is diffuse enough.
    bool takes_photons(const SubPath& z, int t) const {
        return paths_.is_joinable(z, t) && is_diffuse(z[t - 1]);
    }

    /// C(0,t), and C(1,t) where z_{t-1} may be joined.
    void add_direct(const SampleContext& c, int t, Workspace& work) const;

    /// One more vertex of the eye path z; where photons have brought the light of smooth events (`only_delta`), by a delta
    /// event. False where the path ends.
    bool walk_on(const WalkContext& walk, Sampler& sampler, SubPath& z, bool only_delta) const;

    const Bidirectional& paths() const { return paths_; }

private:
    Bidirectional paths_;
    float roughness_;
    bool next_event_;
};

}  // namespace etendue
