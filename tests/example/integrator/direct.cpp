// Direct light: paths of at most two edges.
//
// Techniques: C(0,2) and C(0,3) hits, and C(1,2) next events unless next_event is off. Unbiased for these paths.

#include "integrator/direct.h"

namespace etendue {
namespace {

class DirectIntegrator final : public Integrator {
public:
    explicit DirectIntegrator(bool next_event)
        : counts_{.hit = 1, .next_event = next_event ? 1.0f : 0.0f} {}

    void sample(const SampleContext& c, Workspace& work) const override {
        const WalkContext walk{c.scene, counts_, work.stats, {.max_vertices = 3}};
        SubPath& z = work.z;
        start_eye_path(walk, c.film, c.index, c.sampler, z);
        if (z.size() < 2) return;
        add_hits(c, z, 2);
        if (counts_.next_event > 0)
            if (const auto j = join_next_event(c.scene, z, 2, c.sampler, counts_))
                if (const float Tr = visibility(c.scene, *j, work.stats); Tr > 0)
                    c.sink.add(*j, j->contribution * Tr);
        if (extend<TransportMode::Radiance>(walk, c.sampler, z)) add_hits(c, z, 3);
    }

    TechniqueCounts counts(const Scene&, uint64_t) const override { return counts_; }
    uint64_t light_paths(const Scene&) const override { return 0; }
    Estimator estimator() const override { return Estimator::Unbiased; }
    // It learns nothing from earlier passes.
    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}

private:
    void add_hits(const SampleContext& c, const SubPath& z, int t) const {
        for_each_hit(c.scene, z, t, counts_, [&](const Join& j) { c.sink.add(j, j.contribution); });
    }

    TechniqueCounts counts_;
};

}  // namespace

IntegratorEntry direct_entry() {
    return {{"integrator",
             "direct",
             "Direct light alone: paths of at most two edges.",
             {{"next_event", ParamKind::Bool, "true",
               "Whether to sample emitters, besides hitting them."}}},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<DirectIntegrator>(p.flag("next_event"));
            }};
}

}  // namespace etendue
