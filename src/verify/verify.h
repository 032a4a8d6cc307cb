#pragma once
// Statistical evidence that methods are unbiased: their means against those of references, from independent runs; of the
// image, of its tiles, of path lengths, of classes of paths and of each technique alone. Every comparison is a Welch
// test; together they raise a false alarm with the stated probability (Šidák).
//
// Two sides are compared on the paths that both can make, class by class (see common_classes.h), and that both find often
// enough for a t-test to hold. What is left out is reported.
//
// Techniques alone: an unweighted connection has infinite variance where surfaces meet, its second moment being
// ∝ 1/(shortest edge). So both sides are multiplied by [every edge ≥ δ], with a δ for each path length.

#include <functional>
#include <optional>

#include "render/renderer.h"
#include "verify/path_class.h"
#include "verify/welch_test.h"

namespace etendue {

struct VerifyOptions {
    int shortest = 1, longest = 8;  ///< Path lengths, in edges.
    int runs = 32;
    double alpha = 0.01;  ///< Probability of a false alarm, of everything together.
    SamplerKind sampler = SamplerKind::Sobol;
    /// Samples per pixel of one run; with `detect` of one of the renderings that a run is the mean of. Without, as many as
    /// all runs of a method can take in `seconds`.
    std::optional<uint64_t> spp;
    /// For each method, 30 without. With `detect` for everything, no limit without.
    std::optional<double> seconds;
    /// Renders until a relative error of this size, of the image or of a path length that holds at least kLargeShare of
    /// the light, would be found with a probability of 90 %.
    std::optional<double> detect;
    uint64_t seed = 0;
    int threads = 0;  ///< Runs at a time; 0: as many as the machine has cores.
    int tiles = 4;    ///< Across the image.
    /// Methods to compare with: the first one, and others for classes of paths that they know much better.
    std::vector<IntegratorSpec> against{{"path", {}}, {"light", {}}};
};

/// An image to compare with instead of a method: the mean of `samples` per pixel, and the variance of that mean.
struct ReferenceImage {
    std::string name;
    std::vector<Rgb> pixels, variance;
    int64_t samples;
    /// Variance of a mean over pixels, relative to what it were if they were independent; at least 1.
    double correlation = 1;
};

/// Shares of the light: where more than these comes too rarely for a test, other tests lack rare contributions, too, and
/// cannot be relied on: those of all tiles; the verdict.
inline constexpr double kTooMuchUntested = 0.05, kTooMuchTooRare = 0.1;
/// Share of the light from which on a path length counts for `detect`.
inline constexpr double kLargeShare = 0.02;
/// Share of the light, and effective contributions, from which on a class of paths is tested on its own. An error of one
/// class is a large one there and a small one of everything that holds the class.
inline constexpr double kTestedShare = 1e-3, kEnoughOfClass = 1000;

struct LengthReport {
    int edges = 0;
    float cut_off = 0;  ///< δ
    double share = 0;   ///< Of all light.
    /// Shares of this length that only one side can make, or that one finds too rarely.
    double out_of_reach = 0, too_rare = 0;
    WelchTest comparison;
};

struct ClassReport {
    PathClass path_class;
    double share = 0;  ///< Of all light.
    std::string reference;
    WelchTest comparison;
};

/// A class that is not compared: an error there, as large as all its light, could hide.
struct UntestedClass {
    PathClass path_class;
    double share = 0;  ///< Of all light.
    bool is_out_of_reach = false;
    double method_count = 0, reference_count = 0;  ///< Effective contributions.
};

struct TechniqueReport {
    Technique technique;
    /// Share of this length that is compared: classes the technique can make, edges ≥ δ, found often enough.
    double coverage = 0;
    WelchTest comparison;
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
    double out_of_reach = 0, too_rare = 0;  ///< Shares of the light, as in LengthReport.
    double untested_tiles = 0;     ///< Share of the compared light in tiles that are not tested.
    std::vector<WelchTest> image;  ///< By channel.
    std::vector<WelchTest> tiles;  ///< Of channel c of tile i: [3 i + c].
    std::vector<LengthReport> lengths;
    std::vector<ClassReport> classes;     ///< Those that are tested on their own.
    std::vector<UntestedClass> untested;  ///< By falling share.
    std::vector<TechniqueReport> techniques;
    std::vector<ErrorOfRuns> errors;
    std::optional<double> slope;  ///< Of log RMSE over log n; -0.5 where nothing is biased.

    /// Calls `use(test)` for all that were tested.
    template <class Use>
    void for_each_tested(const Use& use) const {
        const auto if_tested = [&](const WelchTest& t) {
            if (t.is_tested()) use(t);
        };
        for (const WelchTest& t : image) if_tested(t);
        for (const WelchTest& t : tiles) if_tested(t);
        for (const LengthReport& l : lengths) if_tested(l.comparison);
        for (const ClassReport& c : classes) if_tested(c.comparison);
        for (const TechniqueReport& t : techniques) if_tested(t.comparison);
    }
};

enum class Verdict { Consistent, Deviates, Undecided };
const char* to_string(Verdict verdict);

/// Relative errors of the compared light that would have been found with a probability of 90 %.
struct Detectable {
    std::optional<double> image;  ///< Nothing where the image was not tested.
    std::optional<double>
        length;  ///< Of any length with a large share of the light that was tested.
    std::vector<int>
        not_tested;  ///< Lengths with a large share, within reach, that were not tested.

    /// Whether an error of this size would be found everywhere.
    bool reaches(double size) const {
        return image && *image <= size && length.value_or(0) <= size && not_tested.empty();
    }
};

struct VerifyReport {
    std::string reference;
    int tests = 0;
    double level = 0;  ///< Of each test.
    std::vector<MethodReport> methods;

    /// Undecided where less than nine tenths of the light could be compared.
    Verdict verdict(const MethodReport& method) const;
    bool deviates(const WelchTest& t) const { return t.is_tested() && t.p < level; }
    Detectable detectable(const MethodReport& method) const;
};

/// `progress` gets a line of text now and then, from one thread at a time. Throws std::runtime_error where a method's
/// parameters are wrong, and whatever a rendering throws.
VerifyReport verify(const Scene& scene, const std::vector<IntegratorSpec>& methods,
                    const VerifyOptions& options,
                    const std::optional<ReferenceImage>& reference = {},
                    const std::function<void(const std::string&)>& progress = {});

}  // namespace etendue
