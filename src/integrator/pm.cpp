// Photon mapping [Jensen 2001]: photons are traced once. At the first vertex of the eye path that is diffuse enough,
// direct light comes from next event estimation, caustics from the photon density of a caustic map, and all other light
// from final gather rays. A gather ray ends at the first diffuse vertex. There it uses the irradiance at the nearest
// photon [Christensen 1999], or a density estimate from all photons. On purely diffuse surfaces, an irradiance cache
// can replace most of the gather rays; it is filled before the samples of a pass.
//
// Techniques: M(s,t), hits and next events; each path is made by one of them (see photon_mapping.h). Biased: density
// estimates blur light over the radius of the nearest photons, which does not shrink.

#include "integrator/pm.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "integrator/radius_params.h"
#include "integrator/seen_extent.h"
#include "math/hash.h"
#include "reuse/irradiance_cache.h"

namespace etendue {
namespace {

/// Sums the radiance from one direction.
class RadianceSum final : public ContributionSink {
public:
    void add(const Join& join, Rgb contribution) override {
        sum_ += contribution * join.mis_weight;
    }
    Rgb sum() const { return sum_; }

private:
    Rgb sum_;
};

/// Rays of the samples of a pass, without those that made the photons.
struct RaySums final : PassSums {
    uint64_t rays = 0;

    void save(LearnedState& to) const override { to.put(rays); }
    void load(LearnedState& from) override { from.get(rays); }
};

/// Purpose of a density estimate, which determines the photons that it uses.
enum class Look {
    Gathered,      ///< All light at the end of a gather ray.
    Seen,          ///< All light except that of next events; used without gather rays.
    Caustic,       ///< Caustics seen directly.
    DeltaCaustic,  ///< Caustics on glossy surfaces that no other technique makes.
};

class PmIntegrator final : public Integrator {
public:
    PmIntegrator(const IntegratorParams& p, const MakePhotonSource& make_source)
        : mapping_(p, true), memory_(uint64_t(p.integer("memory", 1, 1 << 30)) << 20),
          source_(make_source(p, mapping_, memory_)),
          nearest_(p.integer("nearest", 2, PhotonMap::kMostNeighbours)),
          gather_rays_(p.integer("gather_rays", 0, 1 << 20)), radius_(radius_param(p)),
          irradiance_(p.integer("irradiance", 0, 1 << 20)), retrace_(p.flag("retrace")),
          cache_error_(p.number("cache_error", 0, 1)),
          cache_rays_(p.integer("cache_rays", 16, 1 << 20)) {
        const auto refuse = [&](const char* why) {
            throw std::runtime_error(fmt::format("{}: {}", p.integrator(), why));
        };
        if (cache_error_ > 0 && p.integer("max_depth") >= 0)
            refuse("an irradiance cache contains paths of all lengths: expected max_depth=-1");
        if (cache_error_ > 0 && gather_rays_ == 0)
            refuse("an irradiance cache requires gather_rays of at least 1");
    }

    /// Photons do not count, since they are traced again where a rendering is resumed.
    void learn(const LearnContext& pass) override { mapping_.learn(pass, rays_); }
    std::unique_ptr<PassSums> make_sums() const override { return std::make_unique<RaySums>(); }
    void collect(std::span<const std::unique_ptr<PassSums>> workers) override {
        for (const auto& w : workers) rays_ += static_cast<const RaySums&>(*w).rays;
    }
    /// The maps are not saved, since they are functions of the seed.
    void save(LearnedState& to) const override {
        mapping_.paths().save(to);
        to.put(rays_);
    }
    void load(LearnedState& from) override {
        mapping_.load(from);
        from.get(rays_);
    }
    void trace(const PassContext& pass) override {
        pass_ = pass.index;
        maps_pass_ = retrace_ ? pass.index : 0;
        if (!(max_radius_ > 0))
            max_radius_ = radius_ > 0 ? radius_ : kDefaultRadius * seen_extent(pass.scene).radius;
        if (has_maps_ && !retrace_) return;
        MapPhotons photons =
            source_->trace(pass, maps_pass_, [&] { return sample_importons(pass); });
        global_.build(std::move(photons.global));
        caustic_.build(std::move(photons.caustic));
        if (irradiance_ > 0)
            irradiances_.begin(global_, irradiance_, nearest_, max_radius_,
                               mapping_.paths().max_depth() + 2 - kGathered);
        if (cache_error_ > 0) fill_cache(pass);
        if (!has_maps_ && !retrace_ && pass.film.passes() > 0) pass.forget_statistics();
        has_maps_ = true;
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = mapping_.counts();
        const WalkContext walk = mapping_.paths().eye_walk(c.scene, n, work.stats);
        SubPath& z = work.z;
        Sampler of_walk = c.sampler;

        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        const uint64_t rays_before = work.stats.rays();
        start_eye_path(walk, c.film, c.index, of_walk, z);
        for (int t = 2; t <= z.size(); ++t) {
            mapping_.add_direct(c, t, work);  // C(0,t), C(1,t)
            const bool is_diffuse = mapping_.takes_photons(z, t);
            if (mapping_.paths().is_joinable(z, t))  // M(s,t)
                for_each_look(
                    c, pass_, t, is_diffuse, true, work,
                    [&](Look look, int u, float scale) { add_photons(c, look, u, scale, z); });
            if (!mapping_.walk_on(walk, of_walk, z, is_diffuse)) break;
        }
        static_cast<RaySums&>(*work.sums).rays += work.stats.rays() - rays_before;
    }

