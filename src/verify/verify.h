#pragma once
// Statistical evidence that methods are unbiased: their means against those of a reference, from independent runs; of
// the image, of its tiles, of each path length and of each technique alone. Every comparison is a Welch test; together
// they raise a false alarm with the stated probability (Šidák).
//
// Two sides are compared on the paths that both can make, class by class (see path_class.h), and that both find often
// enough for a t-test to hold. What is left out is reported.
//
// Techniques alone: an unweighted connection has infinite variance where surfaces meet, its second moment being
// ∝ 1/(shortest edge). So both sides are multiplied by [every edge ≥ δ], with a δ for each path length.

#include <atomic>
#include <functional>
#include <optional>

#include "math/statistics.h"
#include "render/renderer.h"
#include "verify/contribution_tally.h"

namespace etendue {

struct VerifyOptions {
    int shortest = 1, longest = 8;  ///< Path lengths, in edges.
    int runs = 32;
    double alpha = 0.01;  ///< Probability of a false alarm, of everything together.
    /// Samples per pixel of one run; without, as many as all runs of a method can take in `seconds`.
    std::optional<uint64_t> spp;
    double seconds = 30;
    uint64_t seed = 0;
    int threads = 0;  ///< Runs at a time; 0: as many as the machine has cores.
    int tiles = 4;    ///< Across the image.
    IntegratorSpec against{"path", {}};
};

/// A picture to compare with instead of a method: the mean of `samples` per pixel, and the variance of that mean.
struct ReferenceImage {
    std::string name;
    std::vector<Rgb> pixels, variance;
    int64_t samples;
};

/// One Welch test.
struct Comparison {
    Moments method, reference;
    /// Of the fewest contributions on one side; below kEnoughContributions nothing is tested.
    double effective_count = 0;
    double p = 1;

    bool is_tested() const;
    double ratio() const { return method.mean() / reference.mean(); }
    /// Standard error of the ratio.
    double ratio_error() const;
    /// Relative error that the test would have found with a probability of 90 %.
    double detectable(double level) const;
};
inline constexpr double kEnoughContributions = 200;
/// The same of a technique alone, whose values have longer tails than weights leave them.
inline constexpr double kEnoughAlone = 4000;
/// Shares of the light: where more than these comes too rarely for a test, other tests lack rare contributions, too, and
/// cannot be relied on: those of all tiles; the verdict.
inline constexpr double kTooMuchUntested = 0.05, kTooMuchTooRare = 0.1;
/// What rounding may do to a mean, relative.
inline constexpr double kRounding = 1e-4;

struct LengthReport {
    int edges = 0;
    float cut_off = 0;  ///< δ
    double share = 0;   ///< Of the reference's image.
    /// Shares of what either side found of this length that only one can make, or that one finds too rarely.
    double out_of_reach = 0, too_rare = 0;
    Comparison comparison;
};

struct TechniqueReport {
    Technique technique;
    /// Share of this length that is compared: classes the technique can make, edges ≥ δ, found often enough.
    double coverage = 0;
    Comparison comparison;
};

/// Root mean square error over the pixels of the mean of n runs, the reference's own variance taken out.
struct ErrorOfRuns {
    int runs;
    double rmse;
};

struct MethodReport {
    std::string method;
    Estimator estimator = Estimator::Unbiased;
    uint64_t spp = 0;  ///< Of one run.
    uint64_t rejected = 0;
    double out_of_reach = 0, too_rare = 0;  ///< Shares of the image, as in LengthReport.
    std::vector<Comparison> image;          ///< By channel.
    std::vector<Comparison> tiles;          ///< Of channel c of tile i: [3 i + c].
    std::vector<LengthReport> lengths;
    std::vector<TechniqueReport> techniques;
    std::vector<ErrorOfRuns> errors;
    std::optional<double> slope;  ///< Of log RMSE over log n; -0.5 where nothing is biased.

    /// Calls `use(comparison)` for all that were tested.
    template <class Use>
    void for_each_tested(const Use& use) const {
        for (const Comparison& c : image)
            if (c.is_tested()) use(c);
        for (const Comparison& c : tiles)
            if (c.is_tested()) use(c);
        for (const LengthReport& l : lengths)
            if (l.comparison.is_tested()) use(l.comparison);
        for (const TechniqueReport& t : techniques)
            if (t.comparison.is_tested()) use(t.comparison);
    }
};

enum class Verdict { Consistent, Deviates, Undecided };
const char* to_string(Verdict verdict);

struct VerifyReport {
    std::string reference;
    int tests = 0;
    double level = 0;  ///< Of each test.
    std::vector<MethodReport> methods;

    /// Undecided where less than nine tenths of the light could be compared.
    Verdict verdict(const MethodReport& method) const;
    bool deviates(const Comparison& c) const { return c.is_tested() && c.p < level; }
};

/// `progress` gets a line of text now and then. Throws std::runtime_error where a method's parameters are wrong.
VerifyReport verify(const Scene& scene, const std::vector<IntegratorSpec>& methods,
                    const VerifyOptions& options,
                    const std::optional<ReferenceImage>& reference = {},
                    const std::function<void(const std::string&)>& progress = {});

}  // namespace etendue
