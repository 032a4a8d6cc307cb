// Metropolis photon sampling: the photons have the power of those of traced light paths, in all and by region, in each map.

#include <fstream>
#include <set>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrator/metropolis_photons.h"
#include "render_tiles.h"
#include "run_program.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

constexpr uint64_t kPaths = 2000;

IntegratorParams params_of_mps() {
    for (const IntegratorEntry& e : integrator_registry())
        if (std::string(e.info.name) == "mps") return {IntegratorSpec::parse("mps"), e.info};
    throw std::logic_error("no mps");
}

/// How long chains go on: the mutations of a pass are shared by this number of chains.
struct ChainLength {
    int chains;
    double p_large;
};

/// Passes that trace photons, and sum their power by region and map.
class PhotonTotals final : public Integrator {
public:
    /// Octants of the room, and all of them; of each the luminance and the red channel, by map.
    static constexpr size_t kRegions = 9, kSums = 2 * 2 * kRegions;

    PhotonTotals(const Scene& scene, std::optional<PhotonTarget> target,
                 const std::string& user_paths, const ChainLength& length)
        : scene_(scene), params_(params_of_mps()), mapping_(params_, true),
          traced_(mapping_, kPaths, uint64_t(1) << 30) {
        if (target)
            metropolis_.emplace(mapping_, MetropolisPhotonOptions{.target = *target,
                                                                  .mutations = kPaths,
                                                                  .chains = length.chains,
                                                                  .p_large = length.p_large,
                                                                  .precision = 0.05,
                                                                  .user_paths = user_paths,
                                                                  .user_share = 0.25});
    }

    void save(LearnedState&) const override {}
    void load(LearnedState&) override {}
    void trace(const PassContext& pass) override {
        // Lopsided importance, of few places.
        const auto importons = [&] {
            std::vector<Importon> out;
            for (const MapPhoton& p : traced_.trace(pass, 0, {}).global)
                if (p.p.y < 0) out.push_back({p.p, p.side, 1.5f + p.p.x, p.is_caustic()});
            return out;
        };
        const MapPhotons photons = metropolis_ ? metropolis_->trace(pass, pass.index, importons)
                                               : traced_.trace(pass, pass.index, {});
        std::set<std::array<float, 5>> places;
        for (const MapPhoton& p : photons.global)
            repeats += !places.insert({p.p.x, p.p.y, p.p.z, p.wi.x, p.wi.y}).second;
        std::array<double, kSums> sums{};
        for (const bool is_caustic : {false, true})
            for (const MapPhoton& p : is_caustic ? photons.caustic : photons.global) {
                if (is_caustic && !is_seen(p)) continue;
                const size_t octant =
                    size_t(p.p.x < 0) + 2 * size_t(p.p.y < 0) + 4 * size_t(p.p.z < 0);
                for (const size_t region : {octant, kRegions - 1}) {
                    const size_t i = 2 * (region + kRegions * is_caustic);
                    sums[i] += double(luminance(p.power));
                    sums[i + 1] += double(p.power.r);
                }
            }
        for (size_t i = 0; i < kSums; ++i) totals[i].add(sums[i]);
    }
    void sample(const SampleContext&, Workspace&) const override {}
    TechniqueCounts counts(const Scene&, uint64_t) const override { return {}; }
    uint64_t light_paths(const Scene&) const override { return kPaths; }
    Estimator estimator() const override { return Estimator::Biased; }

    std::array<Moments, kSums> totals;
    uint64_t repeats = 0;  ///< Photons at the place of another one, from the same direction.

private:
    /// Whether the lens sees it: caustics that it does not see are left out by the target Path.
    bool is_seen(const MapPhoton& p) const {
        const Vec3 n = p.side.normal();
        const auto lens = scene_.sensor().sample_connection(p.p, false, {});
        return lens && reached_region(scene_.film(), scene_.filter()).contains(lens->film) &&
               scene_.transmittance({p.p, n}, {lens->p}) > 0;
    }

    const Scene& scene_;
    IntegratorParams params_;
    PhotonMapping mapping_;
    TracedPhotons traced_;
    std::optional<MetropolisPhotons> metropolis_;
};

std::array<Moments, PhotonTotals::kSums> totals(const Scene& scene,
                                                std::optional<PhotonTarget> target, uint64_t passes,
                                                const std::string& user_paths = {},
                                                bool is_long = false) {
    RenderSettings settings;
    settings.spp = passes;
    settings.seed = target ? 3 : 4;
    settings.threads = 1;
    auto integrator = std::make_unique<PhotonTotals>(
        scene, target, user_paths, is_long ? ChainLength{2, 0.02} : ChainLength{16, 0.3});
    const PhotonTotals& sums = *integrator;
    Renderer renderer(scene, settings, std::move(integrator));
    renderer.run([](const Progress&) {}, std::atomic<bool>{false});
    EXPECT_EQ(renderer.stats().runaways, 0u);
    return sums.totals;
}

