// Progressive photon mapping [Hachisuka et al. 2008], and stochastic progressive photon mapping [Hachisuka & Jensen 2009],
// with the radius schedule of [Knaus & Zwicker 2011]: an eye path ends at the first vertex that is diffuse enough, and is
// merged there with all light vertices within the radius.
//
// Techniques: M(s,t), and hits and next events, each path by one of them (see photon_mapping.h). Consistent where the
// radius shrinks.

#include "integrator/sppm.h"

#include <stdexcept>

#include "integrator/photon_mapping.h"
#include "integrator/photon_memory.h"
#include "integrator/photons.h"

namespace etendue {
namespace {

/// Of the scene's: more than where merges are one technique among many.
constexpr float kDefaultRadius = 0.01f;

class SppmIntegrator final : public Integrator {
public:
    /// `eye_paths`: how many each pixel has; 0: new ones in every pass.
    SppmIntegrator(const IntegratorParams& p, int eye_paths)
        : mapping_(p, p.flag("next_event")), radius_(p, kDefaultRadius), memory_(photon_memory(p)),
          eye_paths_(uint32_t(eye_paths)) {}

    void begin_pass(const PassContext& pass) override {
        mapping_.begin_pass(pass);
        photons_.trace(pass, mapping_.paths(), {}, radius_.radius(pass.scene, pass.index), memory_);
        pass_ = pass.index;
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        Sampler of_walk = c.sampler;
        if (eye_paths_ > 0) of_walk.start(pass_ % eye_paths_, c.pixel);
        mapping_.eye_path(c, of_walk, work,
                          [&](int t, bool is_diffuse) { merge(c, t, is_diffuse, work); });
    }

    TechniqueCounts counts(const Scene&, uint64_t light_paths) const override {
        TechniqueCounts n = mapping_.counts();
        n.merge = float(light_paths);
        n.disc = disc();
        return n;
    }
    bool traces_light_paths() const override { return true; }
    Estimator estimator() const override {
        return radius_.shrinks() ? Estimator::Consistent : Estimator::Biased;
    }

private:
    float disc() const { return kPi * sqr(photons_.radius()); }

    void merge(const SampleContext& c, int t, bool is_diffuse, Workspace& work) const {
        if (!is_diffuse && !c.scene.has_delta_emitters()) return;
        const LightPaths& light = photons_.paths();
        const auto may_pair = [&](const Partner& y) {
            return y.s >= mapping_.shortest() && y.s + t - 2 <= mapping_.paths().max_depth();
        };
        photons_.for_each_near(work.z[t - 1].p, may_pair, [&](const Partner& y) {
            const Photon photon = light.photon(y.vertex);
            if (!is_diffuse &&
                !(photon.emitter->is_delta() && light.came_by_delta_events(y.vertex)))
                return;
            const auto j = join_photon(photon, work.z, t, disc());
            if (!j) return;
            if (work.is_observed) light.restore_first(c.scene, y.vertex, y.s, true, work.pair);
            c.sink.add(*j, j->contribution * c.splat_scale);
        });
    }

    PhotonMapping mapping_;
    RadiusSchedule radius_;
    uint64_t memory_;
    uint32_t eye_paths_;
    uint32_t pass_ = 0;
    Photons photons_;
};

std::vector<ParamInfo> params() {
    std::vector<ParamInfo> params = PhotonMapping::params();
    for (const ParamInfo& p : RadiusSchedule::params("Distance within which photons are merged in "
                                                     "the first pass, in scene units; 0: 1 % of "
                                                     "the radius of the scene's bounds."))
        params.push_back(p);
    params.push_back(memory_param());
    params.push_back({"next_event", ParamKind::Bool, "true",
                      "Whether direct light comes by shadow rays; else by photons, and at glossy "
                      "surfaces by chance."});
    return params;
}

}  // namespace

IntegratorEntry sppm_entry() {
    return {
        {"integrator", "sppm",
         "Stochastic progressive photon mapping: new eye paths in every pass. Consistent; biased "
         "with a fixed radius.",
         params()},
        [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
            return std::make_unique<SppmIntegrator>(p, 0);
        }};
}

IntegratorEntry ppm_entry() {
    std::vector<ParamInfo> all = params();
    all.push_back({"eye_paths", ParamKind::Int, "16",
                   "Eye paths of each pixel; pass i merges at the number i modulo eye_paths."});
    return {
        {"integrator", "ppm",
         "Progressive photon mapping: the same eye paths over and over. Consistent for what these "
         "see; biased with a fixed radius.",
         all},
        [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
            const int eye_paths = p.integer("eye_paths");
            if (eye_paths < 1) throw std::runtime_error("ppm: eye_paths must be 1 or more");
            return std::make_unique<SppmIntegrator>(p, eye_paths);
        }};
}

}  // namespace etendue
