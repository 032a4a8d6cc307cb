// Bidirectional path tracing with probabilistic connections [Popov et al. 2015]: the vertices of the first M light
// paths of a pass are stored. Every eye vertex is connected to K of them, which are drawn from a mass function that
// approximates their contributions. The mass function is computed at importance records along few eye paths and
// interpolated in between.
//
// Techniques: C(0,t), C(s,1), C(s,0) as in bdpt; C(s,t) with s, t ≥ 2 from the stored vertices; C(1,t) from their y_0,
// from next events, or from both; specular connections X(s,t). Unbiased. All eye paths of a pass share the M light paths, so
// the errors of M samples of a connection are correlated. The weights therefore count them as 1 (`upper`) [eq. 16-17], or as
// M, as if they were independent (`standard`). The weights contain neither K nor the mass function, because these are not
// defined for paths of other techniques.

#include "integrator/pcbpt.h"

#include <array>
#include <atomic>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "integrator/bdpt.h"
#include "math/rotated.h"
#include "reuse/importance_records.h"

namespace etendue {
namespace {

/// How C(1,t) is made.
enum class Direct { Stored, NextEvent, Both };

constexpr std::array<Choice<Direct>, 3> kDirect{
    {{"stored", Direct::Stored}, {"next_event", Direct::NextEvent}, {"both", Direct::Both}}};
constexpr std::array<Choice<bool>, 2> kIsStandard{{{"upper", false}, {"standard", true}}};
constexpr std::array<Choice<bool>, 2> kIsWeighted{{{"contribution", false}, {"weighted", true}}};

class PcbptIntegrator final : public Integrator {
public:
    explicit PcbptIntegrator(const IntegratorParams& p)
        : paths_(p, Guiding(p), Specular(p)),
          light_paths_(uint64_t(p.integer("light_paths", 1, 1 << 20))),
          memory_(uint64_t(p.integer("memory", 1, 1 << 30)) << 20),
          given_connections_(p.number("connections", 0, 1024)),
          record_fraction_(p.number("record_fraction", 0, 1)),
          neighbours_(p.integer("neighbours", 1, VertexMixture::kMostParts)),
          uniform_(p.number("uniform", 1e-3f, 1)), is_standard_(p.choice("weights", kIsStandard)),
          is_weighted_(p.choice("pmf", kIsWeighted)), uses_cache_(p.flag("cache")),
          direct_(p.choice("direct", kDirect)) {}

    void learn(const LearnContext& pass) override { paths_.learn(pass); }
    void save(LearnedState& to) const override { paths_.save(to); }
    void load(LearnedState& from) override { paths_.load(from); }
    void prepare(const PassContext& pass) override {
        paths_.train(pass, counts(pass.scene, pass.light_paths));
        paths_.prepare_specular(pass, counts(pass.scene, pass.light_paths));
    }
    void trace(const PassContext& pass) override {
        const TechniqueCounts n = counts(pass.scene, pass.light_paths);
        store_light_paths(pass, n);
        make_records(pass, n);
    }

    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        paths_.trace_eye_paths(c, counts(c[0].scene, c[0].light_paths), z, stats);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths);
        const SubPath& z = work.z;
        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        const auto roulette = paths_.roulette(c, work);
        for (int t = 2; t <= z.size(); ++t) {
            paths_.add_hits(c, n, t, work);  // C(0,t)
            if (!paths_.is_joinable(z, t)) continue;
            paths_.add_specular(c, n, t, work);  // X(s,t)
            if (n.next_event > 0)
                paths_.add(c, join_next_event(c.scene, z, t, c.sampler, n), work);  // C(1,t)
            if (vertices_.empty()) continue;
            const PhaseTimer of_connections(work.stats, &PhaseSeconds::connections);
            // If K is not an integer, one of the two neighbouring integers is drawn such that the mean is K.
            c.sampler.seek(Stream::Selection, join_number(0, t));
            const int draws = int(connections_ + c.sampler.next_1d_unstructured());
            if (draws == 0) continue;
            const VertexMixture q = mixture(c.scene, n, t, work);
            for (int k = 0; k < draws; ++k)  // (1/K) Σ (1/M) w C(s,t) / pmf
                connect(c, n, t, k, draws, q, roulette, work);
        }
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        TechniqueCounts n = Bidirectional::counts(scene, light_paths);
        n.connect = is_standard_ ? float(kept(light_paths)) : 1.0f;
        if (direct_ != Direct::NextEvent) n.connect_emission = n.connect;
        if (direct_ == Direct::Stored) n.next_event = 0;
        n.guide = paths_.guiding().guide();
        n.specular_depth = paths_.specular().depth(scene);
        return n;
    }
    uint64_t light_paths(const Scene& scene) const override { return scene.film().pixel_count(); }
    uint64_t light_path_memory() const override { return memory_; }
    Estimator estimator() const override { return Estimator::Unbiased; }
    std::vector<std::pair<std::string, double>> figures() const override {
        std::vector<std::pair<std::string, double>> figures{
            {"connections", connections_},
            {"stored_vertices", vertices_.size()},
            {"path_bytes", path_bytes_},
            {"records", records_.size()},
            {"record_bytes", records_.memory_bytes()}};
        paths_.guiding().add_figures(figures);
        paths_.specular().add_figures(figures);
        return figures;
    }

private:
    /// Number M of stored light paths.
    uint64_t kept(uint64_t light_paths) const { return std::min(light_paths_, light_paths); }