    TechniqueCounts counts(const Scene&, uint64_t light_paths) const override {
        TechniqueCounts n = mapping_.counts();
        n.merge = float(light_paths);
        return n;
    }
    uint64_t light_paths(const Scene&) const override { return source_->light_paths(); }
    uint64_t light_path_memory() const override { return memory_; }
    bool keeps_paths() const override { return false; }
    Estimator estimator() const override { return Estimator::Biased; }
    std::vector<std::pair<std::string, double>> figures() const override {
        return source_->figures();
    }

    static constexpr float kDefaultRadius = 0.03f;

private:
    /// Calls use(look, u, scale) for the density estimates that contribute to z_{t-1}: at z_{t-1} itself (u = t), or at
    /// the end z_{u-1} of a gather ray.
    template <class Use>
    void for_each_look(const SampleContext& c, uint32_t pass, int t, bool is_diffuse,
                       bool uses_cache, Workspace& work, const Use& use) const {
        if (!is_diffuse) {
            if (c.scene.has_delta_emitters()) use(Look::DeltaCaustic, t, 1.0f);
        } else if (gather_rays_ == 0) {
            use(Look::Seen, t, 1.0f);
        } else {
            use(Look::Caustic, t, 1.0f);
            if (!uses_cache || !add_cached(c, t, work.z)) final_gather(c, pass, t, work, use);
        }
    }

    /// Adds a density estimate at z_{t-1} or, for gather rays that hit a purely diffuse surface, the irradiance at a
    /// nearby photon.
    void add_photons(const SampleContext& c, Look look, int t, float scale,
                     const SubPath& z) const {
        switch (look) {
        case Look::Gathered:
            if (!add_irradiance(c, t, scale, z))
                estimate(c, global_, t, scale, z, [](const MapPhoton&) { return true; });
            return;
        case Look::Seen:
            estimate(c, global_, t, scale, z, [](const MapPhoton& photon) { return photon.s > 2; });
            return;
        case Look::Caustic:
            estimate(c, caustic_, t, scale, z, [](const MapPhoton&) { return true; });
            return;
        case Look::DeltaCaustic:
            estimate(c, caustic_, t, scale, z, [](const MapPhoton& photon) {
                return photon.origin == MapPhoton::Origin::DeltaCaustic;
            });
            return;
        }
    }

    /// Adds a density estimate at z_{t-1} from the photons that `use` accepts. Their surfaces may have other normals:
    /// in a corner, the photons of one wall replace those that are missing where the disc of the other wall ends.
    template <class Use>
    void estimate(const SampleContext& c, const PhotonMap& map, int t, float scale,
                  const SubPath& z, const Use& use) const {
        PhotonMap::Neighbours near;
        map.find(z[t - 1].p, nearest_, max_radius_, near);
        for (int i = 0; i < near.count; ++i) {
            const MapPhoton& photon = map.photons()[near.index[size_t(i)]];
            if (photon.s + t - 2 > mapping_.paths().max_depth() || !use(photon)) continue;
            if (const auto j = join_photon(photon, z, t, near.disc))
                c.sink.add(*j, j->contribution * scale);
        }
    }

