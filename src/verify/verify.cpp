#include "verify/verify.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "render/method_choice.h"
#include "render/warnings.h"
#include "system/failure.h"
#include "verify/comparisons.h"
#include "verify/error_slope.h"
#include "verify/sample_plan.h"

namespace etendue {
namespace {

constexpr double kDefaultSeconds = 30;
/// With `detect`: time of each series before its spread is first estimated.
constexpr double kFirstSeconds = 2;
/// Largest factor by which samples grow between two estimates of the spread, which are uncertain for few samples.
constexpr double kMostGrowth = 4;
/// Planned squared errors are smaller than needed by this factor, so that the next estimate is likely the last one.
constexpr double kHeadroom = 0.9;
/// With `detect`: share of the time for renderings of single techniques, to which the required precision does not
/// apply.
constexpr double kTechniqueTime = 0.15;

IntegratorSpec limited(IntegratorSpec spec, int longest) {
    if (!spec.params.emplace("max_depth", std::to_string(longest)).second)
        throw std::runtime_error(fmt::format(
            "{}: max_depth must not be given, since --lengths determines it", spec.to_string()));
    return spec;
}

/// References use neither Russian roulette nor specular connections, and select lamps by power, so that these parts of methods are
/// verified as well.
IntegratorSpec as_reference(IntegratorSpec spec, int longest, const Scene& scene) {
    spec.params.emplace("rr_depth", std::to_string(longest + 1));
    const auto leave_out = [&](const char* param, const char* value) {
        if (!spec.make && integrator_entry(spec.name).info.has_param(param))
            spec.params.emplace(param, value);
    };
    if (scene.may_have_chains()) leave_out("specular_connections", "off");
    if (scene.has_emitter_choice()) leave_out("lights", "power");
    return spec;
}

/// Russian roulette before shadow rays depends on the weighted contribution. Unweighted contributions of a technique
/// with small weights become rare and unbounded. Therefore techniques are rendered without it. Empty where `spec` has
/// none, as `path` without specular connections.
std::optional<IntegratorSpec> without_join_roulette(IntegratorSpec spec, const Scene& scene) {
    if (spec.name == "path") {
        const auto specular = spec.params.find("specular_connections");
        const bool is_off = specular != spec.params.end() && specular->second == "off";
        if (is_off || !scene.may_have_chains()) return {};
    }
    if (spec.make || !integrator_entry(spec.name).info.has_param("roulette")) return {};
    if (!spec.params.emplace("roulette", "0").second) return {};
    return spec;
}

MethodReport start_report(const IntegratorSpec& spec, const RunSeries& series) {
    MethodReport m;
    m.method = spec.to_string();
    m.estimator = series.estimator;
    m.spp = series.samples();
    m.stats = series.stats();
    return m;
}

void add_warnings(const RunSeries& series, VerifyReport& report) {
    std::vector<std::string> texts = warnings(series.stats());
    texts.insert(texts.end(), series.memory_warnings.begin(), series.memory_warnings.end());
    for (const std::string& w : texts)
        report.warnings.push_back(fmt::format("{}: {}", series.spec.to_string(), w));
}

void finish(VerifyReport& report, const VerifyOptions& options) {
    for (const MethodReport& m : report.methods)
        m.for_each_tested([&](const WelchTest&) { ++report.tests; });
    report.level = sidak(options.alpha, std::max(1, report.tests));
}

/// Renders by `task`. Returns false if it was interrupted or failed, which the report then says.
template <class Task>
bool attempt(const IntegratorSpec& method, VerifyReport& report, const Task& task) {
    try {
        task();
        return true;
    } catch (const VerifyInterrupted&) {
        report.interrupted = true;
    } catch (...) {
        report.failures.push_back(fmt::format("{}: {}", method.to_string(), caught()));
    }
    return false;
}

VerifyReport verify_with_image(const std::vector<IntegratorSpec>& methods,
                               const VerifyOptions& options, const ReferenceImage& image,
                               const SeriesRenderer& renderer) {
    VerifyReport report;
    report.reference = image.name;
    const ErrorReference error_reference(image);
    for (size_t i = 0; i < methods.size(); ++i) {
        RunSeries series;
        const bool is_rendered = attempt(methods[i], report, [&] {
            series = renderer.begin(methods[i], 2 + i, options.spp,
                                    options.seconds.value_or(kDefaultSeconds));
            renderer.extend(series, 1);
        });
        if (report.interrupted) break;
        if (!is_rendered) continue;
        MethodReport m = start_report(methods[i], series);
        compare_images(series, image, renderer.grid(), m);
        m.errors = errors_of_runs(series, error_reference);
        m.slope = error_slope(m.errors);
        report.methods.push_back(std::move(m));
        add_warnings(series, report);
    }
    finish(report, options);
    return report;
}

/// A comparison of methods with reference methods: its series of renderings and the evaluation.
class MethodVerification {
public:
    MethodVerification(const std::vector<IntegratorSpec>& methods, const VerifyOptions& options,
                       SeriesRenderer& renderer)
        : specs_(methods), options_(options), renderer_(renderer),
          begin_(std::chrono::steady_clock::now()) {
        for (const IntegratorSpec& m : methods) make_integrator(limited(m, options.longest));
        for (const IntegratorSpec& r : options.against)
            reference_specs_.push_back(
                as_reference(limited(r, options.longest), options.longest, renderer.scene()));
        renderer.choose_cut_offs(reference_specs_.front());
        // Streams of random numbers: 1 is that of the first reference.
        uint64_t stream = 1;
        const auto start = [&](const IntegratorSpec& spec) {
            return renderer.begin(spec, stream++, options.spp, first_seconds());
        };
        references_.push_back(start(reference_specs_.front()));
        for (const IntegratorSpec& m : methods)
            methods_.push_back(start(limited(m, options.longest)));
        for (const IntegratorSpec& m : methods) {
            const auto spec = without_join_roulette(limited(m, options.longest), renderer.scene());
            unthinned_.push_back(spec ? std::optional(start(*spec)) : std::nullopt);
        }
        for (size_t i = 1; i < reference_specs_.size(); ++i)
            references_.push_back(start(reference_specs_[i]));
    }