struct PowerCase {
    PhotonTarget target;
    bool has_user_paths;
    /// A few chains that go on for long, with hardly a large step, before a veil of fractional opacity.
    bool is_long = false;
};
class PhotonPower : public ::testing::TestWithParam<PowerCase> {};

/// To the floor, to the floor beside the glass, and by the floor to a wall.
constexpr const char* kUserPaths = R"([
    {"points": [[0, 0.98, 0], [0, -1, 0.8]], "cone": 8, "radius": 0.1},
    {"points": [[0, 0.98, 0], [0.9, -1, -0.1]], "cone": 25, "radius": 0.2},
    {"points": [[0, 0.98, 0], [0, -1, 0.8], [-1, 0.3, 0.2]], "cone": [20, 30], "radius": 0.2}
])";

/// A lamp, glass that makes caustics, rough metal.
TEST_P(PhotonPower, IsThatOfTracedPhotons) {
    const std::string veil = rectangle(
        "<scale value=\"0.8\"/><rotate x=\"1\" angle=\"-60\"/><translate z=\"0.3\"/>",
        "<bsdf type=\"mask\"><texture name=\"opacity\" type=\"checkerboard\"><float "
        "name=\"color0\" value=\"0.2\"/><float name=\"color1\" value=\"0.9\"/></texture>" +
            diffuse("0.6,0.5,0.4") + "</bsdf>");
    const Scene scene = build(
        front_camera(8) + room() + area_lamp() + sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) +
        sphere("0.4,-0.4,0.3", "0.35", kGlass) + (GetParam().is_long ? veil : ""));
    const TemporaryFolder folder;
    std::string user_paths;
    if (GetParam().has_user_paths) {
        user_paths = folder.path() / "paths.json";
        std::ofstream(user_paths) << kUserPaths;
    }
    // Chains of full paths find few caustics here, and user paths lead elsewhere. Where there are few chains, most passes
    // have no photon of the weakest caustics.
    const uint64_t passes = GetParam().target == PhotonTarget::Path ? 540
                            : GetParam().is_long                    ? 2000
                                                                    : 160;
    const auto traced = totals(scene, {}, 256),
               sampled = totals(scene, GetParam().target, passes, user_paths, GetParam().is_long);
    const double level = sidak(1e-4, int(traced.size()));
    for (size_t i = 0; i < traced.size(); ++i) {
        const bool is_caustic = i >= traced.size() / 2;
        const std::string what =
            fmt::format("{} map, region {}, channel {}: {} ± {} for {} ± {}",
                        is_caustic ? "caustic" : "global", i / 2 % PhotonTotals::kRegions, i % 2,
                        sampled[i].mean(), std::sqrt(sampled[i].squared_error()), traced[i].mean(),
                        std::sqrt(traced[i].squared_error()));
        EXPECT_GT(welch_p(sampled[i], traced[i], kRounding * traced[i].mean()), level) << what;
        if (i / 2 % PhotonTotals::kRegions + 1 == PhotonTotals::kRegions) {
            EXPECT_GT(traced[i].mean(), 0) << what;
            // Steps of few long chains are correlated.
            const double resolution = (is_caustic ? 0.15 : 0.05) * (GetParam().is_long ? 4 : 1);
            EXPECT_LT(4 * std::sqrt(sampled[i].squared_error()), resolution * traced[i].mean())
                << what;
        }
    }
}

TEST(PhotonRepeats, OfOneChainAddTheirPower) {
    const Scene scene = build(front_camera(8) + room() + area_lamp());
    RenderSettings settings;
    settings.spp = 8;
    settings.threads = 1;
    auto integrator =
        std::make_unique<PhotonTotals>(scene, PhotonTarget::Importons, "", ChainLength{1, 0.3});
    const PhotonTotals& sums = *integrator;
    Renderer renderer(scene, settings, std::move(integrator));
    renderer.run([](const Progress&) {}, std::atomic<bool>{false});
    EXPECT_GT(sums.totals[2 * (PhotonTotals::kRegions - 1)].mean(), 0);
    EXPECT_EQ(sums.repeats, 0u);
}

const auto kName = [](const ::testing::TestParamInfo<PowerCase>& p) {
    return std::string(p.param.target == PhotonTarget::Path ? "path" : "importons") +
           (p.param.has_user_paths ? "_user_paths" : "") + (p.param.is_long ? "_long" : "");
};
INSTANTIATE_TEST_SUITE_P(Quick, PhotonPower,
                         ::testing::Values(PowerCase{PhotonTarget::Importons, false},
                                           PowerCase{PhotonTarget::Path, true},
                                           PowerCase{PhotonTarget::Path, false, true}),
                         kName);
INSTANTIATE_TEST_SUITE_P(Long, PhotonPower,
                         ::testing::Values(PowerCase{PhotonTarget::Importons, true},
                                           PowerCase{PhotonTarget::Path, false},
                                           PowerCase{PhotonTarget::Importons, true, true},
                                           PowerCase{PhotonTarget::Path, true, true}),
                         kName);

}  // namespace
}  // namespace etendue::test
