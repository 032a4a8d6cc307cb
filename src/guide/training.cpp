#include "guide/training.h"

#include <algorithm>
#include <cmath>

#include "guide/exp_negative.h"
#include "math/hash.h"

namespace etendue {
namespace {

constexpr size_t kLobes = GuideMixture::kMostLobes;
/// Weights are clamped at this factor of their mean.
constexpr double kLargestWeight = 10;

/// A sample as seen from the centre of the cell.
struct Seen {
    Vec3 w;
    float inv_r;
    double weight;
};

Seen seen_from(const GuideSample& s, Vec3 center, double largest) {
    const Vec3 w = s.direction.unpack();
    const double weight = std::min(double(s.weight), largest);
    if (s.inv_distance == 0) return {w, 0, weight};
    const Vec3 to_origin = s.p - center + w / s.inv_distance;
    const float len2 = length2(to_origin);
    if (!(len2 > 0)) return {w, 0, weight};
    const float inv = 1 / std::sqrt(len2);
    return {to_origin * inv, inv, weight};
}

/// Sums of a lobe's samples.
struct LobeSums {
    double x = 0, y = 0, z = 0, weight = 0, inv_r = 0;

    void add(const Seen& s, double weight_here) {
        x += weight_here * double(s.w.x);
        y += weight_here * double(s.w.y);
        z += weight_here * double(s.w.z);
        inv_r += weight_here * double(s.inv_r);
        weight += weight_here;
    }
    /// The most probable lobe. `sample`: weight of an average sample; `total`: of all.
    GuideMixture::Lobe lobe(double sample, double total) const {
        // As if so many samples had been found without direction.
        constexpr double kPrior = 0.4;
        const double length = std::sqrt(x * x + y * y + z * z);
        if (!(length > 0)) return {{0, 0, 1}, 0, 1, 0};
        const double R = std::min(length / (weight + kPrior * sample), 0.99999);
        // [Banerjee et al. 2005, eq. 4.4]
        const double kappa = R * (3 - R * R) / (1 - R * R);
        return {{float(x / length), float(y / length), float(z / length)},
                float(inv_r / weight),
                float(kappa),
                float((weight + 0.01 * sample) / total)};
    }
};

using Lobes = std::vector<GuideMixture::Lobe>;

/// Seeds that lie apart [Arthur & Vassilvitskii 2007], and the lobes of the samples nearest to each.
Lobes first_lobes(const std::vector<Seen>& samples, size_t count, double sample, double total,
                  uint64_t number) {
    std::vector<float> distance2(samples.size(), 4);
    std::vector<uint8_t> nearest(samples.size(), 0);
    size_t made = 0;
    for (; made < count; ++made) {
        double sum = 0;
        for (size_t i = 0; i < samples.size(); ++i) sum += samples[i].weight * double(distance2[i]);
        if (!(sum > 0)) break;
        double left = to_unit_double(hash_combine(number, made)) * sum;
        size_t seed = 0;
        while (seed + 1 < samples.size() &&
               (left -= samples[seed].weight * double(distance2[seed])) >= 0)
            ++seed;
        const Vec3 w = samples[seed].w;
        for (size_t i = 0; i < samples.size(); ++i)
            if (const float d2 = length2(samples[i].w - w); d2 < distance2[i] || made == 0)
                distance2[i] = d2, nearest[i] = uint8_t(made);
    }
    std::vector<LobeSums> sums(made);
    for (size_t i = 0; i < samples.size(); ++i) sums[nearest[i]].add(samples[i], samples[i].weight);
    Lobes lobes;
    for (const LobeSums& s : sums) lobes.push_back(s.lobe(sample, total));
    return lobes;
}

GuideMixture mixture_of(const Lobes& lobes) {
    constexpr float kNegligible = 1e-3f;
    GuideMixture m;
    for (const auto& lobe : lobes)
        if (lobe.weight > kNegligible) m.add(lobe);
    return m;
}

/// One step of expectation maximisation.
Lobes refined(const Lobes& lobes, const std::vector<Seen>& samples, double sample, double total) {
    alignas(32) std::array<float, kLobes> x{}, y{}, z{}, kappa{}, norm{};
    for (size_t k = 0; k < lobes.size(); ++k) {
        x[k] = lobes[k].mean.x, y[k] = lobes[k].mean.y, z[k] = lobes[k].mean.z;
        const double c =
            double(clamp(lobes[k].kappa, GuideMixture::kLeastKappa, GuideMixture::kMostKappa));
        kappa[k] = float(c);
        norm[k] = float(double(lobes[k].weight) * c / -std::expm1(-2 * c));
    }
    std::array<LobeSums, kLobes> sums{};
    for (const Seen& s : samples) {
        alignas(32) std::array<float, kLobes> p;
        for (size_t k = 0; k < kLobes; ++k) {
            const float dx = s.w.x - x[k], dy = s.w.y - y[k], dz = s.w.z - z[k];
            p[k] = norm[k] * exp_negative(-0.5f * kappa[k] * (dx * dx + dy * dy + dz * dz));
        }
        float sum = 0;
        for (const float q : p) sum += q;
        if (!(sum > 0)) continue;
        const double factor = s.weight / double(sum);
        for (size_t k = 0; k < lobes.size(); ++k) {
            // What a lobe has little part in would take most of the time.
            constexpr float kLittle = 1e-3f;
            if (p[k] > kLittle * sum) sums[k].add(s, factor * double(p[k]));
        }
    }
    Lobes next;
    for (size_t k = 0; k < lobes.size(); ++k) next.push_back(sums[k].lobe(sample, total));
    return next;
}

/// The share that maximises the likelihood of the light, with one half as prior, and its gain in nats.
struct Share {
    double share = 0, gain = 0;
    double training_share = 0;  ///< See GuideFit.
    double weight = 0;          ///< Of the samples.
    bool is_known = false;      ///< Whether there are enough samples.
};
/// Of one direction. The weight is the flux, in proportion to which directions arrive: the unguided density has the cosine.
struct Densities {
    double unguided, guided, weight;
};

/// The mean gain by a share, in nats.
double gain_by(double share, const std::vector<Densities>& samples) {
    double gain = 0, weight = 0;
    for (const Densities& s : samples) {
        gain += s.weight * std::log((1 - share) + share * s.guided / s.unguided);
        weight += s.weight;
    }
    return gain / weight;
}

Share best_share(const std::vector<Densities>& samples, const GuideLearning& learning) {
    constexpr size_t kFewest = 16;
    constexpr int kSteps = 10;
    Share best;
    for (const Densities& s : samples) best.weight += s.weight;
    best.is_known = samples.size() >= kFewest && best.weight > 0;
    if (!best.is_known) return best;
    const double prior = 2 * best.weight / double(samples.size());
    double a = 0.5;
    for (int step = 0; step < kSteps; ++step) {
        double sum = 0;
        for (const Densities& s : samples)
            sum += s.weight * a * s.guided / ((1 - a) * s.unguided + a * s.guided);
        a = (sum + 0.5 * prior) / (best.weight + prior);
    }
    constexpr double kLeastTrainingGain = 0.1, kMostTrainingShare = 0.9;
    best.training_share = std::min(a, kMostTrainingShare);
    if (!(gain_by(best.training_share, samples) >= kLeastTrainingGain)) best.training_share = 0;
    best.share = std::min(a, double(learning.most_share));
    best.gain = gain_by(best.share, samples);
    if (!(best.gain >= double(learning.least_gain))) best.share = best.gain = 0;
    return best;
}

/// The mean of `weight` over the samples.
template <class Weight>
double mean_of(const std::vector<const GuideSample*>& samples, const Weight& weight) {
    double sum = 0;
    for (const GuideSample* s : samples) sum += double(weight(*s));
    return sum / double(samples.size());
}

}  // namespace

FitSamples FitSamples::held_out(std::span<const GuideSample* const> samples, size_t n) {
    FitSamples all;
    for (size_t i = 0; i < samples.size(); ++i)
        (i % n == n - 1 ? all.shares : all.lobes).push_back(samples[i]);
    return all;
}

GuideFit fit_guide(const FitSamples& samples, Vec3 center, uint64_t number,
                   const GuideLearning& learning) {
    constexpr int kSteps = 8;
    constexpr double kSamplesPerLobe = 6;
    GuideFit fit;
    std::vector<Seen> seen;
    double total = 0, squares = 0;
    const double largest =
        kLargestWeight * mean_of(samples.lobes, [](const GuideSample& s) { return s.weight; });
    for (const GuideSample* s : samples.lobes)
        if (s->weight > 0) {
            seen.push_back(seen_from(*s, center, largest));
            total += seen.back().weight;
            squares += sqr(seen.back().weight);
        }
    if (seen.empty()) return fit;
    const double effective = total * total / squares, sample = total / effective;
    const auto count = size_t(std::clamp(effective / kSamplesPerLobe, 1.0, double(kLobes)));
    Lobes lobes = first_lobes(seen, count, sample, total, number);
    for (int step = 0; step < kSteps; ++step) lobes = refined(lobes, seen, sample, total);
    fit.mixture = mixture_of(lobes);
    if (fit.mixture.is_empty()) return fit;

    std::array<std::vector<Densities>, kGuideClasses> by_class;
    std::vector<Densities> all;
    const double largest_flux =
        kLargestWeight * mean_of(samples.shares, [](const GuideSample& s) { return s.flux(); });
    for (const GuideSample* s : samples.shares) {
        if (!(s->unguided_pdf > 0 && s->weight > 0)) continue;
        const Densities d{double(s->unguided_pdf),
                          double(fit.mixture.pdf(s->view(center), s->direction.unpack())),
                          std::min(double(s->flux()), largest_flux)};
        by_class[s->gloss_class].push_back(d);
        all.push_back(d);
    }
    const Share of_all = best_share(all, learning);
    double weight = 0, gain = 0;
    for (size_t c = 0; c < by_class.size(); ++c) {
        const Share own = best_share(by_class[c], learning);
        const Share& s = own.is_known ? own : of_all;
        fit.share[c] = float(s.share);
        fit.training_share[c] = float(s.training_share);
        weight += own.weight, gain += own.weight * s.gain;
    }
    if (weight > 0) fit.gain = float(gain / weight);
    return fit;
}

GuideFit footprint_guide(std::span<const GuideSample* const> samples, uint64_t number) {
    constexpr float kShare = 0.5f;
    GuideFit fit;
    double total = 0;
    for (const GuideSample* s : samples) total += double(s->weight);
    if (!(total > 0)) return fit;
    const size_t count = std::min(samples.size(), kLobes);
    // Fewer photons have larger footprints: the solid angle 4π/κ of a lobe is twice its part 2π/count of a hemisphere.
    const float kappa = float(count);
    const double offset = to_unit_double(mix64(number));
    double sum = 0;
    size_t made = 0;
    for (const GuideSample* s : samples) {
        sum += double(s->weight);
        for (; made < count && (double(made) + offset) * total < sum * double(count); ++made)
            fit.mixture.add({s->direction.unpack(), 0, kappa, 1 / float(count)});
    }
    if (!fit.mixture.is_empty()) fit.share.fill(kShare), fit.training_share.fill(kShare);
    return fit;
}

}  // namespace etendue
