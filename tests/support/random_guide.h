#pragma once
// A guide that knows nothing and is sure of it: with it, too, everything must be unbiased.

#include <utility>
#include <vector>

#include "guide/guide.h"
#include "math/hash.h"
#include "math/warp.h"
#include "scene/scene.h"

namespace etendue::test {

/// `emission`: weights of the emitters, which it changes where they are positive; `at_infinity`: indices of the emitters
/// at infinity whose directions it guides; `kappa`: of all lobes.
inline Guide random_guide(Vec3 center, float radius, std::vector<double> emission,
                          const std::vector<uint32_t>& at_infinity, float kappa, uint64_t seed) {
    // The squares of a walk's weights grow by 1/(1 − share) at each vertex where the guide has little of the density. Most
    // walks would have infinite variance with a half.
    constexpr float kShare = 0.25f;
    auto u = [seed, n = uint64_t(0)]() mutable {
        return to_unit_float(uint32_t(hash_combine(seed, n++)));
    };
    const auto make_random = [&](GuideMixture& mixture, float inv_r) {
        for (int k = 0; k < GuideMixture::kMostLobes; ++k) {
            const float x = u(), y = u(), weight = u() + 0.1f;
            mixture.add({sample_uniform_sphere({x, y}), k % 2 == 0 ? 0.0f : inv_r, kappa, weight});
        }
    };
    GuideCell cell;
    cell.center = center;
    for (GuideCell::Field& field : cell.fields) {
        field.share.fill(kShare), field.training_share.fill(kShare);
        make_random(field.mixture, 1 / radius);
        for (WalkContribution& c : field.contribution) c = {1, u()};
    }
    Guide guide;
    guide.light_contribution = 1;
    guide.surfaces = guide.emission = GuideTree(cell);
    for (double& weight : emission) weight *= 0.1 + double(u());
    if (emission.size() > 1) {
        // Probabilities of their own in each leaf, on each side of surfaces; some emitters are unknown.
        constexpr float kKnown = 0.7f;
        constexpr int kPlaces = 100;
        const std::array<Vec3, kSurfaceSides> sides{
            {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}, {}}};
        std::vector<Arrival> arrivals;
        for (int i = 0; i < kPlaces; ++i) {
            const float x = u(), y = u(), z = u();
            const Vec3 p = center + Vec3{2 * x - 1, 2 * y - 1, 2 * z - 1} * radius;
            for (const Vec3 n : sides)
                for (uint32_t e = 0; e < emission.size(); ++e)
                    if (const float weight = u(); weight < kKnown)
                        arrivals.push_back({{p, n, weight}, e});
        }
        guide.lights = LightSelections(
            std::move(arrivals), std::vector<float>(emission.size(), 1 / float(emission.size())));
        guide.set_emission(std::move(emission));
    }
    for (const uint32_t emitter : at_infinity) {
        Guide::AtInfinity learned{emitter, {}};
        learned.fit.share.fill(kShare), learned.fit.training_share.fill(kShare);
        make_random(learned.fit.mixture, 0);
        guide.add_at_infinity(learned);
    }
    return guide;
}

/// For all emitters of a scene.
inline Guide random_guide(const Scene& scene, float kappa, uint64_t seed) {
    std::vector<double> pmf;
    std::vector<uint32_t> at_infinity;
    for (const auto& e : scene.emitters()) {
        pmf.push_back(double(e->selection_pmf));
        if (e->is_infinite() && !e->is_delta()) at_infinity.push_back(e->index);
    }
    const Bounds3& bounds = scene.bounds();
    return random_guide(bounds.center(), bounds.radius(), std::move(pmf), at_infinity, kappa, seed);
}

}  // namespace etendue::test
