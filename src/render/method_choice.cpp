#include "render/method_choice.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>

#include "description/json_text.h"
#include "integrator/auto.h"
#include "integrator/shared_by_pilots.h"
#include "render/candidates.h"
#include "render/cost_table.h"
#include "render/learned_guide.h"
#include "render/pilot_budget.h"
#include "render/pilot_rendering.h"
#include "render/render_request.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

using Clock = std::chrono::steady_clock;

/// Pixels of the first film of pilots, and of the largest one. From one to the next, there are kGrowth times as many, so
/// that the last pilots take most of the time.
constexpr double kFirstPixels = 768, kMostPixels = 49152, kGrowth = 4;
/// Candidates with a larger error, relative to the geometric mean of the two best, take no part in the next pilots.
constexpr double kHopeless = 3;
/// Chains of pilots are short, and see less of where chains stay. On veach-ajar, veach-bidir and two-rooms, the errors of `mlt`
/// after 60 s are 0.6 to 3 times those predicted without this factor.
constexpr double kLongChains = 1.5;
/// Sobol' points gain less with guided walks than without, which the few passes of pilots do not show: on cornell, the noise
/// of `path` with a guide after 128 passes is 1.06 times that without, where pilots show 0.75.
constexpr double kLongSequences = 1.1;
/// Pairs that an eye path finds on large films, where radii are learned: 9 to 12 on three scenes, from 12 wanted in the first pass.
constexpr double kWantedPairs = 10;
/// Walks of each kind that train the guide of a pilot, at least. More of them, up to those of the rendering, train it where this
/// takes at most a part of what guides may take.
constexpr uint64_t kLeastWalks = 16384;
constexpr double kShareOfTraining = 1.0 / 3;
/// What `auto` spends on candidates whose guides are new, relative to what pilots may still take.
constexpr double kShareOfGuides = 1.0 / 4;

const char* const kWithoutPilots = "bdpt";
const char* const kNoLimit = "-1";  // of max_depth

bool has_guide_by_pilots(const IntegratorSpec& spec) {
    const auto guide = spec.params.find("guide");
    return !spec.make && guide != spec.params.end() && guide->second == "auto" &&
           integrator_entry(spec.name).info.has_param("guide");
}

/// The integrator that was asked for; with all parameters of `auto` that are not empty.
std::string asked_text(IntegratorSpec spec) {
    if (is_auto(spec))
        for (const ParamInfo& p : auto_entry().info.params)
            if (*p.fallback) spec.params.emplace(p.name, p.fallback);
    return spec.to_string();
}

/// Without the names of files, of which the contents matter.
std::string without_files(const std::string& text) {
    IntegratorSpec spec = IntegratorSpec::parse(text);
    spec.params.erase("user_paths");
    return spec.to_string();
}

/// A method, and what its last pilot has shown.
struct Contender {
    MethodChoice::Candidate shown = {};  ///< Its method is the name, and whether there is a guide.
    IntegratorSpec spec;                 ///< Of the rendering.
    std::shared_ptr<const Guide> guide = nullptr;  ///< That of its pilots.
    std::string unguided = "";  ///< The method of which this is the one with a guide.
    bool has_tried_guide = false;
    bool has_light = false;  ///< Whether its last pilot has met any.
    MethodPilot pilot = {};
    /// Of the last pilot; 0: there was none.
    struct History {
        double image_noise = 0;
        // Simulated seconds:
        double pass_a_pixel = 0, start_a_pixel = 0;
    } history = {};
    double prepared_seconds = 0;  ///< Simulated, of what its first pilot has prepared.

