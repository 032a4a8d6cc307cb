#include "guide/random_guide.h"

#include "math/hash.h"
#include "math/warp.h"

namespace etendue {

Guide random_guide(Vec3 center, float radius, std::vector<double> emission, float kappa,
                   uint64_t seed) {
    constexpr float kShare = 0.5f;
    auto u = [seed, n = uint64_t(0)]() mutable {
        return to_unit_float(uint32_t(hash_combine(seed, n++)));
    };
    GuideCell cell;
    cell.center = center;
    for (GuideCell::Field& field : cell.fields) {
        field.share.fill(kShare);
        for (int k = 0; k < GuideMixture::kMostLobes; ++k) {
            const float x = u(), y = u(), weight = u() + 0.1f;
            field.mixture.add(
                {sample_uniform_sphere({x, y}), k % 2 == 0 ? 0.0f : 1 / radius, kappa, weight});
        }
    }
    Guide guide;
    guide.surfaces = guide.emission = GuideTree(cell);
    for (double& weight : emission) weight *= 0.1 + double(u());
    if (emission.size() > 1) guide.set_emission(std::move(emission));
    return guide;
}

}  // namespace etendue
