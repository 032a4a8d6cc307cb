#pragma once
// Statistical evidence that methods are unbiased. Means over independent runs are compared with those of references: of
// the image, its tiles, path lengths, classes of paths and single techniques. Every comparison is a Welch test; Šidák's
// correction gives all of them together the stated probability of a false alarm.
//
// Two sides are compared on the classes of paths (see common_classes.h) that both can make and sample often enough for
// a t-test. Classes that are left out are reported.
//
// Single techniques: an unweighted connection has infinite variance where surfaces meet, since its second moment is
// ∝ 1/(shortest edge). So both sides are multiplied by [every edge ≥ δ], with one δ per path length.

#include <atomic>
#include <functional>
#include <optional>

#include "render/renderer.h"
#include "verify/path_class.h"
#include "verify/welch_test.h"

namespace etendue {

struct VerifyOptions {
    int shortest = 1, longest = 8;  ///< Path lengths, in edges.
    int runs = 32;
    double alpha = 0.01;  ///< Probability of a false alarm in all comparisons together.
    SamplerKind sampler = SamplerKind::Sobol;
    /// Samples per pixel of one run; with `detect` of each of the renderings whose mean a run is. If empty, `seconds`
    /// determines them.
    std::optional<uint64_t> spp;
    /// Time of all runs of one method, 30 if empty. With `detect` the time of the whole verification, unlimited if
    /// empty.
    std::optional<double> seconds;
    /// If given, renders until a relative error of this size in the image, or in a path length with at least
    /// kLargeShare of the light, would be found with a probability of 90 %.
    std::optional<double> detect;
    uint64_t seed = 0;
    int threads = 0;  ///< Number of runs rendered at the same time; 0: one per core.
    int tiles = 4;    ///< Number of tiles in each direction.
    /// Methods to compare with: the first one, and the others for classes of paths that they sample much better.
    std::vector<IntegratorSpec> against{{"path", {}}, {"light", {}}};
    /// Set from outside to end the verification at once, with the comparisons that are then possible.
    const std::atomic<bool>* interrupted = nullptr;
};

/// An image to compare with instead of a method: the mean of `samples` per pixel, and the variance of that mean.
struct ReferenceImage {
    std::string name;
    std::vector<Rgb> pixels, variance;
    int64_t samples;
    /// Ratio of the variance of a mean over pixels to that of independent pixels; at least 1.
    double correlation = 1;
};

/// Largest shares of the light that may be too rare for a test. Beyond them the other tests lack rare contributions as
/// well and are not reliable: the tests of tiles, and the verdict.
inline constexpr double kTooMuchUntested = 0.05, kTooMuchTooRare = 0.1;
/// Share of the light above which a path length counts for `detect`.
inline constexpr double kLargeShare = 0.02;
/// Share of the light and effective contributions above which a class of paths is tested on its own. An error in one
/// class is large relative to the class, but small relative to lengths and images that include it.
inline constexpr double kTestedShare = 1e-3, kEnoughOfClass = 1000;

struct LengthReport {
    int edges = 0;
    float cut_off = 0;  ///< δ
    double share = 0;   ///< Of all light.
    /// Shares of the light of this length that one side cannot make, or samples too rarely.
    double out_of_reach = 0, too_rare = 0;
    WelchTest comparison;
};

struct ClassReport {
    PathClass path_class;
    double share = 0;  ///< Of all light.
    std::string reference;
    WelchTest comparison;
};

/// A class that is not compared; errors up to the size of its light are not detected.
struct UntestedClass {
    PathClass path_class;
    double share = 0;  ///< Of all light.
    bool is_out_of_reach = false;
    double method_count = 0, reference_count = 0;  ///< Effective contributions.
};

struct TechniqueReport {
    Technique technique;
    /// Share of the light of this length that is compared: of classes that the technique can make and that are sampled
    /// often enough, with edges ≥ δ.
    double coverage = 0;
    WelchTest comparison;
};

/// Root mean square error of the mean of n runs, without the reference's own variance.
struct ErrorOfRuns {
    int runs;
    double rmse;
};

struct MethodReport {
    std::string method;
    Estimator estimator = Estimator::Unbiased;
    uint64_t spp = 0;  ///< Samples per pixel of one run.
    RenderStats stats;
    double out_of_reach = 0, too_rare = 0;  ///< Shares of the light, as in LengthReport.
    double untested_tiles = 0;     ///< Share of the compared light in tiles that are not tested.
    std::vector<WelchTest> image;  ///< By channel.
    std::vector<WelchTest> tiles;  ///< Channel c of tile i has index 3 i + c.
    std::vector<LengthReport> lengths;
    std::vector<ClassReport> classes;     ///< Classes that are tested on their own.
    std::vector<UntestedClass> untested;  ///< In decreasing order of share.
    std::vector<TechniqueReport> techniques;
    std::vector<ErrorOfRuns> errors;
    std::optional<double> slope;  ///< Of log RMSE over log n; -0.5 for an unbiased method.

    /// Calls `use(test)` for all comparisons with enough contributions for a test.
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

/// Smallest relative errors of the compared light that would have been found with a probability of 90 %. Path lengths
/// count if at least kLargeShare of the light is within reach.
struct Detectable {
    std::optional<double> image;   ///< Empty where the image was not tested.
    std::optional<double> length;  ///< The largest of all tested path lengths.
    std::vector<int> not_tested;   ///< Path lengths that were not tested.

    /// Whether an error of this size would be found in the image and in every path length.
    bool reaches(double size) const {
        return image && *image <= size && length.value_or(0) <= size && not_tested.empty();
    }
};

struct VerifyReport {
    std::string reference;
    int tests = 0;
    double level = 0;  ///< Significance level of each test.
    std::vector<MethodReport> methods;
    /// Of all renderings, references included: "METHOD: …", see render/warnings.h.
    std::vector<std::string> warnings;
    bool interrupted = false;
    /// Methods that are left out because their renderings failed: "METHOD: reason".
    std::vector<std::string> failures;

    /// Undecided where too much light is too rare for a test (kTooMuchTooRare).
    Verdict verdict(const MethodReport& method) const;
    bool deviates(const WelchTest& t) const { return t.is_tested() && t.p < level; }
    Detectable detectable(const MethodReport& method) const;
};

/// After each method with chains, the same with a few chains that go on for long. With the default parameters, all chains
/// start in the first passes, which shows an error of the start-up best; an error of the steps shows in proportion to
/// their number. A method that gives its groups or chains is left alone.
std::vector<IntegratorSpec> with_long_chains(const std::vector<IntegratorSpec>& methods);

/// Verifies with_long_chains(methods). `progress` receives lines of text, from one thread at a time. Throws
/// std::runtime_error where a method's parameters are invalid, or the renderings of all methods fail. Other exceptions of
/// renderings are rethrown.
VerifyReport verify(const Scene& scene, const std::vector<IntegratorSpec>& methods,
                    const VerifyOptions& options,
                    const std::optional<ReferenceImage>& reference = {},
                    const std::function<void(const std::string&)>& progress = {});

}  // namespace etendue