    void store_light_paths(const PassContext& pass, const TechniqueCounts& n) {
        const uint64_t M = kept(pass.light_paths);
        compact_.begin(pass.chunks(pass.light_paths), kVertexBytes, memory_,
                       paths_.guiding().guide());
        trace_light_paths(paths_, pass, n, M, compact_);
        compact_.assemble();
        // The memory of the pass before is freed, since its paths had other lengths.
        stored_.clear();
        stored_.resize(M);
        vertices_.clear();
        path_bytes_ = compact_.memory_bytes() + M * sizeof(SubPath);
        for (uint32_t i = 0; i < M; ++i) {
            stored_[i].reserve(compact_.path_size(i));
            compact_.restore(pass.scene, i, stored_[i]);
            path_bytes_ +=
                stored_[i].memory_bytes() + uint64_t(stored_[i].size()) * sizeof(StoredVertex);
            check_memory(path_bytes_, "light paths with");
            for (int s = direct_ == Direct::NextEvent ? 2 : 1; s <= stored_[i].size(); ++s)
                if (stored_[i][s - 1].is_connectible) vertices_.push_back({i, s});
        }
    }

    void make_records(const PassContext& pass, const TechniqueCounts& n) {
        const FilmGeometry& g = pass.scene.film();
        const uint64_t pixels = g.pixel_count();
        const auto count = uint64_t(std::ceil(record_fraction_ * double(pixels)));
        record_chunks_.resize(count);
        std::vector<std::pair<uint64_t, uint64_t>> found(count);  // eye vertices, shadow rays
        std::atomic<uint64_t> bytes = 0;
        pass.for_each_other_path(count, [&](uint64_t i, Sampler& sampler, Workspace& work) {
            const PhaseTimer timer(work.stats, &PhaseSeconds::records);
            record_chunks_[i].clear();
            sampler.start(pass.index, i);
            const uint64_t before = work.stats.shadow_rays;
            const uint64_t pixel = low_discrepancy_pixel(g, pass.index * count + i);
            trace_eye_path(paths_.eye_walk(pass.scene, n, work.stats), pass.film, pixel, sampler,
                           work.z);
            for (int t = 2; t <= work.z.size(); ++t) {
                if (!work.z[t - 1].is_connectible) continue;
                evaluate(pass.scene, n, t, work);
                record_chunks_[i].add(work.z[t - 1], work.masses);
                ++found[i].first;
                check_memory(bytes += 2 * sizeof(float) * vertices_.size(),
                             "importance records of");
            }
            found[i].second = work.stats.shadow_rays - before;
        });
        records_.assemble(record_chunks_, uint32_t(vertices_.size()));

        connections_ = double(given_connections_);
        if (connections_ > 0) return;
        // The records also serve as the pilot. From an eye vertex, bdpt would trace as many shadow rays as the records
        // needed for one light path. The cost of the records, and that of the search for records at each eye vertex and
        // at each draw, is subtracted. K may depend on the records, because the draws are independent of them.
        uint64_t vertices = 0, rays = 0;
        for (const auto& [v, r] : found) vertices += v, rays += r;
        const double M = double(kept(pass.light_paths));
        const double of_bdpt = vertices > 0 ? double(rays) / (M * double(vertices)) : 0.0;
        const double left = of_bdpt * (1 - double(record_fraction_) * M) - kRaysOfSearch;
        connections_ = std::max(kFewest, left / kRaysOfDraw);
    }

    void check_memory(uint64_t bytes, const char* what) const {
        if (bytes > memory_)
            throw std::runtime_error(fmt::format(
                "pcbpt: {} {} light vertices need more than {} MiB; give fewer light_paths or a "
                "smaller record_fraction, or raise \"memory\"",
                what, vertices_.size(), memory_ >> 20));
    }

    /// Pixels that are evenly distributed over the image.
    static uint64_t low_discrepancy_pixel(const FilmGeometry& g, uint64_t i) {
        const FinePoint at = rotated(FinePoint{}, uint32_t(i));
        return uint64_t(at.y * g.crop_height) * uint64_t(g.crop_width) +
               uint64_t(at.x * g.crop_width);
    }

    /// Sets work.masses to the contribution of every stored vertex to z_{t-1}. Those that are not finite are counted, and left
    /// to the uniform part of the distribution.
    void evaluate(const Scene& scene, const TechniqueCounts& n, int t, Workspace& work) const {
        work.masses.clear();
        for (const StoredVertex& v : vertices_) {
            const auto j = join_connect(scene, stored_[v.path], v.s, work.z, t, n);
            float mass = 0;
            if (j) {
                mass = luminance(j->contribution) * visibility(scene, *j, work.stats);
                if (is_weighted_) mass *= j->mis_weight;
            }
            if (!std::isfinite(mass)) {
                ++work.stats.rejected;
                mass = 0;
            }
            work.masses.push_back(mass);
        }
    }