    bool add_irradiance(const SampleContext& c, int t, float scale, const SubPath& z) const {
        if (irradiance_ == 0) return false;
        // The stored irradiance contains the paths that are short enough for a gather ray from z_1.
        const bool is_limited = mapping_.paths().max_depth() != DepthOptions::kUnlimited;
        if (is_limited && t != kGathered) return false;
        const auto n = irradiance_normal(z[t - 1]);
        if (!n) return false;
        const auto E = irradiances_.find(z[t - 1].p, *n);
        if (!E) return false;
        add_reflected(c, 2, t, z, *n, *E * scale);
        return true;
    }

    /// Continues a gather ray from its first hit z_{t-1} to the first diffuse vertex z_{u-1}, and calls use(u) there.
    /// Hits of emitters are not added: next events and the caustic map contribute this light.
    template <class Use>
    void end_gather_ray(const SampleContext& c, int t, Workspace& work, const Use& use) const {
        const TechniqueCounts none;
        const WalkContext walk = mapping_.paths().eye_walk(c.scene, none, work.stats);
        SubPath& z = work.z;
        for (int u = t; u <= z.size(); ++u) {
            const bool is_diffuse = mapping_.takes_photons(z, u);
            if (is_diffuse) use(u);
            if (!mapping_.walk_on(walk, c.sampler, z, is_diffuse)) break;
        }
    }

    /// Calls use(look, u, scale) for the light that reaches z_{t-1} from another diffuse surface.
    template <class Use>
    void final_gather(const SampleContext& c, uint32_t pass, int t, Workspace& work,
                      const Use& use) const {
        const TechniqueCounts none;
        const WalkContext walk = mapping_.paths().eye_walk(c.scene, none, work.stats);
        SubPath& z = work.z;
        const float eta2 = z.eta2;
        for (int ray = 0; ray < gather_rays_; ++ray) {
            // Each ray is a separate sample. The rays of all passes are successive points of one sequence.
            Sampler of_ray = c.sampler;
            const uint64_t number = uint64_t(pass) * uint64_t(gather_rays_) + uint64_t(ray);
            const uint64_t high_half = number >> 32;  // A sequence has no more than 2^32 points.
            of_ray.start(uint32_t(number), hash_combine(c.index, uint64_t(t) + (high_half << 8)));
            const SampleContext gather = c.with(of_ray, c.sink);
            if (extend<TransportMode::Radiance>(walk, of_ray, z) && !z[t - 1].is_delta)
                end_gather_ray(gather, t + 1, work,
                               [&](int u) { use(Look::Gathered, u, 1 / float(gather_rays_)); });
            z.truncate(t);
            z.eta2 = eta2;
        }
    }

    /// Samples at least kFewest points where the rendering estimates densities, if there are any. Uses separate random
    /// numbers.
    std::vector<Importon> sample_importons(const PassContext& pass) const {
        constexpr uint64_t kFewest = 1 << 16;
        const uint64_t rays = pass.pixels * uint64_t(std::max(1, gather_rays_)),
                       rounds = (kFewest + rays - 1) / rays,
                       step = std::max(uint64_t(1), rays / kFewest);
        std::vector<std::vector<Importon>> chunks(pass.chunks(pass.pixels));
        pass.for_each_sample(pass.pixels, [&](const SampleContext& c, Workspace& work) {
            if (c.index % step != 0) return;
            for (uint32_t round = 0; round < rounds; ++round) {
                c.sampler.start(round, hash_combine(c.index, kImportons));
                add_importons(c, round, chunks[c.chunk], work);
            }
        });
        std::vector<Importon> importons;
        for (const auto& chunk : chunks)
            importons.insert(importons.end(), chunk.begin(), chunk.end());
        return importons;
    }
    void add_importons(const SampleContext& c, uint32_t round, std::vector<Importon>& importons,
                       Workspace& work) const {
        const TechniqueCounts none;
        const WalkContext walk = mapping_.paths().eye_walk(c.scene, none, work.stats);
        SubPath& z = work.z;
        Sampler of_walk = c.sampler;
        start_eye_path_of_pixel(walk, c.film, c.index, of_walk, z);
        for (int t = 2; t <= z.size(); ++t) {
            const bool is_diffuse = mapping_.takes_photons(z, t);
            if (mapping_.paths().is_joinable(z, t))
                for_each_look(c, round, t, is_diffuse, false, work,
                              [&](Look look, int u, float scale) {
                                  const Importon i = importon(look, z, u, scale);
                                  if (std::isfinite(i.importance))
                                      importons.push_back(i);
                                  else
                                      ++work.stats.rejected;
                              });
            if (!mapping_.walk_on(walk, of_walk, z, is_diffuse)) break;
        }
    }
    static Importon importon(Look look, const SubPath& z, int t, float scale) {
        const Vertex& v = z[t - 1];
        return {.p = v.p,
                .side = arrival_side(v),
                .importance = luminance(v.beta) * std::fabs(z.film_weight) * scale,
                .is_caustic = look == Look::Caustic || look == Look::DeltaCaustic};
    }