    /// Makes one rendering in every run. The first method comes first, since it may fail, then the references; from then
    /// on, there are results.
    void render() {
        for (size_t i = 0; i < methods_.size() && !ended_.interrupted; ++i) {
            attempt(specs_[i], ended_, [&] {
                renderer_.extend(methods_[i], 1);
                if (unthinned_[i]) renderer_.extend(*unthinned_[i], 1);
            });
            if (specs_.size() == 1 && !ended_.failures.empty()) break;
            if (i == 0 && !ended_.interrupted) try {
                    for (RunSeries& s : references_) renderer_.extend(s, 1);
                } catch (const VerifyInterrupted&) {
                    ended_.interrupted = true;
                }
        }
        drop_unfinished();
    }
    VerifyReport report() const;
    /// Adds renderings until a relative error of `size` would be found or the time is over.
    ///
    /// The decision to stop depends on the spreads only, not on the difference of the means, which is tested once at
    /// the end. For independent normal values mean and variance are independent, so the final mean has the same
    /// distribution as with a fixed number of samples [Stein 1945]. The values are means of runs with at least
    /// kEnoughContributions on each side, hence nearly normal. The final variance is slightly too small, since a small
    /// estimate ends the rendering. There are few decisions, each with several times the samples of the previous one,
    /// so the effect is far smaller than the uncertainty already covered by the degrees of freedom
    /// (tests/unit/verify/sample_plan_test.cpp measures the rate of false alarms).
    VerifyReport render_until(double size, const SeriesRenderer::Report& progress);

private:
    /// Leaves out what has no rendering.
    void drop_unfinished() {
        const auto is_unfinished = [](const RunSeries& s) { return s.renderings == 0; };
        for (size_t i = methods_.size(); i-- > 0;)
            if (is_unfinished(methods_[i]) || (unthinned_[i] && is_unfinished(*unthinned_[i]))) {
                const auto at = std::ptrdiff_t(i);
                specs_.erase(specs_.begin() + at);
                methods_.erase(methods_.begin() + at);
                unthinned_.erase(unthinned_.begin() + at);
            }
        // Methods are compared with the first reference at least.
        if (is_unfinished(references_.front()))
            specs_.clear(), methods_.clear(), unthinned_.clear();
        for (size_t i = references_.size(); i-- > 1;)
            if (is_unfinished(references_[i])) {
                references_.erase(references_.begin() + std::ptrdiff_t(i));
                reference_specs_.erase(reference_specs_.begin() + std::ptrdiff_t(i));
            }
    }
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    }
    double first_seconds() const {
        if (!options_.detect) return options_.seconds.value_or(kDefaultSeconds);
        const double series = double(2 * specs_.size() + options_.against.size());
        return options_.seconds ? std::min(kFirstSeconds, *options_.seconds / (12 * series))
                                : kFirstSeconds;
    }
    MethodReport compare(size_t method) const;
    /// Factors by which the samples of references, then of methods, must grow.
    std::vector<double> growth(const VerifyReport& report, double size) const;
    std::vector<RunSeries*> series() {
        std::vector<RunSeries*> all;
        for (RunSeries& s : references_) all.push_back(&s);
        for (RunSeries& s : methods_) all.push_back(&s);
        return all;
    }

