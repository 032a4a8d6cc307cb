// Bidirectional path tracing [Veach & Guibas 1994; Lafortune & Willems 1993]: all techniques C(s,t), combined by the power
// heuristic. Unbiased. Joins with a small contribution pass Russian roulette before their shadow ray. The loop over s and t
// is that of Bidirectional::add_sample(), which methods with chains use, too.
//
// An eye vertex is connected to the light path of its own pixel, or to C random vertices of the light vertex cache,
// which holds the V connectible vertices y_i, i ≥ 1, of all light paths of the pass [Davidovič et al. 2014]. In the
// latter case the contribution of each connection C(s,t), s, t ≥ 2, is multiplied by V/(C·N_L), and the weights count
// C·N_L/V̄ samples. V̄ is the mean of V; V itself cannot be used in the weights, because it depends on the paths.

#include "integrator/bdpt.h"

#include <array>
#include <cmath>

#include "integrator/bidirectional.h"
#include "integrator/light_path_options.h"

namespace etendue {
namespace {

constexpr std::array<Choice<bool>, 2> kUsesCache{{{"path", false}, {"cache", true}}};

class BdptIntegrator final : public Integrator {
public:
    explicit BdptIntegrator(const IntegratorParams& p)
        : paths_(p, Guiding(p)), uses_cache_(p.choice("connections", kUsesCache)),
          given_draws_(p.integer("cache_draws", 0, 1024)), light_(p) {}

    void learn(const LearnContext& pass) override { paths_.learn(pass); }
    void save(LearnedState& to) const override {
        paths_.save(to);
        to.put(draws_);
        to.put(count_);
    }
    void load(LearnedState& from) override {
        paths_.load(from);
        from.get(draws_);
        from.get(count_);
    }
    void prepare(const PassContext& pass) override {
        paths_.train(pass);
        if (uses_cache_ && draws_ == 0) choose_draws(pass);
    }
    void trace(const PassContext& pass) override {
        if (!uses_cache_) return;
        cache_.begin(pass.chunks(pass.light_paths), kVertexBytes, light_.memory,
                     paths_.guiding().guide());
        paths_.trace_light_paths(pass, counts(pass.scene, pass.light_paths), pass.light_paths,
                                 cache_);
        cache_.assemble();
        connectible_.clear();
        for (uint32_t i = 0; i < cache_.vertices().size(); ++i)
            if (cache_.vertices()[i].is_connectible) connectible_.push_back(i);
    }

    bool trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        return paths_.trace_eye_paths(c, z, counts(c[0].scene, c[0].light_paths), stats);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths);
        if (!uses_cache_) return paths_.add_sample(c, n, work);
        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        paths_.trace_eye_path(c, n, work);
        for (int t = 2; t <= work.z.size(); ++t) {
            paths_.add_hits(c, n, t, work);  // C(0,t)
            if (!paths_.is_joinable(work.z, t)) continue;
            paths_.add_next_events(c, n, t, work);  // C(1,t)
            connect_to_cache(c, n, t, work);        // C(s,t), s ≥ 2
        }
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        TechniqueCounts n = Bidirectional::counts(scene, light_paths);
        if (uses_cache_) n.connect = count_;
        n.guide = paths_.guiding().guide();
        return n;
    }
    uint64_t light_paths(const Scene& scene) const override {
        return light_.count(scene, paths_.depth(),
                            uses_cache_ ? paths_.vertex_bytes(kVertexBytes) : 0);
    }
    uint64_t light_path_memory() const override { return uses_cache_ ? light_.memory : 0; }
    bool samples_alone() const override { return !uses_cache_ && !paths_.guiding().is_on(); }
    Estimator estimator() const override { return Estimator::Unbiased; }
    std::vector<std::pair<std::string, double>> figures() const override {
        std::vector<std::pair<std::string, double>> figures = paths_.guiding().figures();
        if (!uses_cache_) return figures;
        figures.push_back({"cache_draws", draws_});
        figures.push_back({"cached_vertices", connectible_.size()});
        figures.push_back({"cache_bytes", cache_.memory_bytes() +
                                              connectible_.capacity() * sizeof(connectible_[0])});
        return figures;
    }

private:
    /// Sets C to the given value, or to the mean number of connectible vertices of pilot light paths, which do not
    /// contribute to the film.
    void choose_draws(const PassContext& pass) {
        constexpr uint64_t kPilotPaths = 8192;
        const TechniqueCounts n = counts(pass.scene, pass.light_paths);
        std::vector<int> found(kPilotPaths);
        pass.for_each_other_path(kPilotPaths, [&](uint64_t i, Sampler& sampler, Workspace& work) {
            sampler.start(0, i);
            trace_light_path(paths_.light_walk(pass.scene, n, work.stats), sampler, work.y);
            for (int s = 2; s <= work.y.size(); ++s) found[i] += work.y[s - 1].is_connectible;
        });
        double vertices = 0;
        for (const int v : found) vertices += double(v) / kPilotPaths;
        draws_ = given_draws_ > 0 ? given_draws_ : std::max(1, int(std::lround(vertices)));
        count_ = vertices > 0 ? float(draws_ / vertices) : 1.0f;
    }