    static Contender of(IntegratorSpec spec) {
        Contender c{.spec = std::move(spec)};
        c.shown.method = c.spec.name;
        return c;
    }
    /// The same with a guide, which it has in its pilots.
    Contender guided_by(std::shared_ptr<const Guide> trained) const {
        Contender c = of(spec);
        c.spec.params["guide"] = "on";
        c.shown.method += ":guide=on";
        c.guide = std::move(trained);
        c.unguided = method();
        c.has_tried_guide = true;
        return c;
    }
    const std::string& method() const { return shown.method; }
    const std::string& name() const { return spec.name; }
    bool reuses_light_paths() const { return candidate_method(name()).reuses_light_paths; }
    bool has_chains() const { return candidate_method(name()).has_chains; }
    IntegratorParams params() const { return {spec, integrator_entry(name()).info}; }
    bool may_have_guide() const {
        const IntegratorParams p = params();
        // Chains by user paths have none.
        return !has_tried_guide && p.has("guide") &&
               !(p.has("user_paths") && !p.string("user_paths").empty());
    }
    /// Of each kind, that train the guide of the rendering.
    uint64_t walks_of_training() const { return uint64_t(params().integer("guide_walks")); }
    bool decides_on_specular(const Scene& scene) const {
        return scene.may_have_chains() &&
               integrator_entry(name()).info.has_param("specular_connections");
    }
    /// Whether a given number of light paths is that of a whole pass, and not of those that are stored for connections.
    bool has_light_paths_of_pass() const {
        const auto given = spec.params.find("light_paths");
        return name() != "pcbpt" && given != spec.params.end() &&
               params().integer("light_paths") > 0;
    }
    /// What renders its pilots, on films with such a part of the pixels.
    IntegratorSpec pilot_spec(double part) const {
        IntegratorSpec small = spec;
        if (has_light_paths_of_pass())
            small.params["light_paths"] =
                std::to_string(std::max(1L, std::lround(params().integer("light_paths") * part)));
        // Chains have few states in pilots, and need as many for each as in the rendering. Of the groups, two suffice.
        if (has_chains()) small.params["groups"] = "2", small.params["chains"] = "16";
        small.guide = guide;
        return small;
    }
    /// Simulated seconds of a sample in the rendering, whose film has `ratio` times as many pixels as that of the last pilot. The
    /// more light paths there are in a pass, the more pairs are found, until there are as many as gathers want.
    double sample_seconds(double pixels, double ratio) const {
        const double more = candidate_method(name()).gathers && pilot.pairs_an_eye_path > 0
                                ? std::clamp(kWantedPairs / pilot.pairs_an_eye_path, 1.0, ratio)
                                : 1.0;
        return (pilot.pass_seconds + (more - 1) * pilot.pair_seconds) / pixels;
    }
    /// Simulated seconds of pilots on a film of so many pixels, where it has had one already.
    double pilot_seconds(double pixels) const {
        return kPilotReplicates * pixels *
               (kPilotPasses * history.pass_a_pixel + history.start_a_pixel);
    }
};

/// Among what pilots choose.
struct Question {
    std::vector<Contender> contenders;  ///< Without guides, in the order in which they are tried.
    IntegratorSpec without_pilots;      ///< What renders where nothing can be said.
    int threads = 1;                    ///< See threads_of_auto().
    PilotShare share;                   ///< Of the rendering, for pilots.
    double share_of_guides;             ///< See kShareOfGuides.
};

/// A spec as choose_integrator() makes it of the same text, with the parameters of `auto` that the method has, too.
IntegratorSpec spec_for_auto(const Scene& scene, const IntegratorParams& asked,
                             const std::string& method) {
    IntegratorSpec spec = choose_integrator(scene, method);
    const std::string& depth = asked.string("max_depth");
    if (const std::string& of_scene = spec.params["max_depth"];
        depth == kNoLimit && (of_scene.empty() || of_scene == kNoLimit))
        spec.params.erase("max_depth");
    else
        spec.params["max_depth"] = depth;
    if (spec.name == "mlt" && !asked.string("user_paths").empty())
        spec.params["user_paths"] = asked.string("user_paths");
    // Pilots decide, and not the scene.
    if (spec.params.contains("guide")) spec.params["guide"] = "off";
    return spec;
}

