#pragma once
// Samples from which guides are learned, and the fit of one cell.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "guide/mixture.h"

namespace etendue {

/// A direction in 32 bits, to about 10⁻⁴ radians.
class PackedDirection {
public:
    PackedDirection() = default;
    explicit PackedDirection(Vec3 w) {
        // Octahedral mapping [Meyer et al. 2010].
        const float scale = 1 / (std::fabs(w.x) + std::fabs(w.y) + std::fabs(w.z));
        float a = w.x * scale, b = w.y * scale;
        if (w.z < 0) {
            const float fold = 1 - std::fabs(b);
            b = std::copysign(1 - std::fabs(a), b);
            a = std::copysign(fold, a);
        }
        a_ = int16_t(std::lround(a * kSteps));
        b_ = int16_t(std::lround(b * kSteps));
    }
    Vec3 unpack() const {
        float a = float(a_) / kSteps, b = float(b_) / kSteps;
        const float z = 1 - std::fabs(a) - std::fabs(b);
        if (z < 0) {
            const float fold = 1 - std::fabs(b);
            b = std::copysign(1 - std::fabs(a), b);
            a = std::copysign(fold, a);
        }
        return normalize({a, b, z});
    }

private:
    static constexpr float kSteps = 32767;
    int16_t a_ = 0, b_ = 0;
};

/// Classes of surfaces by gloss (gloss.h); each cell learns its share of guided directions for each of them.
inline constexpr int kGuideClasses = 3;
inline int guide_class(uint8_t gloss) {
    constexpr uint8_t kSomewhatGlossy = 30, kGlossy = 50;
    return (gloss >= kSomewhatGlossy) + (gloss >= kGlossy);
}

/// A direction that walks of a mode are to be guided to, where it was found.
struct GuideSample {
    Vec3 p;
    float inv_distance = 0;  ///< To the other end of the edge; 0 at infinity.
    float weight = 0;        ///< For the lobes, see set_flux().
    /// Density of the direction without guide, in solid angle, under the condition that it is not that of a delta event, of
    /// which a guide has no part; 0 where unknown.
    float unguided_pdf = 0;
    PackedDirection direction;                  ///< From p.
    int8_t normal[3] = {};                      ///< As GuideView::normal, to about a degree.
    uint8_t mode : 4 = 0, gloss_class : 4 = 0;  ///< TransportMode of the walks; guide_class().

    void set_normal(Vec3 n) {
        for (int i = 0; i < 3; ++i) normal[i] = int8_t(std::lround(n[i] * 127));
    }
    Vec3 unpacked_normal() const {
        const Vec3 n{float(normal[0]), float(normal[1]), float(normal[2])};
        return length2(n) > 0 ? normalize(n) : n;
    }
    /// Sets the weight by the power along the direction, after normal and direction. With a normal, the lobes have to learn
    /// power over cosine, since GuideMixture multiplies by the cosine.
    void set_flux(float flux) { weight = flux / cosine(); }
    float flux() const { return weight * cosine(); }
    /// Seen from the centre of a cell.
    GuideView view(Vec3 center) const { return {center - p, unpacked_normal()}; }

private:
    float cosine() const {
        constexpr float kLeast = 0.05f;
        const Vec3 n = unpacked_normal();
        return length2(n) > 0 ? std::max(std::fabs(dot(n, direction.unpack())), kLeast) : 1.0f;
    }
};
static_assert(sizeof(GuideSample) == 32);

/// Mixture and shares of one cell and mode.
struct GuideFit {
    GuideMixture mixture;
    /// Share of directions taken from the mixture, by guide_class(); 0 where the gain is below GuideLearning::least_gain.
    std::array<float, kGuideClasses> share{};
    /// The same for walks that only train: they are guided wherever a little is gained, since they have to find what other
    /// walks miss.
    std::array<float, kGuideClasses> training_share{};
    float gain =
        0;  ///< Mean of log(guided pdf / unguided pdf) over the light, in nats, at `share`.

    template <class Fit, class Use>
    static void for_each_field(Fit& fit, const Use& use) {
        auto& [mixture, share, training_share, gain] = fit;
        use(mixture), use(share), use(training_share), use(gain);
    }
};

/// How the cells of a guide learn.
struct GuideLearning {
    /// footprint_guide() for eye walks alone, instead of fit_guide().
    bool has_footprints = false;
    /// Shares that gain less, in nats, are 0: guided directions take up to twice the time.
    float least_gain = 0.6f;
    float most_share = 0.9f;  ///< Of guided directions.
};

/// Samples of a fit. Those of the shares are not those of the lobes, so that lobes that fit to noise have no share.
struct FitSamples {
    std::vector<const GuideSample*> lobes, shares;
    /// Every `n`-th sample is kept for the shares.
    static FitSamples held_out(std::span<const GuideSample* const> samples, size_t n = 4);
};

/// Fits lobes by expectation maximisation with a prior [Ruppert et al. 2020], and the shares with the BSDF as one more
/// component. A function of the samples' order; `number` seeds its choices.
GuideFit fit_guide(const FitSamples& samples, Vec3 center, uint64_t number,
                   const GuideLearning& learning);

/// Footprints of photons [Hey & Purgathofer 2002]: at most GuideMixture::kMostLobes samples, chosen in proportion to
/// their weights, are lobes of one width, without parallax. The share is ½ everywhere, and the gain is not estimated.
/// Deviations from the paper: photons belong to a cell, not to the neighbourhood of the place, and lobes are von
/// Mises-Fisher lobes. A function of the samples' order; `number` seeds the choice.
GuideFit footprint_guide(std::span<const GuideSample* const> samples, uint64_t number);

}  // namespace etendue
