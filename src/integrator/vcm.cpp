// Vertex connection and merging, or unified path sampling [Georgiev et al. 2012; Hachisuka et al. 2012]: bidirectional
// path tracing whose eye vertices also merge with light vertices of all paths of the pass. With `exact` they gather
// them instead, with the disc's approximation of the probability that the pair was found [Bekaert et al. 2003; Qin et
// al. 2015, fig. 11 b].
//
// Techniques: C(s,t) and M(s,t), or U(s,t). Consistent where the radius shrinks [Knaus & Zwicker 2011].

#include "integrator/vcm.h"

#include <stdexcept>

#include "integrator/gather.h"
#include "integrator/photon_memory.h"

namespace etendue {
namespace {

/// Of the scene's.
constexpr float kDefaultRadius = 0.003f;

class VcmIntegrator final : public Integrator {
public:
    explicit VcmIntegrator(const IntegratorParams& p)
        : paths_(p), radius_(p, kDefaultRadius), connects_(p.flag("connections")),
          merges_(p.flag("merges")), is_exact_(p.flag("exact")), memory_(photon_memory(p)) {
        if (!connects_ && !merges_)
            throw std::runtime_error("vcm: connections and merges cannot both be off");
        if (is_exact_ && !merges_) throw std::runtime_error("vcm: exact needs merges");
    }

    void begin_pass(const PassContext& pass) override {
        paths_.begin_pass(pass);
        worth_.begin_pass(pass.so_far);
        const float radius = radius_.radius(pass.scene, pass.index);
        photons_.trace(pass, paths_, counts(pass.scene, pass.light_paths, radius), radius, memory_);
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths, photons_.radius());
        photons_.paths().restore(c.scene, c.pixel, work.y);
        // q π d² p̃ for p_c [Qin et al. 2015, eq. 7], where q is the survival of the roulette before the dropped vertex.
        const auto by_disc = [](const PairEvent& event, const Join& j, float) {
            return 1 / double(event.from.survival.value() * j.found);
        };
        const Gather gather{c, paths_, photons_, worth_, n, 1, paths_.threshold(c), work};
        paths_.eye_path(c, n, work, [&](int t) {
            paths_.add_next_event(c, n, t, work);
            paths_.connect_to_own(c, n, t, work);
            if (merges_ && is_exact_) gather(t, by_disc);
            if (merges_ && !is_exact_) merge(c, n, t, work);
            return Onward::ByAnyEvent;
        });
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return counts(scene, light_paths, photons_.radius());
    }
    bool traces_light_paths() const override { return true; }
    Estimator estimator() const override {
        return !merges_            ? Estimator::Unbiased
               : radius_.shrinks() ? Estimator::Consistent
                                   : Estimator::Biased;
    }

private:
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths, float radius) const {
        const float N = float(light_paths);
        TechniqueCounts n;
        n.hit = 1;
        if (connects_) {
            n.next_event = n.connect = 1;
            n.splat = N;
            n.hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f;
        }
        if (merges_) {
            (is_exact_ ? n.gather : n.merge) = N;
            n.disc = kPi * radius * radius;
            n.clamps_disc = false;
        }
        return n;
    }

    void merge(const SampleContext& c, const TechniqueCounts& n, int t, Workspace& work) const {
        const ArrivalSide side = work.z[t - 1].arrival_side();
        const auto may_pair = [&](const Partner& y) {
            return y.s + t - 2 <= paths_.max_depth() && side.admits(y.side);
        };
        photons_.for_each_near(work.z[t - 1].p, may_pair, [&](const Partner& y) {
            photons_.paths().restore_first(c.scene, y.vertex, y.s, work.is_observed, work.pair);
            const auto j = join_merge(work.pair, y.s, work.z, t, n);
            if (!j) return;
            ++work.stats.pairs;
            c.sink.add(*j, j->contribution * c.splat_scale);
        });
    }

    Bidirectional paths_;
    RadiusSchedule radius_;
    bool connects_, merges_, is_exact_;
    uint64_t memory_;
    Photons photons_;
    PairWorth worth_;
};

}  // namespace

IntegratorEntry vcm_entry() {
    std::vector<ParamInfo> params = Bidirectional::params();
    for (const ParamInfo& p : RadiusSchedule::params("Distance within which vertices are merged in "
                                                     "the first pass, in scene units; 0: 0.3 % "
                                                     "of the radius of the scene's bounds."))
        params.push_back(p);
    params.push_back(memory_param());
    params.push_back({"connections", ParamKind::Bool, "true",
                      "Whether sub-paths are connected, to emitters and the lens too."});
    params.push_back({"merges", ParamKind::Bool, "true", "Whether vertices are merged."});
    params.push_back(
        {"exact", ParamKind::Bool, "false",
         "Whether the paths of merges are true ones, with a shadow ray and the BSDFs of "
         "both ends; their probability stays that of a disc [Bekaert et al. 2003]."});
    return {{"integrator", "vcm",
             "Vertex connection and merging. Consistent; biased with a fixed radius.", params},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<VcmIntegrator>(p);
            }};
}

}  // namespace etendue