    /// The distribution from which z_{t-1} draws light vertices.
    VertexMixture mixture(const Scene& scene, const TechniqueCounts& n, int t,
                          Workspace& work) const {
        if (uses_cache_) return records_.mixture(work.z[t - 1], neighbours_, uniform_);
        VertexMixture exact{uint32_t(vertices_.size())};
        evaluate(scene, n, t, work);
        if (to_cdf(work.masses)) exact.add(work.masses.data(), 1 - uniform_);
        return exact;
    }

    /// Adds the k-th of `draws` connections of z_{t-1}.
    void connect(const SampleContext& c, const TechniqueCounts& n, int t, int k, int draws,
                 const VertexMixture& mixture, const Bidirectional::Roulette& roulette,
                 Workspace& work) const {
        c.sampler.seek(Stream::Selection, join_number(0, t, uint32_t(k) + 1));
        const auto [index, pmf] =
            mixture.sample(stratum(k, draws, c.sampler.next_1d_unstructured()));
        const auto [path, s] = vertices_[index];
        if (s + t - 1 > paths_.max_depth()) return;
        if (work.is_observed) compact_.restore(c.scene, path, work.y);
        const double samples = connections_ * double(kept(c.light_paths));
        paths_.add_connection(c, n, stored_[path], s, t, roulette, work, float(1 / (samples * pmf)),
                              uint32_t(k) + 1);
    }

    /// Memory per vertex: in the cache, and restored for joins. What else the restored paths need is checked when they
    /// are restored.
    static constexpr uint64_t kVertexBytes = LightVertexCache::kVertexBytes + sizeof(Vertex);
    /// Smallest automatic K.
    static constexpr double kFewest = 0.125;
    /// Cost of the search for a mixture, and of a draw with its join, in units of a connection of bdpt.
    static constexpr double kRaysOfSearch = 0.5, kRaysOfDraw = 1.1;

    struct StoredVertex {
        uint32_t path;
        int s;
    };

    Bidirectional paths_;
    uint64_t light_paths_, memory_;
    float given_connections_;
    float record_fraction_;
    int neighbours_;
    float uniform_;
    bool is_standard_, is_weighted_, uses_cache_;
    Direct direct_;

    // Of the pass.
    double connections_ = 0;  ///< K
    LightVertexCache compact_;
    uint64_t path_bytes_ = 0;             ///< Memory of the M light paths.
    std::vector<SubPath> stored_;         ///< The M light paths, restored for joins.
    std::vector<StoredVertex> vertices_;  ///< Their V connectible vertices.
    ImportanceRecords records_;
    std::vector<ImportanceRecords::Chunk> record_chunks_;
};

std::vector<ParamInfo> pcbpt_params() {
    return concat(
        {Bidirectional::params(),
         {{"light_paths", ParamKind::Int, "100",
           "M: number of light paths of a pass to whose vertices eye vertices may be connected."},
          {"memory", ParamKind::Int, "6144",
           "Largest memory for these light paths in MiB, and also for the importance records."},
          {"connections", ParamKind::Float, "0",
           "K: average number of connections of each eye vertex, at most 1024; 0: chosen so that "
           "connections and records together cost as much as the connections of bdpt, but at "
           "least 0.125."},
          {"record_fraction", ParamKind::Float, "0.001",
           "Number of eye paths that create importance records, divided by the number of pixels; "
           "in [0, 1]."},
          {"neighbours", ParamKind::Int, "6",
           "Number of records between which the probability mass function is interpolated, 1 to "
           "16."},
          {"uniform", ParamKind::Float, "0.5",
           "Fraction of connections that are drawn uniformly, in [0.001, 1]."}},
         Specular::params(),
         Guiding::lights_params(),
         Guiding::params(),
         {{"weights", ParamKind::String, "upper",
           "Count of a connection in the weights: upper (1, since all pixels share the light "
           "paths) or standard (M).",
           true},
          {"direct", ParamKind::String, "next_event",
           "How C(1,t) is made: stored (connections to the y_0 of the stored light paths), "
           "next_event, or both.",
           true},
          {"cache", ParamKind::Bool, "true",
           "Whether the probability mass function is interpolated from records; false evaluates "
           "it at every eye vertex, which is slow.",
           true},
          {"pmf", ParamKind::String, "weighted",
           "What the probability mass function is proportional to: contribution, or weighted "
           "(contribution times MIS weight).",
           true}}});
}

}  // namespace

IntegratorEntry pcbpt_entry() {
    return {{"integrator", "pcbpt",
             "Bidirectional path tracing with probabilistic connections. Unbiased.",
             pcbpt_params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<PcbptIntegrator>(p);
            }};
}

}  // namespace etendue