Question question_of_auto(const Scene& scene, const IntegratorSpec& integrator, int ranks) {
    constexpr int kShortestOfChains = 3;
    const IntegratorParams asked(integrator, auto_entry().info);
    const int max_depth = asked.integer("max_depth");
    const bool may_have_chains =
        asked.flag("chains") && ranks == 1 && (max_depth < 0 || max_depth >= kShortestOfChains);
    const auto may_be = [&](const CandidateMethod& m) {
        const std::string_view name = m.name;
        if (!m.is_of_auto) return false;
        // What light of emitters without extent reaches by way of mirrors and glass, eye paths never find.
        if (name == "path") return !scene.has_delta_emitters();
        if (name == "vcm") return asked.flag("consistent");
        return !m.has_chains || may_have_chains;
    };
    Question q{.contenders = {},
               .without_pilots = spec_for_auto(scene, asked, kWithoutPilots),
               .threads = threads_of_auto(asked),
               .share = kShareOfAuto,
               .share_of_guides = kShareOfGuides};
    for (const CandidateMethod& m : kCandidateMethods)
        if (may_be(m)) q.contenders.push_back(Contender::of(spec_for_auto(scene, asked, m.name)));
    return q;
}

/// Whether a method is better with its guide.
Question question_of_guide(IntegratorSpec integrator) {
    make_integrator(integrator);  // throws if the parameters are wrong
    integrator.params["guide"] = "off";
    return {.contenders = {Contender::of(integrator)},
            .without_pilots = integrator,
            .share = kShareOfGuideChoice,
            .share_of_guides = 1};
}

class Choosing {
public:
    Choosing(const Scene& scene, const RenderSettings& settings, const std::atomic<bool>& drop,
             Question question)
        : scene_(scene), drop_(drop), settings_(settings), question_(std::move(question)),
          budget_(settings, question_.threads, question_.share, whole_pixels(),
                  typical_sample_seconds(question_.contenders.front().name())),
          contenders_(question_.contenders) {
        settings_.choice = nullptr;
        settings_.first_pass = 0;
        settings_.technique_depth = 0;
        settings_.observer = nullptr;
        settings_.meanwhile = {};
        settings_.ranks = &kAlone;
        static_cast<RenderLimits&>(settings_) = {};
    }

    MethodChoice choose() {
        const auto begin = Clock::now();
        for (double pixels = kFirstPixels; pixels <= kMostPixels; pixels *= kGrowth) {
            const bool is_first = pixels == kFirstPixels;
            if (!is_first && pixels > whole_pixels()) break;
            // Alone, a method can still be compared with itself.
            if (contenders_.size() < 2 && !may_add_guides()) break;
            if (!(is_first ? has_time_for_two(pixels) : has_time_for_all(pixels))) break;
            if (!is_first) add_guides(pixels);
            if (!is_first && contenders_.size() < 2) break;
            if (!try_all(pixels, is_first) || contenders_.empty()) break;
            drop_hopeless();
        }
        MethodChoice choice;
        choice.asked = asked_text(settings_.integrator);
        choice.candidates = candidates();
        // Where no pilot has met light with noise, all are equal, unless some have met light and others have not.
        const bool has_seen_noise =
            std::any_of(choice.candidates.begin(), choice.candidates.end(),
                        [](const auto& k) { return k.images > 0 && k.error() > 0; });
        const bool differs =
            !contenders_.empty() && contenders_.front().has_light != contenders_.back().has_light;
        // Alone, a method shows neither what it lacks nor whether another one is better.
        const bool is_compared = contenders_.size() + dropped_.size() > 1 || untried_.empty();
        const Contender best = !contenders_.empty() && is_compared && (has_seen_noise || differs)
                                   ? contenders_.front()
                                   : Contender::of(question_.without_pilots);
        std::stable_partition(choice.candidates.begin(), choice.candidates.end(),
                              [&](const auto& k) { return k.method == best.method(); });
        choice.chosen = best.spec.to_string();
        choice.budget = budget_.seconds();
        choice.pilots = budget_.spent();
        choice.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
        return choice;
    }

private:
    double whole_pixels() const { return double(scene_.film().pixel_count()); }

    std::vector<MethodChoice::Candidate> candidates() const {
        std::vector<MethodChoice::Candidate> all;
        for (const Contender& c : contenders_) all.push_back(c.shown);
        all.insert(all.end(), dropped_.rbegin(), dropped_.rend());
        all.insert(all.end(), untried_.begin(), untried_.end());
        return all;
    }

