#include "render/pilot_rendering.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "guide/guide.h"
#include "render/cost_table.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

/// Grey values of the sums of a film.
std::vector<float> grey(const Film& film) {
    std::vector<float> values;
    values.reserve(film.moments().size());
    for (const PixelMoments& m : film.moments())
        values.push_back(float((m.sum[0] + m.sum[1] + m.sum[2]) / 3));
    return values;
}

/// Of chains, for each pixel and pass.
double mutations_of(const Renderer& renderer) {
    for (const auto& [name, value] : renderer.integrator().figures())
        if (name == "mutations_per_pixel") return value;
    return 1;
}

/// The images of one rendering: of each pass or, of chains, of each of their groups.
class ReplicateImages {
public:
    /// `first`: the first pass that counts.
    ReplicateImages(int groups, uint64_t first) : groups_(uint64_t(groups)), first_(first) {
        images.resize(groups_);
    }
    int passes_per_image() const { return groups_ > 0 ? kPilotPasses / int(groups_) : 1; }
    void add(const Film& film, uint64_t pass) {
        std::vector<float> sum = grey(film), image = sum;
        if (!before_.empty())
            for (size_t i = 0; i < image.size(); ++i) image[i] -= before_[i];
        before_ = std::move(sum);
        if (groups_ == 0) {
            if (pass >= first_) images.push_back(std::move(image));
            return;
        }
        std::vector<float>& of_group = images[pass % groups_];
        of_group.resize(image.size());
        for (size_t i = 0; i < image.size(); ++i)
            of_group[i] += image[i] / float(passes_per_image());
    }

    std::vector<std::vector<float>> images;

private:
    uint64_t groups_, first_;
    std::vector<float> before_;
};

GuideUse use_of(const Guide* guide) {
    if (!guide) return GuideUse::None;
    return guide->guides_surfaces() ? GuideUse::WithSurfaces : GuideUse::WithoutSurfaces;
}

/// What counts for pairs alone. Shadow rays that are blocked are not told from others.
RenderStats of_pairs(const RenderStats& all) {
    RenderStats pairs;
    pairs.pairs = all.pairs;
    pairs.shadow_rays = all.visible_pairs;
    pairs.trial_rays = all.trial_rays;
    return pairs;
}

/// Renders replicate r of a pilot that must not take more than `most` simulated seconds.
void add_replicate(const Scene& small, RenderSettings settings, uint64_t first, int r, double most,
                   const std::atomic<bool>& drop, MethodPilot& pilot) {
    const auto cost = [method = settings.integrator.name,
                       use = use_of(settings.integrator.guide.get())](const RenderStats& stats) {
        return simulated_seconds(method, use, stats);
    };
    settings.seed = pilot_seed(settings.seed, PilotUse::Choice, first + uint64_t(r));
    static_cast<RenderLimits&>(settings) = {.spp = kPilotPasses, .seconds = {}, .error = {}};
    // Those that follow cost as much as this one.
    const double renderings = kPilotReplicates - r, left = most - pilot.all_seconds;
    settings.cost_limit = CostLimit{.cost = cost, .most = left, .renderings = renderings};
    Renderer renderer(small, settings);
    const int groups = renderer.integrator().error_groups();
    // Methods that learn do so before the first pass and after it. Chains begin in the first pass of their group.
    const uint64_t first_image = renderer.integrator().is_learning() ? 1 : 0,
                   costs_from = groups > 0 ? uint64_t(groups) : 1;
    ReplicateImages made(groups, first_image);
    RenderStats first_stats;
    const StopReason reason = renderer.run(
        settings,
        [&](const Progress& p) {
            made.add(renderer.film(), p.passes - 1);
            if (p.passes == costs_from) first_stats = renderer.stats();
        },
        drop, drop);
    const RenderStats& stats = renderer.stats();
    const double prepared = cost(renderer.preparation()), seconds = cost(stats),
                 first_seconds = cost(first_stats);
    if (reason == StopReason::Interrupted) {
        if (drop.load()) throw PassDropped();
        // What it was allowed to take, since what threads have done until then depends on their number.
        pilot.all_seconds +=
            renderer.is_prepared() ? prepared + std::max(0.0, left - prepared) / renderings : left;
        pilot.is_stopped = true;
        return;
    }
    pilot.passes_per_image = made.passes_per_image();
    pilot.images.in_sequence =
        settings.sampler == SamplerKind::Sobol && groups == 0 ? int(made.images.size()) : 1;
    for (auto& image : made.images) pilot.images.images.push_back(std::move(image));
    const double passes = double(kPilotPasses - costs_from),
                 pass = (seconds - first_seconds) / passes;
    pilot.pass_seconds += pass / kPilotReplicates;
    const double replicates = kPilotReplicates;
    pilot.pairs_an_eye_path += double(stats.pairs - first_stats.pairs) /
                               std::max(1.0, double(stats.eye_paths - first_stats.eye_paths)) /
                               replicates;
    pilot.pair_seconds +=
        (cost(of_pairs(stats)) - cost(of_pairs(first_stats))) / passes / replicates;
    pilot.prepared_seconds += prepared;
    pilot.all_seconds += prepared + seconds;
    pilot.start_seconds +=
        std::max(0.0, first_seconds - double(costs_from) * pass) / kPilotReplicates;
    if (groups > 0)
        pilot.images.least_variance = 1 / (mutations_of(renderer) * pilot.passes_per_image);
}

}  // namespace

std::pair<int, int> size_of_pilot(const FilmGeometry& film, double pixels) {
    const double scale = std::sqrt(std::min(1.0, pixels / double(film.pixel_count())));
    const auto side = [&](int whole) {
        return std::clamp(int(std::lround(scale * whole)), 1, whole);
    };
    return {side(film.crop_width), side(film.crop_height)};
}

MethodPilot render_pilot(const Scene& small, const RenderSettings& settings, uint64_t first,
                         double most, const std::atomic<bool>& drop) {
    MethodPilot pilot;
    for (int r = 0; r < kPilotReplicates && !pilot.is_stopped; ++r)
        add_replicate(small, settings, first, r, most, drop, pilot);
    if (pilot.is_stopped) pilot.images.images.clear();
    return pilot;
}

}  // namespace etendue
