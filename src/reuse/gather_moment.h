#pragma once
// The variance of gathers as a function of their number, estimated from one pair.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "math/vec.h"

namespace etendue {

/// The weight of a technique with `factor` times its samples, from its `odds` w / (1 - w) with one times.
inline double weight_of_odds(double odds, double factor) {
    return 1 / (1 + 1 / (odds * sqr(factor)));
}

/// Part of the second moment of a pixel's estimate, relative to its squared luminance, that belongs to the paths near the
/// one of a visible pair,
///     ∫ w² f² / (n p p_c) + (1 - w)² f² / (n_S p_S),
/// where n is the number of gathers, w the weight of the gather, and S stands for all other techniques together. The mean
/// over pairs estimates the integral without bias.
struct GatherMoment {
    /// Squared luminance of the contribution for weight 1 and r = 1, divided by the probability that it survived roulette
    /// and by p_c.
    double scale;
    double
        odds;  ///< w / (1 - w), if each gather counts once in the weights; infinite if is_alone().
    double r;  ///< Estimate of 1/p_c.
    double others;  ///< Density of the others, divided by that of the pair.

    /// `luminance`: the contribution for weight 1 and r = 1, relative to the pixel's luminance; `weight`: w, where
    /// gathers count `weight_scale` times; `probability`: that of the disc, which the weights take for p_c; `seen`: the
    /// inverse of the probability of surviving roulette.
    static GatherMoment of(double luminance, double weight, double weight_scale, double probability,
                           double r, double seen) {
        const double odds = weight / (1 - weight) / sqr(weight_scale);
        return {seen * sqr(luminance) * r, odds, r, probability / std::sqrt(odds)};
    }
    /// Whether no other technique makes the path.
    bool is_alone() const { return odds == INFINITY; }

    /// The moment with `count` times the number of gathers, which count `weight_scale` times in the weights. `roulette`:
    /// factor by which Russian roulette enlarges the part of the gathers.
    double with(double count, double weight_scale, double roulette = 1) const {
        if (is_alone()) return scale * roulette * r / count;
        const double w = weight_of_odds(odds, count * weight_scale);
        return scale * (sqr(w) * roulette * r / count + sqr(1 - w) / others);
    }

    /// Fixed point for sums, which then do not depend on the order. The largest moment is that of a pair that adds a
    /// thousand times the pixel's luminance.
    static constexpr double kUnit = 0x1p20;
    static uint64_t fixed(double moment) {
        constexpr double kMost = 1e6;
        return moment > 0 ? uint64_t(std::min(moment, kMost) * kUnit) : 0;
    }
};

}  // namespace etendue