    /// Simulated seconds of pilots of a contender.
    double cost_of(const Contender& c, double pixels) const {
        if (c.shown.images > 0) return c.pilot_seconds(pixels);
        if (!c.unguided.empty())
            for (const Contender& known : contenders_)
                if (known.method() == c.unguided) return cost_with_guide(known, pixels);
        // Of the cheapest method it is known what a sample takes in this scene.
        const double slower =
            cheapest_ > 0 ? cheapest_ / typical_sample_seconds(cheapest_method_) : 1.0;
        return decision_seconds(c) +
               kPilotReplicates * kPilotPasses * pixels * slower * typical_sample_seconds(c.name());
    }
    /// The same of the first pilots of a contender with a guide. `c` is without, and has had pilots.
    double cost_with_guide(const Contender& c, double pixels) const {
        return decision_seconds(c) +
               guided_factor(GuideUse::WithSurfaces) * c.pilot_seconds(pixels);
    }
    /// Of the decision about specular connections.
    double decision_seconds(const Contender& c) const {
        return c.decides_on_specular(scene_) ? typical_specular_pilot_seconds() : 0;
    }
    double pixels_of(double pixels) const {
        const auto [width, height] = size_of_pilot(scene_.film(), pixels);
        return double(width) * double(height);
    }

    /// For pilots of the two cheapest contenders, if there are so many.
    bool has_time_for_two(double pixels) const {
        double cost = 0;
        for (size_t i = 0; i < std::min<size_t>(2, contenders_.size()); ++i)
            cost += cost_of(contenders_[i], pixels_of(pixels));
        return budget_.can_spend(cost);
    }
    double cost_of_all(double pixels) const {
        double all = 0;
        for (const Contender& c : contenders_) all += cost_of(c, pixels_of(pixels));
        return all;
    }
    bool has_time_for_all(double pixels) const { return budget_.can_spend(cost_of_all(pixels)); }

    /// Pilots of all contenders on a film of so many pixels. Puts the contenders in order. Those of which there were none yet
    /// are left out where there is no time for them. Where there is too little for another one, the result is false: then the
    /// pilots do not count, and the order stays.
    bool try_all(double pixels, bool is_first) {
        const auto [width, height] = size_of_pilot(scene_.film(), pixels);
        const Scene small = scene_.seen_by_film(width, height);
        const double each = double(width) * double(height);
        double cost_of_others = is_first ? 0 : cost_of_all(pixels);
        std::vector<Contender> tried;
        std::vector<MethodChoice::Candidate> untried;
        for (Contender c : contenders_) {
            const double cost = cost_of(c, each);
            if (c.has_chains() && is_beyond_chains()) {
                cost_of_others -= is_first ? 0 : cost;
                untried.push_back(c.shown);
                continue;
            }
            const bool can_wait = is_first && tried.size() >= 2;
            if (can_wait && !budget_.can_spend(cost)) {
                untried.push_back(c.shown);
                continue;
            }
            if (!is_first) cost_of_others -= cost;
            c.pilot = pilot_of(small, c, budget_.left() - std::max(0.0, cost_of_others));
            if (c.pilot.is_stopped) {
                if (c.shown.images > 0) {
                    // Those that are new in this round.
                    std::erase_if(contenders_, [&](const Contender& k) {
                        if (k.shown.images == 0) untried_.push_back(k.shown);
                        return k.shown.images == 0;
                    });
                    return false;
                }
                untried.push_back(c.shown);
                continue;
            }
            c.prepared_seconds += c.pilot.prepared_seconds;
            // Chains that have found nothing make direct light alone, and seem cheap.
            if (is_first && (!c.has_chains() || contenders_.size() == 1) &&
                (cheapest_ == 0 || c.pilot.pass_seconds < cheapest_ * each)) {
                cheapest_ = c.pilot.pass_seconds / each;
                cheapest_method_ = c.name();
                budget_.set_sample_seconds(cheapest_);
            }
            tried.push_back(std::move(c));
        }
        contenders_ = std::move(tried);
        untried_.insert(untried_.end(), untried.begin(), untried.end());
        if (!contenders_.empty()) judge(width, height);
        return true;
    }