    std::vector<IntegratorSpec> specs_;
    VerifyReport ended_;  ///< What was interrupted or failed.
    const VerifyOptions& options_;
    SeriesRenderer& renderer_;
    std::chrono::steady_clock::time_point begin_;
    std::vector<IntegratorSpec> reference_specs_;
    std::vector<RunSeries> references_, methods_;
    std::vector<std::optional<RunSeries>> unthinned_;
};

MethodReport MethodVerification::compare(size_t i) const {
    const RunSeries& series = methods_[i];
    const CommonClasses common(series, references_);
    const Sides sides{series, references_, common};
    MethodReport m = start_report(specs_[i], series);
    compare_images(sides, renderer_.grid(), m);
    compare_lengths(sides, options_, renderer_.cut_offs(), m);
    compare_classes(sides, m);
    for (int edges = options_.shortest; edges <= options_.longest; ++edges)
        for (const Technique& q : techniques_of_length(edges))
            if (series.uses(q))
                m.techniques.push_back(
                    compare_technique(q, sides, unthinned_[i] ? *unthinned_[i] : series));
    return m;
}

VerifyReport MethodVerification::report() const {
    VerifyReport report = ended_;
    if (methods_.empty()) return report;
    std::vector<std::string> names;
    for (const IntegratorSpec& s : reference_specs_) names.push_back(s.to_string());
    report.reference = fmt::format("{}", fmt::join(names, ", "));
    const ErrorReference error_reference(references_.front());
    for (size_t i = 0; i < methods_.size(); ++i) {
        MethodReport m = compare(i);
        if (m.out_of_reach == 0) m.errors = errors_of_runs(methods_[i], error_reference);
        m.slope = error_slope(m.errors);
        report.methods.push_back(std::move(m));
        add_warnings(methods_[i], report);
        if (unthinned_[i]) add_warnings(*unthinned_[i], report);
    }
    for (const RunSeries& s : references_) add_warnings(s, report);
    finish(report, options_);
    return report;
}

std::vector<double> MethodVerification::growth(const VerifyReport& report, double size) const {
    const size_t references = references_.size(), count = references + methods_.size();
    std::vector<double> seconds;
    for (const RunSeries& s : references_) seconds.push_back(std::max(1e-3, s.seconds));
    for (const RunSeries& s : methods_) seconds.push_back(std::max(1e-3, s.seconds));

    std::vector<WantedPrecision> means;
    std::vector<double> growth(count, 1);
    for (size_t i = 0; i < methods_.size(); ++i) {
        const MethodReport& m = report.methods[i];
        const CommonClasses common(methods_[i], references_);
        const Sides sides{methods_[i], references_, common};
        const auto want = [&](double detectable, const auto& belongs) {
            if (detectable <= size) return;
            WantedPrecision mean{std::vector<double>(count), 0};
            double total = 0;
            const auto add = [&](size_t series, const Moments& moments) {
                total += mean.squared_errors[series] = moments.squared_error();
            };
            add(references + i, method_light(sides, belongs));
            for (size_t r = 0; r < references; ++r) {
                Moments part;
                for (size_t run = 0; run < methods_[i].runs.size(); ++run)
                    part.add(reference_light(sides, r, run, belongs));
                add(r, part);
            }
            const double smallest = WelchTest::kRounding;
            mean.wanted = kHeadroom * total *
                          sqr(std::max(size - smallest, 0.1 * smallest) / (detectable - smallest));
            if (total > 0) means.push_back(std::move(mean));
        };
        const Detectable found = report.detectable(m);
        if (found.image) want(*found.image, [](const PathClass&) { return true; });
        bool lacks_samples = !found.image;
        for (const LengthReport& l : m.lengths) {
            const auto belongs = [&](const PathClass& c) { return c.edges == l.edges; };
            if (l.share * (1 - l.out_of_reach) < kLargeShare) continue;
            if (l.comparison.is_tested())
                want(l.comparison.detectable(report.level), belongs);
            else
                lacks_samples = true;
        }
        if (lacks_samples) {
            growth[references + i] = kMostGrowth;
            std::fill_n(growth.begin(), references, kMostGrowth);
        }
    }
    const std::vector<double> planned = sample_growth(means, seconds);
    for (size_t i = 0; i < count; ++i)
        growth[i] = std::min(kMostGrowth, std::max(growth[i], planned[i]));
    return growth;
}

VerifyReport MethodVerification::render_until(double size, const SeriesRenderer::Report& progress) {
    while (true) {
        const VerifyReport now = report();
        bool is_enough = true;
        if (now.interrupted || now.methods.empty()) return now;
        for (const MethodReport& m : now.methods) is_enough &= now.detectable(m).reaches(size);
        if (is_enough) return now;

        const std::vector<double> factors = growth(now, size);
        const std::vector<RunSeries*> all = series();
        std::vector<double> more(all.size());
        double cost = 0;
        for (size_t i = 0; i < all.size(); ++i) {
            more[i] = std::ceil((factors[i] - 1) * double(all[i]->renderings));
            cost += more[i] * all[i]->seconds / double(all[i]->renderings);
        }
        const double left = options_.seconds ? *options_.seconds - seconds() : cost;
        const double share = cost > left ? left / cost : 1.0;
        bool is_any = false;
        for (double& m : more) is_any |= (m = std::floor(m * share)) > 0;
        if (!is_any) return now;
        if (progress)
            progress(fmt::format("{:.0f} s done, {:.0f} s more", seconds(), cost * share));
        // Renderings that are finished count, whatever happens to later ones.
        bool is_good = true;
        const auto extend = [&](RunSeries& s, uint64_t renderings) {
            is_good = is_good && attempt(s.spec, ended_, [&] { renderer_.extend(s, renderings); });
        };
        for (size_t i = 0; i < all.size(); ++i)
            if (more[i] > 0) extend(*all[i], uint64_t(more[i]));
        for (size_t i = 0; i < methods_.size(); ++i)
            if (auto& u = unthinned_[i]; u && u->renderings < methods_[i].renderings &&
                                         2 * u->seconds < kTechniqueTime * seconds())
                extend(*u, std::min(u->renderings, methods_[i].renderings - u->renderings));
        if (!is_good) return report();
    }
}

}  // namespace

