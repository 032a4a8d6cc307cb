// Vertex connection and merging, or unified path sampling [Georgiev et al. 2012; Hachisuka et al. 2012]: bidirectional
// path tracing whose eye vertices also merge with light vertices of all paths of the pass.
//
// Techniques: C(s,t) and M(s,t). Consistent where the radius shrinks, r_i = r_1 i^((α-1)/2) [Knaus & Zwicker 2011].

#include "integrator/vcm.h"

#include <cmath>
#include <stdexcept>

#include "integrator/photons.h"

namespace etendue {
namespace {

class VcmIntegrator final : public Integrator {
public:
    explicit VcmIntegrator(const IntegratorParams& p)
        : paths_(p), radius_(p.number("radius")), alpha_(p.number("alpha")),
          connects_(p.flag("connections")), merges_(p.flag("merges")), memory_(photon_memory(p)) {
        if (!(radius_ >= 0)) throw std::runtime_error("vcm: radius must not be negative");
        if (!(alpha_ > 0 && alpha_ <= 1)) throw std::runtime_error("vcm: alpha must lie in (0, 1]");
        if (!connects_ && !merges_)
            throw std::runtime_error("vcm: connections and merges cannot both be off");
    }

    void begin_pass(const PassContext& pass) override {
        paths_.begin_pass(pass);
        const float radius = (radius_ > 0 ? radius_ : 0.003f * pass.scene.bounds().radius()) *
                             std::pow(float(pass.index + 1), (alpha_ - 1) / 2);
        photons_.trace(pass, paths_, counts(pass.scene, pass.light_paths, radius), radius, memory_);
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths, photons_.radius());
        photons_.paths().restore(c.scene, c.pixel, work.y);
        const auto join = [&](int t) {
            paths_.connect_to_own(c, n, t, work);
            if (!merges_) return;
            photons_.for_each_near(work.z[t - 1].p, [&](uint32_t vertex) {
                const int s = photons_.paths().depth(vertex) + 1;
                if (s + t - 2 > paths_.max_depth()) return;
                photons_.paths().restore_first(c.scene, vertex, s, work.is_observed, work.pair);
                if (const auto j = join_merge(work.pair, s, work.z, t, n))
                    c.sink.add(*j, j->contribution * c.splat_scale);
            });
        };
        paths_.eye_path(c, n, work, join);
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return counts(scene, light_paths, photons_.radius());
    }
    bool traces_light_paths() const override { return true; }
    Estimator estimator() const override {
        return !merges_     ? Estimator::Unbiased
               : alpha_ < 1 ? Estimator::Consistent
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
            n.merge = N;
            n.disc = kPi * radius * radius;
        }
        return n;
    }

    Bidirectional paths_;
    float radius_, alpha_;
    bool connects_, merges_;
    uint64_t memory_;
    Photons photons_;
};

}  // namespace

IntegratorEntry vcm_entry() {
    std::vector<ParamInfo> params = Bidirectional::params();
    params.push_back({"radius", ParamKind::Float, "0",
                      "Distance within which vertices are merged in the first pass, in scene "
                      "units; 0: 0.3 % of the radius of the scene's bounds."});
    params.push_back(memory_param());
    params.push_back({"alpha", ParamKind::Float, "0.75",
                      "The radius of pass i is radius·i^((alpha-1)/2); 1: it does not shrink, and "
                      "the image stays biased."});
    params.push_back({"connections", ParamKind::Bool, "true",
                      "Whether sub-paths are connected, to emitters and the lens too."});
    params.push_back({"merges", ParamKind::Bool, "true", "Whether vertices are merged."});
    return {{"integrator", "vcm",
             "Vertex connection and merging. Consistent; biased with a fixed radius.", params},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<VcmIntegrator>(p);
            }};
}

}  // namespace etendue