    MethodPilot pilot_of(const Scene& small, const Contender& c, double most) {
        RenderSettings settings = settings_;
        settings.integrator = c.pilot_spec(double(small.film().pixel_count()) / whole_pixels());
        settings.integrator.shared_by_pilots = shared_by_pilots_;
        const MethodPilot pilot = render_pilot(small, settings, number_, most, drop_);
        number_ += kPilotReplicates;
        budget_.spend(pilot.all_seconds);
        return pilot;
    }

    /// Scores the pilots of the contenders, and puts the contenders in order.
    void judge(int width, int height) {
        const double pixels = double(width) * double(height), ratio = whole_pixels() / pixels;
        score(width, height, ratio);
        const std::vector<double> factors =
            factors_of_noise(pixels_before_ > 0 ? pixels / pixels_before_ : kGrowth, ratio);
        pixels_before_ = pixels;
        apply(factors);
        if (budget_.error()) {
            const double before = budget_.seconds();
            double shortest = std::numeric_limits<double>::infinity();
            for (const Contender& c : contenders_) {
                // Without light, or without time for samples, there is no error to judge by.
                if (!c.has_light || c.shown.start_seconds >= before) continue;
                shortest = std::min(shortest, seconds_until(sqr(*budget_.error()), c.shown.error(),
                                                            before, c.shown.start_seconds));
            }
            if (std::isfinite(shortest)) budget_.set_error_seconds(shortest);
            score(width, height, ratio);
            apply(factors);
        }
        // Of equal ones, the cheaper one. What has met no light tells nothing, and comes last.
        std::stable_sort(contenders_.begin(), contenders_.end(),
                         [](const Contender& a, const Contender& b) {
                             if (a.has_light != b.has_light) return a.has_light;
                             return a.shown.error() < b.shown.error();
                         });
    }

    /// Scores for a rendering of the present budget, on a film of `ratio` times as many pixels.
    void score(int width, int height, double ratio) {
        const double pixels = double(width) * double(height);
        std::vector<PilotImages> images;
        for (Contender& c : contenders_) {
            MethodPilot& p = c.pilot;
            c.history.start_a_pixel = p.start_seconds / pixels;
            c.history.pass_a_pixel = p.pass_seconds / pixels;
            c.shown.pixels = width * height;
            c.shown.images = int(p.images.images.size());
            c.shown.sample_seconds = c.sample_seconds(pixels, ratio);
            c.shown.start_seconds = start_seconds(c, pixels);
            const double image =
                double(p.passes_per_image) * c.shown.sample_seconds * pixels * ratio;
            // If there is no time left after the start, the method is hopeless.
            p.images.horizon = std::max(0.01, (budget_.seconds() - c.shown.start_seconds) /
                                                  std::max(image, 1e-12));
            p.images.pixels_in_one = c.has_chains() ? ratio : 1;
            images.push_back(p.images);
        }
        const std::vector<PilotScore> scores = score_pilots(images, width, height);
        for (size_t i = 0; i < scores.size(); ++i) {
            contenders_[i].shown.noise = scores[i].noise;
            contenders_[i].shown.missing = scores[i].missing;
            contenders_[i].has_light = scores[i].has_light;
        }
    }

    /// What the noise of the rendering has more or less than that of the pilots, whose film has `growth` times as many pixels
    /// as the one before.
    std::vector<double> factors_of_noise(double growth, double ratio) {
        using Kind = NoiseOfFilms::Kind;
        std::vector<NoiseOfFilms> noise;
        for (Contender& c : contenders_) {
            const double now = c.pilot.image_noise(c.shown.noise);
            noise.push_back({.kind = c.has_chains()           ? Kind::Chains
                                     : c.reuses_light_paths() ? Kind::Reuse
                                                              : Kind::Independent,
                             .before = c.history.image_noise,
                             .now = now,
                             .like = c.history.image_noise > 0 ? -1 : index_of(c.unguided)});
            c.history.image_noise = now;
        }
        std::vector<double> factors = reuse_factors(noise, growth, ratio);
        for (size_t i = 0; i < factors.size(); ++i) {
            if (noise[i].kind == Kind::Chains) factors[i] = kLongChains;
            if (contenders_[i].guide && !contenders_[i].has_chains() &&
                settings_.sampler == SamplerKind::Sobol)
                factors[i] *= kLongSequences;
        }
        return factors;
    }
    int index_of(const std::string& method) const {
        for (size_t i = 0; i < contenders_.size(); ++i)
            if (contenders_[i].method() == method) return int(i);
        return -1;
    }
    void apply(const std::vector<double>& factors) {
        for (size_t i = 0; i < factors.size(); ++i) contenders_[i].shown.noise *= factors[i];
    }