const char* to_string(Verdict verdict) {
    switch (verdict) {
    case Verdict::Consistent: return "agrees";
    case Verdict::Deviates: return "deviates";
    case Verdict::Undecided: return "undecided";
    }
    return "";
}

Verdict VerifyReport::verdict(const MethodReport& method) const {
    bool any = false, deviating = false;
    method.for_each_tested([&](const WelchTest& t) {
        any = true;
        deviating |= deviates(t);
    });
    if (!any || method.too_rare > kTooMuchTooRare) return Verdict::Undecided;
    return deviating ? Verdict::Deviates : Verdict::Consistent;
}

Detectable VerifyReport::detectable(const MethodReport& m) const {
    Detectable d;
    for (const WelchTest& t : m.image)
        if (t.is_tested() && t.reference.mean() != 0)
            d.image = std::max(d.image.value_or(0), t.detectable(level));
    for (const LengthReport& l : m.lengths) {
        if (l.share * (1 - l.out_of_reach) < kLargeShare) continue;
        if (l.comparison.is_tested() && l.comparison.reference.mean() != 0)
            d.length = std::max(d.length.value_or(0), l.comparison.detectable(level));
        else
            d.not_tested.push_back(l.edges);
    }
    return d;
}

std::vector<IntegratorSpec> with_long_chains(const std::vector<IntegratorSpec>& methods) {
    std::vector<IntegratorSpec> all;
    for (const IntegratorSpec& method : methods) {
        all.push_back(method);
        const auto gives = [&](const char* name) { return method.params.contains(name); };
        if (make_integrator(method)->error_groups() == 0 || gives("groups") || gives("chains"))
            continue;
        IntegratorSpec longer = method;
        longer.params["groups"] = "2";
        longer.params["chains"] = "16";
        longer.params.emplace("p_large", "0.02");
        all.push_back(std::move(longer));
    }
    return all;
}