    /// The normal for which the irradiance determines all light that v reflects; empty if there is none.
    static std::optional<Vec3> irradiance_normal(const Vertex& v) {
        const auto n = v.bsdf.diffuse_normal();
        return n && dot(v.wo, *n) > 0 ? n : std::nullopt;
    }

    /// Makes irradiance records at eye vertices that have no record nearby, for more and more pixels. Records of one
    /// level do not depend on each other, so the result does not depend on the threads.
    void fill_cache(const PassContext& pass) {
        constexpr uint32_t kCoarsest = 16, kFinest = 2;
        const float size = seen_extent(pass.scene).radius;
        cache_.reset(cache_error_, 0.01f * size, 0.5f * size);
        const uint64_t width = uint64_t(pass.scene.film().crop_width);
        std::vector<std::vector<IrradianceRecord>> chunks(pass.chunks(pass.pixels));
        for (uint32_t spacing = kCoarsest; spacing >= kFinest; spacing /= 2) {
            for (auto& chunk : chunks) chunk.clear();
            pass.for_each_sample(pass.pixels, [&](const SampleContext& c, Workspace& work) {
                c.sampler.start(maps_pass_, c.index);
                if (c.index % width % spacing != 0 || c.index / width % spacing != 0) return;
                const TechniqueCounts none;
                const WalkContext walk = mapping_.paths().eye_walk(c.scene, none, work.stats);
                SubPath& z = work.z;
                start_eye_path_of_pixel(walk, c.film, c.index, c.sampler, z);
                for (int t = 2; t <= z.size(); ++t) {
                    const bool is_diffuse = mapping_.takes_photons(z, t);
                    const auto n = is_diffuse ? irradiance_normal(z[t - 1]) : std::nullopt;
                    if (n && !cache_.find(z[t - 1].p, *n))
                        chunks[c.chunk].push_back(record(c, t, *n, work));
                    if (!mapping_.walk_on(walk, c.sampler, z, is_diffuse)) break;
                }
            });
            std::vector<IrradianceRecord> records;
            for (const auto& chunk : chunks)
                records.insert(records.end(), chunk.begin(), chunk.end());
            cache_.add(records);
        }
    }

    /// Makes a record of the light of final_gather() at z_{t-1}.
    IrradianceRecord record(const SampleContext& c, int t, Vec3 n, Workspace& work) const {
        const TechniqueCounts none;
        const WalkContext walk = mapping_.paths().eye_walk(c.scene, none, work.stats);
        SubPath& z = work.z;
        // The record needs incident radiance, so the throughput is 1 here.
        const Rgb beta = std::exchange(z[t - 1].beta, Rgb(1));
        const float eta2 = z.eta2;
        Sampler of_cells = c.sampler, of_ray = c.sampler;
        of_cells.seek(Stream::Auxiliary, uint32_t(t));
        uint32_t ray = 0;
        const auto radiance = [&](Vec3 d) -> IncidentRadiance {
            const Vertex& v = z[t - 1];
            if (!(dot(d, v.ng) * dot(v.wo, v.ng) > 0)) return {};
            RadianceSum sum;
            of_ray.start(ray++, hash_combine(c.index, uint64_t(t)));
            const SampleContext gather = c.with(of_ray, sum);
            of_ray.seek(Stream::Eye, uint64_t(t) - 1);
            const BsdfSample along{.wi = d, .weight = Rgb(1), .pdf = 1};
            const bool found = append<TransportMode::Radiance>(walk, of_ray, along, z);
            if (!found || z[t].is_infinite) {
                z.truncate(t);
                return {};
            }
            const float distance = length(z[t].p - z[t - 1].p);
            end_gather_ray(gather, t + 1, work,
                           [&](int u) { add_photons(gather, Look::Gathered, u, 1, z); });
            z.truncate(t);
            z.eta2 = eta2;
            return {sum.sum(), distance};
        };
        const IrradianceRecord r =
            measure_irradiance(z[t - 1].p, n, cache_rays_, of_cells, radiance);
        z[t - 1].beta = beta;
        return r;
    }