    /// Of what the whole rendering makes once.
    double start_seconds(const Contender& c, double pixels) const {
        // Chains begin with samples, one or two for each pixel; see run_pilot(). Other methods make a costlier first pass.
        constexpr double kMostSamples = 1 << 17;
        const double begun =
                         c.has_chains() ? std::min(whole_pixels(), kMostSamples) : whole_pixels(),
                     first = c.pilot.start_seconds * std::max(1.0, begun / pixels);
        return first + c.prepared_seconds + (is_specular(c) ? specular_photon_seconds() : 0) +
               (c.guide ? guide_seconds(c) : 0);
    }
    /// Of the training before the first pass of the rendering, and of the refits later; see Guiding::train().
    double guide_seconds(const Contender& c) const {
        const auto walks = double(c.walks_of_training());
        const double samples = budget_.seconds() / std::max(c.shown.sample_seconds, 1e-12),
                     refits = c.has_chains() || !c.guide->guides_surfaces()
                                  ? 0
                                  : std::floor(std::log2(std::max(1.0, samples / walks)) / 3);
        return (1 + refits) * training_seconds(c.walks_of_training());
    }
    /// Whether specular connections of a method with light paths make light that chains hardly find. Pilots of chains that lack
    /// it agree, as if nothing were missing.
    bool is_beyond_chains() const {
        const auto& pilots = shared_by_pilots_->specular;
        return std::any_of(pilots.begin(), pilots.end(), [](const auto& p) {
            return !p.first.starts_with("path") && p.second.is_beyond_chains();
        });
    }
    /// Whether the method has decided for specular connections.
    bool is_specular(const Contender& c) const {
        const auto pilot =
            shared_by_pilots_->specular.find(specular_pilot_name(c.name(), c.guide != nullptr));
        return pilot != shared_by_pilots_->specular.end() && pilot->second.is_worthwhile();
    }

    void drop_hopeless() {
        // On small films one of the best may be there by luck.
        const auto error_of = [&](size_t i) { return contenders_[i].shown.error(); };
        const double most =
            kHopeless *
            std::sqrt(error_of(0) * error_of(std::min<size_t>(1, contenders_.size() - 1)));
        for (size_t i = contenders_.size(); i-- > 1;) {
            // What a larger film may show at best.
            const double gain = contenders_[i].reuses_light_paths() ? sqr(kMostGainOfReuse) : 1;
            if (contenders_[i].shown.error() <= gain * most) continue;
            dropped_.push_back(contenders_[i].shown);
            contenders_.erase(contenders_.begin() + ptrdiff_t(i));
        }
    }

    /// Whether a guide may still help. Its training for the rendering itself must be a small part of it.
    bool may_add_guide(const Contender& c) const {
        return c.may_have_guide() &&
               Budget::is_small(training_seconds(c.walks_of_training()), budget_.seconds());
    }
    bool may_add_guides() const {
        return std::any_of(contenders_.begin(), contenders_.end(),
                           [&](const Contender& c) { return may_add_guide(c); });
    }

