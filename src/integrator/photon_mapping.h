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

    void begin_pass(const PassContext& pass) { paths_.begin_pass(pass); }

    /// Samples of what is made without photons.
    TechniqueCounts counts() const { return {.hit = 1, .next_event = next_event_ ? 1.0f : 0.0f}; }
    /// Light vertices of the shortest path that photons make.
    int shortest() const { return next_event_ ? 3 : 2; }

    bool is_diffuse(const Vertex& v) const { return v.bsdf.roughness() >= roughness_; }
    /// Of an eye path, after photons have brought their light to a diffuse vertex.
    static Onward after_photons(const Vertex& v) {
        return v.bsdf.has_delta() ? Onward::ByDeltaEvents : Onward::Ends;
    }

    /// The eye path of c.pixel, whose steps draw their numbers from `of_walk`, with its hits and next events.
    /// `add_photons(t, is_diffuse)` is called at every z_{t-1} that may be joined.
    template <class AddPhotons>
    void eye_path(const SampleContext& c, Sampler& of_walk, Workspace& work,
                  const AddPhotons& add_photons) const {
        const SampleContext walk = c.with(of_walk, c.sink);
        paths_.eye_path(walk, counts(), work, [&](int t) {
            const Vertex& v = work.z[t - 1];
            const bool ends = is_diffuse(v);
            if (next_event_) add_next_event(c, t, ends, work);
            add_photons(t, ends);
            return ends ? after_photons(v) : Onward::ByAnyEvent;
        });
    }

    const Bidirectional& paths() const { return paths_; }

private:
    void add_next_event(const SampleContext& c, int t, bool ends, Workspace& work) const;

    Bidirectional paths_;
    float roughness_;
    bool next_event_;
};

}  // namespace etendue
