// Progressive photon mapping [Hachisuka et al. 2008], and stochastic progressive photon mapping [Hachisuka & Jensen 2009],
// with the radius schedule of [Knaus & Zwicker 2011]: an eye path ends at the first vertex that is diffuse enough, and is
// merged there with all light vertices within the radius.
//
// Techniques: M(s,t), hits and next events; each path is made by one of them (see photon_mapping.h). Consistent if the
// radius shrinks.

#include "integrator/sppm.h"

#include <stdexcept>

#include "integrator/bdpt.h"
#include "integrator/light_path_options.h"
#include "integrator/photon_mapping.h"
#include "integrator/radius_params.h"
#include "reuse/light_vertex_grid.h"

namespace etendue {
namespace {

class SppmIntegrator final : public Integrator {
public:
    /// `eye_paths`: number of eye paths of each pixel; 0: new eye paths in every pass.
    SppmIntegrator(const IntegratorParams& p, int eye_paths)
        : mapping_(p, p.flag("next_event")), radius_params_(p), light_(p),
          eye_paths_(uint32_t(eye_paths)) {}

    void learn(const LearnContext& pass) override { mapping_.learn(pass); }
    void save(LearnedState& to) const override { mapping_.paths().save(to); }
    void load(LearnedState& from) override { mapping_.load(from); }
    void trace(const PassContext& pass) override {
        pass_ = pass.index;
        radius_ = radius_params_.radius(pass.scene, pass.index);
        cache_.begin(pass.chunks(pass.light_paths), kVertexBytes, light_.memory);
        trace_light_paths(mapping_.paths(), pass, {}, pass.light_paths, cache_);
        cache_.assemble();
        grid_.build(cache_, radius_, mapping_.shortest() - 1);
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = mapping_.counts();
        const WalkContext walk = mapping_.paths().eye_walk(c.scene, n, work.stats);
        Sampler of_walk = c.sampler;
        if (eye_paths_ > 0) of_walk.start(eye_paths_of(pass_), c.index);
        SubPath& z = work.z;

        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        start_eye_path(walk, c.film, c.index, of_walk, z);
        for (int t = 2; t <= z.size(); ++t) {
            mapping_.add_direct(c, t, work);  // C(0,t), C(1,t)
            const bool is_diffuse = mapping_.takes_photons(z, t);
            if (mapping_.paths().is_joinable(z, t)) merge(c, t, is_diffuse, work);  // M(s,t)
            if (!mapping_.walk_on(walk, of_walk, z, is_diffuse)) break;
        }
    }

    uint32_t eye_paths_of(uint32_t pass) const override {
        return eye_paths_ > 0 ? pass % eye_paths_ : pass;
    }
    TechniqueCounts counts(const Scene&, uint64_t light_paths) const override {
        TechniqueCounts n = mapping_.counts();
        n.merge = float(light_paths);
        n.pairs.disc = disc();
        return n;
    }
    uint64_t light_paths(const Scene& scene) const override {
        return light_.count(scene, mapping_.paths().depth(), kVertexBytes);
    }
    uint64_t light_path_memory() const override { return light_.memory; }
    Estimator estimator() const override {
        return radius_params_.shrinks() ? Estimator::Consistent : Estimator::Biased;
    }

private:
    float disc() const { return kPi * sqr(radius_); }

    void merge(const SampleContext& c, int t, bool is_diffuse, Workspace& work) const {
        if (!is_diffuse && !c.scene.has_delta_emitters()) return;
        const int max_depth = mapping_.paths().max_depth();
        const auto choose = [&](const GatherCandidate& y) -> std::optional<Chosen> {
            if (y.s + t - 2 > max_depth) return {};
            return Chosen{};
        };
        grid_.for_each_in(
            {work.z[t - 1].p, radius_}, choose, [&](const GatherCandidate& y, Chosen) {
                const Photon photon = cache_.photon(y.vertex);
                if (!is_diffuse &&
                    !(photon.emitter->is_delta() && cache_.came_by_delta_events(y.vertex)))
                    return;
                const auto join = join_photon(photon, work.z, t, disc());
                if (!join) return;
                if (work.is_observed) cache_.restore_first(c.scene, y.vertex, y.s, true, work.pair);
                c.sink.add(*join, join->contribution * c.splat_scale);
            });
    }

    static constexpr uint64_t kVertexBytes =
        LightVertexCache::kVertexBytes + LightVertexGrid::kVertexBytes;

    PhotonMapping mapping_;
    RadiusParams radius_params_;
    LightPathOptions light_;
    uint32_t eye_paths_;

    // Of the pass.
    uint32_t pass_ = 0;
    float radius_ = 0;
    LightVertexCache cache_;
    LightVertexGrid grid_;
};

std::vector<ParamInfo> sppm_params() {
    return concat(
        {PhotonMapping::params(),
         radius_params("Merging radius of the first pass, in scene units. 0: automatic, a "
                       "disc of about 36 pixels at the median depth, but at most 1 % of "
                       "the radius of what the camera sees."),
         LightPathOptions::params(),
         {{"next_event", ParamKind::Bool, "true",
           "Whether direct light is computed by shadow rays; otherwise by photons, and "
           "at glossy surfaces by chance hits."}}});
}

}  // namespace

IntegratorEntry sppm_entry() {
    return {
        {"integrator", "sppm",
         "Stochastic progressive photon mapping: new eye paths in every pass. Consistent; biased "
         "with a fixed radius.",
         sppm_params()},
        [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
            return std::make_unique<SppmIntegrator>(p, 0);
        }};
}

IntegratorEntry ppm_entry() {
    return {{"integrator", "ppm",
             "Progressive photon mapping: all passes share a fixed set of eye paths. Consistent "
             "for the light that these eye paths see; biased with a fixed radius.",
             concat({sppm_params(),
                     {{"eye_paths", ParamKind::Int, "16",
                       "Number of eye paths of each pixel, at least 1; pass i uses eye path i "
                       "modulo eye_paths."}}})},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                const int eye_paths = p.integer("eye_paths");
                if (eye_paths < 1) throw std::runtime_error("ppm: eye_paths must be 1 or more");
                return std::make_unique<SppmIntegrator>(p, eye_paths);
            }};
}

}  // namespace etendue