    /// Adds the light of final_gather() from the cache; false if there is no record nearby.
    bool add_cached(const SampleContext& c, int t, const SubPath& z) const {
        if (cache_.size() == 0) return false;
        const Vertex& v = z[t - 1];
        const auto n = irradiance_normal(v);
        if (!n) return false;
        const auto E = cache_.find(v.p, *n);
        if (!E) return false;
        add_reflected(c, 3, t, z, *n, *E);
        return true;
    }

    /// Adds the reflection of the irradiance E at z_{t-1}. It is assigned to the shortest paths that E contains, which
    /// have s light vertices.
    static void add_reflected(const SampleContext& c, int s, int t, const SubPath& z, Vec3 n,
                              Rgb E) {
        const Vertex& v = z[t - 1];
        c.sink.add({.technique = {Strategy::Merge, s, t},
                    .emitter = nullptr,
                    .contribution = {},
                    .mis_weight = 1,
                    .film = z.film},
                   v.beta * v.eval(n, TransportMode::Radiance).f * E);
    }

    /// Vertices of an eye path whose gather ray leaves z_1 and ends where it first meets a surface.
    static constexpr int kGathered = 3;
    static constexpr uint64_t kImportons = 0x696d706f72746f6e;  ///< Key of random numbers.

    PhotonMapping mapping_;
    uint64_t memory_;  ///< Of the photons, in bytes.
    std::unique_ptr<PhotonSource> source_;
    int nearest_, gather_rays_;
    float radius_, max_radius_ = 0;
    int irradiance_;
    bool retrace_;
    float cache_error_;
    int cache_rays_;
    uint32_t pass_ = 0, maps_pass_ = 0;
    uint64_t rays_ = 0;  ///< Of all samples of finished passes.
    IrradianceCache cache_;
    PhotonMap global_, caustic_;
    PhotonIrradiance irradiances_;
    bool has_maps_ = false;
};

}  // namespace

std::vector<ParamInfo> photon_map_params(const ParamInfo& paths) {
    std::vector<ParamInfo> params = PhotonMapping::params();
    params.push_back(paths);
    params.push_back({"memory", ParamKind::Int, "6144", "Largest memory for the photons, in MiB."});
    params.push_back(
        {"retrace", ParamKind::Bool, "false",
         "Whether every pass traces new photons; otherwise all passes use the photons of the "
         "first one."});
    params.push_back(
        {"nearest", ParamKind::Int, "60",
         "Number of photons in a density estimate, 2 to 512; the farthest only determines the "
         "radius."});
    params.push_back(
        {"radius", ParamKind::Float, "0",
         "Largest radius of a density estimate, in scene units; 0: 3 % of the radius of "
         "what the camera sees."});
    params.push_back({"gather_rays", ParamKind::Int, "16",
                      "Number of final gather rays for each eye path in a pass; 0: the photons are "
                      "seen directly."});
    params.push_back({"irradiance", ParamKind::Int, "4",
                      "On diffuse surfaces, gather rays use the irradiance at the nearest of every "
                      "n-th photon, which is computed when it is first needed; 0: each gather ray "
                      "makes its own density estimate."});
    params.push_back({"cache_error", ParamKind::Float, "0",
                      "Error allowed by the irradiance cache, in [0, 1] (a in [Ward et al. 1988], "
                      "usually 0.1 to 0.4); 0: no cache."});
    params.push_back({"cache_rays", ParamKind::Int, "256",
                      "Number of final gather rays for each record of the irradiance cache, at "
                      "least 16."});
    return params;
}

std::unique_ptr<Integrator> make_photon_map_integrator(const IntegratorParams& params,
                                                       const MakePhotonSource& source) {
    return std::make_unique<PmIntegrator>(params, source);
}

IntegratorEntry pm_entry() {
    return {{"integrator", "pm", "Photon mapping with final gathering. Biased.",
             photon_map_params({"light_paths", ParamKind::Int, "500000",
                                "Number of light paths whose photons are stored."})},
            [](const IntegratorParams& params) {
                return make_photon_map_integrator(
                    params,
                    [](const IntegratorParams& p, const PhotonMapping& mapping,
                       uint64_t max_bytes) -> std::unique_ptr<PhotonSource> {
                        return std::make_unique<TracedPhotons>(
                            mapping, uint64_t(p.integer("light_paths", 1, 1 << 30)), max_bytes);
                    });
            }};
}

}  // namespace etendue
