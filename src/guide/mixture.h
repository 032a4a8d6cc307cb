#pragma once
// Learned directions at a place: a mixture of von Mises-Fisher lobes with parallax [Ruppert et al. 2020]. Light that
// comes from one point comes from other directions elsewhere in the cell, so that the mean of a lobe is a point, not a
// direction.

#include <array>
#include <cstddef>
#include <vector>

#include "bsdf/lobe.h"
#include "math/vec.h"

namespace etendue {

/// Where a mixture is used: a place of the cell, and what the surface there can scatter to.
struct GuideView {
    Vec3 to_center;  ///< From the place to the centre of the cell.
    /// Normal on the side of the surface from which directions leave; zero where they leave to both sides.
    Vec3 normal;
};

/// Density of directions in solid angle,
///     g(ω) = Σ w_k A_k vMF(ω; μ_k, κ_k) / Σ w_k A_k,      μ_k = normalize(m_k + to_center / r_k),
///     A_k = max(ρ_k max(0, c) + (1 - ρ_k)(1 + c)/4, 10⁻³),   c = n·μ_k,   ρ = coth κ - 1/κ.
/// A_k approximates the cosine-weighted part of the lobe above the surface.
class GuideMixture {
public:
    static constexpr int kMostLobes = 16;
    static constexpr float kLeastKappa = 0.01f, kMostKappa = 1e4f;

    struct Lobe {
        Vec3 mean;        ///< Unit vector, from the centre of the cell.
        float inv_r = 0;  ///< Inverse of the distance to the lobe's origin.
        float kappa = 1, weight = 1;
    };

    int size() const { return size_; }
    bool is_empty() const { return size_ == 0; }
    /// There must be room.
    void add(const Lobe& lobe);
    Lobe lobe(int k) const;

    /// A lobe as seen from a place: its mean there, and its share of the directions.
    struct SeenLobe {
        Vec3 mean;
        float share;
    };
    /// All lobes, in their order; of a mixture that may be empty.
    std::vector<SeenLobe> seen_lobes(const GuideView& view) const;

    /// g(w), for the unit vector w. Of a mixture that is not empty, as all below.
    float pdf(const GuideView& view, Vec3 w) const;
    /// A unit vector with this density.
    Vec3 sample(const GuideView& view, float u_lobe, Vec2 u) const;
    /// Upper bound of g over the directions of a cone.
    float max_pdf(const GuideView& view, const DirectionCone& cone) const;

    template <class Mixture, class Use>
    static void for_each_field(Mixture& mixture, const Use& use) {
        auto& [x, y, z, inv_r, kappa, norm, rho, weight, size] = mixture;
        use(x), use(y), use(z), use(inv_r), use(kappa), use(norm), use(rho), use(weight), use(size);
    }

private:
    static constexpr int kLanes = 8;
    using Array = std::array<float, kMostLobes>;
    struct Seen;
    Seen see(const GuideView& view, int first) const;

    // Unused lobes have the weight 0 and are otherwise valid.
    alignas(32) Array x_{}, y_{}, z_{};
    alignas(32) Array inv_r_{}, kappa_{}, norm_{}, rho_{}, weight_{};
    int size_ = 0;
};

}  // namespace etendue