    /// Connects z_{t-1} to `draws_` random vertices of the cache.
    void connect_to_cache(const SampleContext& c, const TechniqueCounts& n, int t,
                          Workspace& work) const {
        if (connectible_.empty()) return;
        const PhaseTimer timer(work.stats, &PhaseSeconds::connections);
        const float factor =
            float(double(connectible_.size()) / (double(draws_) * double(c.light_paths)));
        for (int i = 0; i < draws_; ++i) {
            c.sampler.seek(Stream::Selection, join_number(0, t, uint32_t(i)));
            const double u = stratum(i, draws_, c.sampler.next_1d_unstructured());
            const uint32_t vertex = connectible_[size_t(u * double(connectible_.size()))];
            const int s = cache_.depth(vertex) + 1;
            if (s + t - 1 > paths_.max_depth()) continue;
            cache_.restore_first(c.scene, vertex, s, work.is_observed, work.y);
            paths_.add(c, join_connect(c.scene, work.y, s, work.z, t, n), work, factor,
                       uint32_t(i) + 1);
        }
    }

    /// Memory per vertex: in the cache and in the list of connectible vertices.
    static constexpr uint64_t kVertexBytes = LightVertexCache::kVertexBytes + 2 * sizeof(uint32_t);
    /// Value of count_ before the pilot has run; it differs from the counts of all other methods.
    static constexpr float kUnknownCount = 0.5f;

    Bidirectional paths_;
    bool uses_cache_;
    int given_draws_;
    LightPathOptions light_;
    int draws_ = 0;                ///< C; 0 before the first pass.
    float count_ = kUnknownCount;  ///< C·N_L/V̄

    // Of the pass.
    LightVertexCache cache_;
    std::vector<uint32_t> connectible_;
};

}  // namespace

IntegratorEntry bdpt_entry() {
    std::vector<ParamInfo> params = Bidirectional::params();
    params.push_back(
        {"connections", ParamKind::String, "path",
         "Light vertices to which eye vertices are connected: path (those of the pixel's own light "
         "path) or cache (random vertices of all light paths of the pass).",
         true});
    params.push_back({"cache_draws", ParamKind::Int, "0",
                      "Number of connections from each eye vertex to the cache, at most 1024; 0: "
                      "as many as a light path has connectible vertices on average.",
                      true});
    for (const ParamInfo& p : LightPathOptions::params()) params.push_back(p);
    for (const ParamInfo& p : Guiding::params()) params.push_back(p);
    return {{"integrator", "bdpt",
             "Bidirectional path tracing with all connections and MIS. Unbiased.", params},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<BdptIntegrator>(p);
            }};
}

}  // namespace etendue