/// What renders: of `auto`, the method that it chooses, and of guide=auto, guide=on or off.
IntegratorSpec rendering_method(const Scene& scene, const IntegratorSpec& method,
                                const VerifyOptions& options) {
    if (!is_chosen_by_pilots(method)) return method;
    RenderSettings settings;
    settings.integrator = limited(method, options.longest);
    settings.sampler = options.sampler;
    settings.seed = options.seed;
    settings.threads = options.threads;
    settings.spp = options.spp;
    settings.seconds = options.seconds;
    IntegratorSpec chosen = with_chosen_method(scene, settings).integrator;
    chosen.params.erase("max_depth");
    return chosen;
}

VerifyReport verify(const Scene& scene, const std::vector<IntegratorSpec>& given_methods,
                    const VerifyOptions& given, const std::optional<ReferenceImage>& reference,
                    const std::function<void(const std::string&)>& progress) {
    VerifyOptions options = given;
    for (IntegratorSpec& r : options.against) r = rendering_method(scene, r, given);
    std::vector<IntegratorSpec> chosen;
    for (const IntegratorSpec& m : given_methods)
        chosen.push_back(rendering_method(scene, m, given));
    const std::vector<IntegratorSpec> methods = with_long_chains(chosen);
    SeriesRenderer renderer(scene, options, progress);
    VerifyReport report;
    try {
        if (reference) {
            report = verify_with_image(methods, options, *reference, renderer);
        } else {
            MethodVerification verification(methods, options, renderer);
            verification.render();
            report = options.detect ? verification.render_until(*options.detect, progress)
                                    : verification.report();
        }
    } catch (const VerifyInterrupted&) {
        report.interrupted = true;  // in a trial rendering at the start
    }
    if (report.methods.empty() && !report.failures.empty())
        throw std::runtime_error(report.failures.front());
    return report;
}

}  // namespace etendue
