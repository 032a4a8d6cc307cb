// Unbiased photon gathering [Qin et al. 2015]: an eye vertex and a light vertex near it form a pair; one of the two is
// dropped, the other joined by a shadow ray, and Bernoulli trials estimate the reciprocal of the probability that the
// pair was found.
//
// Techniques: U(s,t), for paths of three edges and more; `upg+bdpt` has C(s,t) as well. Unbiased for the paths it can
// make, which for `upg` alone leaves out short ones and those where every vertex or its neighbours are delta events.

#include "integrator/upg.h"

#include <stdexcept>

#include <fmt/format.h>

#include "integrator/photons.h"
#include "pathspace/reciprocal.h"

namespace etendue {
namespace {

class UpgIntegrator final : public Integrator {
public:
    UpgIntegrator(const IntegratorParams& p, bool connects)
        : paths_(p), radius_(p.number("radius")), connects_(connects) {
        if (!(radius_ >= 0))
            throw std::runtime_error(
                fmt::format("{}: radius must not be negative", p.integrator()));
    }

    void begin_pass(const PassContext& pass) override {
        const float radius = gather_radius(radius_, pass.scene);
        photons_.trace(pass, paths_, counts(pass.scene, pass.light_paths, radius), radius);
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths, photons_.radius());
        photons_.paths().restore(c.scene, c.pixel, work.y);
        paths_.eye_path(c, n, work, [&](int t) {
            photons_.for_each_near(work.z[t - 1].p,
                                   [&](uint32_t vertex) { gather(c, n, t, vertex, work); });
        });
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return counts(scene, light_paths, photons_.radius());
    }
    bool traces_light_paths() const override { return true; }
    Estimator estimator() const override { return Estimator::Unbiased; }

private:
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths, float radius) const {
        const float N = float(light_paths);
        TechniqueCounts n;
        if (connects_) {
            n.hit = n.next_event = n.connect = 1;
            n.splat = N;
            n.hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f;
        }
        n.gather = N;
        n.disc = kPi * radius * radius;
        n.min_pair_edges = 3;
        return n;
    }

    void gather(const SampleContext& c, const TechniqueCounts& n, int t, uint32_t vertex,
                Workspace& work) const {
        const SubPath& z = work.z;
        SubPath& y = work.pair;
        const int s = photons_.paths().restore_up_to(c.scene, vertex, 2, work.is_observed, y);
        if (s + t - 2 > paths_.max_depth()) return;
        const auto drops_eye = drops_eye_vertex_of_pair(y, s, z, t);
        if (!drops_eye) return;
        ++work.stats.pairs;
        const auto j = join_gather(c.scene, y, s, z, t, n, *drops_eye);
        if (!j) return;
        const uint32_t number = uint32_t(hash_combine(vertex, uint64_t(t)));
        const float scale = std::fabs(z.film_weight) * c.splat_scale;
        const auto value = paths_.test(c, *j, scale / j->found, number, work);
        if (!value) return;
        ++work.stats.visible_pairs;
        c.sampler.seek(Stream::Auxiliary, number);
        const PairEvent event{.from = *drops_eye ? z[t - 2] : y[s - 2],
                              .mode =
                                  *drops_eye ? TransportMode::Radiance : TransportMode::Importance,
                              .u_emission = y.u_emission,
                              .center = *drops_eye ? y[s - 1].p : z[t - 1].p,
                              .radius = photons_.radius()};
        const double r =
            reciprocal_probability(c.scene, event, c.sampler, work.scratch, work.stats);
        c.sink.add(*j, *value * float(r * c.splat_scale));
    }

    Bidirectional paths_;
    float radius_;
    bool connects_;
    Photons photons_;
};

std::vector<ParamInfo> params() {
    std::vector<ParamInfo> params = Bidirectional::params();
    params.push_back(radius_param());
    return params;
}

}  // namespace

IntegratorEntry upg_entry() {
    return {{"integrator", "upg",
             "Unbiased photon gathering alone. Unbiased for the paths it can make.", params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<UpgIntegrator>(p, false);
            }};
}

IntegratorEntry upg_bdpt_entry() {
    return {{"integrator", "upg+bdpt",
             "Unbiased photon gathering with bidirectional path tracing. Unbiased.", params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<UpgIntegrator>(p, true);
            }};
}

}  // namespace etendue