    /// Trains guides for the contenders that can have one, the best first, as far as there is time for them and for all pilots
    /// on a film of so many pixels. Adds those that may gain something.
    void add_guides(double pixels) {
        double pilots = cost_of_all(pixels), left = question_.share_of_guides * budget_.planned();
        const uint64_t affordable = walks_of_pilot(left);
        std::vector<Contender> more;
        for (Contender& c : contenders_) {
            // Without noise, there is nothing to gain.
            if (!may_add_guide(c) || !(c.shown.error() > 0)) continue;
            const uint64_t walks = std::min(affordable, c.walks_of_training());
            const double training = training_seconds(walks),
                         guided = cost_with_guide(c, pixels_of(pixels));
            if (training + guided > left || !budget_.can_spend(training + pilots + guided))
                continue;
            c.has_tried_guide = true;
            budget_.spend(training);
            left -= training;
            const auto guide = trained_guide(c, walks);
            if (!guide) continue;
            pilots += guided;
            left -= guided;
            more.push_back(c.guided_by(guide));
        }
        contenders_.insert(contenders_.end(), more.begin(), more.end());
    }

    /// As many as there is time for, if all contenders get a guide that may have one.
    uint64_t walks_of_pilot(double time_of_guides) const {
        const auto guides =
            double(std::count_if(contenders_.begin(), contenders_.end(),
                                 [&](const Contender& c) { return may_add_guide(c); }));
        const double each = kShareOfTraining * time_of_guides / std::max(1.0, guides);
        return std::max(kLeastWalks, uint64_t(each / training_seconds(1)));
    }

    /// nullptr if it gains nothing.
    std::shared_ptr<const Guide> trained_guide(const Contender& c, uint64_t walks) {
        IntegratorSpec spec = c.spec;
        spec.params["guide_walks"] = std::to_string(walks);
        try {
            const LearnedGuide learned(scene_, spec,
                                       pilot_seed(settings_.seed, PilotUse::Choice, number_++),
                                       settings_.threads);
            if (drop_.load()) throw PassDropped();
            if (learned.may_gain()) return std::make_shared<const Guide>(learned.guide());
        } catch (const NothingToLearn&) {
        }
        return nullptr;
    }

    const Scene& scene_;
    const std::atomic<bool>& drop_;
    RenderSettings settings_;
    Question question_;
    Budget budget_;
    std::vector<Contender> contenders_;  ///< The best first, once there are pilots.
    std::vector<MethodChoice::Candidate> dropped_, untried_;
    double cheapest_ = 0;  ///< Simulated seconds of a sample of the cheapest contender so far.
    std::string cheapest_method_;
    double pixels_before_ = 0;  ///< Of the film of the last pilots.
    uint64_t number_ = 0;       ///< Of the next pilot.
    const std::shared_ptr<SharedByPilots> shared_by_pilots_ = std::make_shared<SharedByPilots>();
};

}  // namespace

bool is_chosen_by_pilots(const IntegratorSpec& spec) {
    return is_auto(spec) || has_guide_by_pilots(spec);
}

RenderSettings with_chosen_method(const Scene& scene, const RenderSettings& settings,
                                  const std::atomic<bool>& drop) {
    if (!is_chosen_by_pilots(settings.integrator)) return settings;
    RenderSettings chosen = settings;
    Question question = is_auto(settings.integrator)
                            ? question_of_auto(scene, settings.integrator, settings.ranks->count())
                            : question_of_guide(settings.integrator);
    const auto choice = std::make_shared<const MethodChoice>(
        Choosing(scene, settings, drop, std::move(question)).choose());
    chosen.integrator = IntegratorSpec::parse(choice->chosen);
    chosen.choice = choice;
    return chosen;
}

RenderSettings with_chosen_method(const RenderSettings& settings, const MethodChoice& earlier) {
    if (!is_chosen_by_pilots(settings.integrator)) return settings;
    if (const std::string asked = as_utf8(asked_text(settings.integrator));
        without_files(asked) != without_files(as_utf8(earlier.asked)))
        throw std::runtime_error(fmt::format(
            "the method was chosen by \"{}\" there, but it is to be chosen by \"{}\" here",
            earlier.asked, asked));
    RenderSettings chosen = settings;
    chosen.integrator = IntegratorSpec::parse(earlier.chosen);
    // In the text that was read, a name of a file that is not UTF-8 has marks.
    if (const auto file = settings.integrator.params.find("user_paths");
        file != settings.integrator.params.end() && chosen.integrator.params.count(file->first))
        chosen.integrator.params[file->first] = file->second;
    chosen.choice = std::make_shared<const MethodChoice>(earlier);
    return chosen;
}

}  // namespace etendue
