#include "render/method_choice.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "description/json_text.h"
#include "integrator/auto.h"
#include "integrator/shared_by_pilots.h"
#include "render/candidates.h"
#include "render/cost_table.h"
#include "render/learned_guide.h"
#include "render/pilot_rendering.h"
#include "render/render_request.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

using Clock = std::chrono::steady_clock;

/// The largest part of a rendering that pilots may take, by simulated time. They are planned to take a little less, since
/// what they take is not known before.
constexpr double kShare = 0.08, kPlannedShare = 0.075;
/// Pixels of the first film of pilots, and of the largest one. From one to the next, there are kGrowth times as many, so
/// that the last pilots take most of the time.
constexpr double kFirstPixels = 768, kMostPixels = 49152, kGrowth = 4;
/// Candidates with a larger error, relative to the best, take no part in the next pilots.
constexpr double kHopeless = 3;
/// Chains of pilots are short, and see less of where chains stay. On veach-ajar, veach-bidir and two-rooms, the errors of `mlt`
/// after 60 s are 0.6 to 3 times those predicted without this factor.
constexpr double kLongChains = 1.5;
/// Simulated seconds that a rendering without limits is taken to have.
constexpr double kUnlimitedSeconds = 60;
/// relMSE of an image with one sample per pixel, before there are pilots: of simple scenes.
constexpr double kPlausibleError = 1;
/// Walks of each kind that train the guide of a pilot.
constexpr uint64_t kWalksOfPilot = 16384;
/// The same of the rendering, whose methods have their default parameters.
uint64_t walks_of_training() {
    for (const ParamInfo& p : Guiding::params())
        if (std::string_view(p.name) == "guide_walks") return std::stoull(p.fallback);
    throw std::logic_error("guides have no parameter guide_walks");
}

const char* const kWithoutPilots = "bdpt";
const char* const kNoLimit = "-1";  // of max_depth

/// The integrator that was asked for, with all parameters of `auto` that are not empty.
std::string with_all_params(IntegratorSpec spec) {
    for (const ParamInfo& p : auto_entry().info.params)
        if (*p.fallback) spec.params.emplace(p.name, p.fallback);
    return spec.to_string();
}

/// A method, and what its last pilot has shown.
struct Contender {
    MethodChoice::Candidate shown;  ///< Its method is without the parameters of `auto`.
    std::string in_pilots;          ///< The method with parameters for short runs.
    std::shared_ptr<const Guide> guide = nullptr;
    std::string unguided = "";  ///< The method of which this is the one with a guide.
    bool has_light = false;     ///< Whether its last pilot has met any.
    MethodPilot pilot;
    /// Of the last pilot; 0: there was none.
    struct History {
        double image_noise = 0;
        double start_a_pixel = 0;  ///< Simulated seconds of MethodPilot::start_seconds.
    } history;
    double prepared_seconds = 0;  ///< Simulated, of what its first pilot has prepared.

    static Contender of(const std::string& method, const std::string& params = "") {
        return {
            .shown = {.method = method}, .in_pilots = method + params, .pilot = {}, .history = {}};
    }
    const std::string& method() const { return shown.method; }
    std::string name() const { return IntegratorSpec::parse(method()).name; }
    bool reuses_light_paths() const { return candidate_method(method()).reuses_light_paths; }
    bool has_chains() const { return candidate_method(method()).has_chains; }
    /// Pilots with chains are too few to tell what a guide gains there.
    bool can_have_guide() const {
        return !has_chains() && !guide && integrator_entry(name()).info.has_param("guide");
    }
    bool decides_on_specular(const Scene& scene) const {
        return scene.may_have_chains() &&
               integrator_entry(name()).info.has_param("specular_connections");
    }
    /// Simulated seconds of pilots on a film of so many pixels, where it has had one already.
    double pilot_seconds(double pixels) const {
        return kPilotReplicates * pixels *
               (kPilotPasses * shown.sample_seconds + history.start_a_pixel);
    }
};

/// Those that may take part, in the order in which they are tried.
std::vector<Contender> contenders(const Scene& scene, const IntegratorParams& asked, int ranks) {
    // Chains have few states in pilots, and need as many for each as in the rendering. Of the groups, two suffice.
    constexpr const char* kChains = ":groups=2,chains=16";
    constexpr int kShortestOfChains = 3;
    const int max_depth = asked.integer("max_depth");
    const bool may_have_chains =
        asked.flag("chains") && ranks == 1 && (max_depth < 0 || max_depth >= kShortestOfChains);
    const auto may_be = [&](const CandidateMethod& m) {
        const std::string_view name = m.name;
        // What light of emitters without extent reaches by way of mirrors and glass, eye paths never find.
        if (name == "path") return !scene.has_delta_emitters();
        if (name == "vcm") return asked.flag("consistent");
        return !m.has_chains || may_have_chains;
    };
    std::vector<Contender> all;
    for (const CandidateMethod& m : kCandidateMethods)
        if (may_be(m)) all.push_back(Contender::of(m.name, m.has_chains ? kChains : ""));
    return all;
}

/// Simulated seconds: of the rendering, and of the pilots, which may take a small part of it.
class Budget {
public:
    Budget(const RenderLimits& limits, int threads, double pixels, double sample_seconds)
        : limits_(limits), pixels_(pixels), sample_seconds_(sample_seconds) {
        if (limits_.seconds) *limits_.seconds *= threads;
    }

    /// Of the rendering: what the first limit takes that is reached.
    double seconds() const {
        double seconds = std::numeric_limits<double>::infinity();
        if (limits_.spp) seconds = double(*limits_.spp) * pixels_ * sample_seconds_;
        if (limits_.seconds) seconds = std::min(seconds, *limits_.seconds);
        if (limits_.error)
            seconds = std::min(seconds, error_seconds_.value_or(plausible_error_seconds()));
        return std::isfinite(seconds) ? seconds : kUnlimitedSeconds;
    }
    std::optional<double> error() const { return limits_.error; }
    /// What a sample of the cheapest method takes.
    void set_sample_seconds(double seconds) { sample_seconds_ = seconds; }
    /// The time in which the best method reaches error(): no more than that can be saved.
    void set_error_seconds(double seconds) { error_seconds_ = seconds; }

    bool can_spend(double seconds) const {
        return spent_ + seconds <= kPlannedShare * this->seconds();
    }
    /// What pilots may take at most.
    double left() const { return std::max(0.0, kShare * seconds() - spent_); }
    /// Whether it would be a small part of the rendering.
    static bool is_small(double seconds, double of) { return seconds <= kShare * of; }
    void spend(double seconds) { spent_ += seconds; }
    double spent() const { return spent_; }

private:
    double plausible_error_seconds() const {
        return std::max(1.0, kPlausibleError / sqr(*limits_.error)) * pixels_ * sample_seconds_;
    }

    RenderLimits limits_;
    double pixels_, sample_seconds_;
    std::optional<double> error_seconds_;
    double spent_ = 0;
};

class Choosing {
public:
    Choosing(const Scene& scene, const RenderSettings& settings, const std::atomic<bool>& drop)
        : scene_(scene), drop_(drop), settings_(settings),
          asked_(settings.integrator, auto_entry().info),
          budget_(settings, threads_of_auto(asked_), whole_pixels(),
                  typical_sample_seconds("path")),
          contenders_(contenders(scene, asked_, settings.ranks->count())) {
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
            if (contenders_.size() < 2) break;
            if (!try_all(pixels, is_first) || contenders_.empty()) break;
            drop_hopeless();
        }
        MethodChoice choice;
        choice.asked = with_all_params(settings_.integrator);
        choice.candidates = candidates();
        // Where no pilot has met light with noise, all are equal, unless some have met light and others have not.
        const bool has_seen_noise =
            std::any_of(choice.candidates.begin(), choice.candidates.end(),
                        [](const auto& k) { return k.images > 0 && k.error() > 0; });
        const bool differs =
            !contenders_.empty() && contenders_.front().has_light != contenders_.back().has_light;
        // Alone, a method shows neither what it lacks nor whether another one is better.
        const bool is_compared = contenders_.size() + dropped_.size() > 1 || untried_.empty();
        const std::string best = !contenders_.empty() && is_compared && (has_seen_noise || differs)
                                     ? contenders_.front().method()
                                     : kWithoutPilots;
        std::stable_partition(choice.candidates.begin(), choice.candidates.end(),
                              [&](const auto& k) { return k.method == best; });
        choice.chosen = spec_of(best).to_string();
        choice.budget = budget_.seconds();
        choice.pilots = budget_.spent();
        choice.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
        return choice;
    }

private:
    double whole_pixels() const { return double(scene_.film().pixel_count()); }

    /// A spec as choose_integrator() makes it of the same text, with the parameters of `auto` that the method has, too.
    IntegratorSpec spec_of(const std::string& method) const {
        IntegratorSpec spec = choose_integrator(scene_, method);
        const std::string& depth = asked_.string("max_depth");
        if (const std::string& of_scene = spec.params["max_depth"];
            depth == kNoLimit && (of_scene.empty() || of_scene == kNoLimit))
            spec.params.erase("max_depth");
        else
            spec.params["max_depth"] = depth;
        if (spec.name == "mlt" && !asked_.string("user_paths").empty())
            spec.params["user_paths"] = asked_.string("user_paths");
        return spec;
    }

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
                if (known.method() == c.unguided)
                    return guided_factor(true) * known.pilot_seconds(pixels);
        // Of the cheapest method it is known what a sample takes in this scene.
        const double slower =
            cheapest_ > 0 ? cheapest_ / typical_sample_seconds(cheapest_method_) : 1.0;
        return (c.decides_on_specular(scene_) ? typical_specular_pilot_seconds() : 0) +
               kPilotReplicates * kPilotPasses * pixels * slower * typical_sample_seconds(c.name());
    }
    double pixels_of(double pixels) const {
        const auto [width, height] = size_of_pilot(scene_.film(), pixels);
        return double(width) * double(height);
    }

    /// For pilots of the two cheapest contenders.
    bool has_time_for_two(double pixels) const {
        const double each = pixels_of(pixels);
        return budget_.can_spend(cost_of(contenders_[0], each) + cost_of(contenders_[1], each));
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
            if (c.has_chains() && is_beyond_chains()) {
                untried.push_back(c.shown);
                continue;
            }
            const double cost = cost_of(c, each);
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
            if (is_first && !c.has_chains() &&
                (cheapest_ == 0 || c.pilot.pass_seconds < cheapest_ * each)) {
                cheapest_ = c.pilot.pass_seconds / each;
                cheapest_method_ = c.method();
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
        settings.integrator = spec_of(c.in_pilots);
        settings.integrator.guide = c.guide;
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
            c.shown.pixels = width * height;
            c.shown.images = int(p.images.images.size());
            c.shown.sample_seconds = p.pass_seconds / pixels;
            c.shown.start_seconds = start_seconds(c, pixels);
            const double image = double(p.passes_per_image) * p.pass_seconds * ratio;
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
        for (size_t i = 0; i < factors.size(); ++i)
            if (noise[i].kind == Kind::Chains) factors[i] = kLongChains;
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
               (c.guide ? training_seconds(walks_of_training()) : 0);
    }
    /// Whether specular connections of a method with light paths make light that chains hardly find. Pilots of chains that lack
    /// it agree, as if nothing were missing.
    bool is_beyond_chains() const {
        const auto& pilots = shared_by_pilots_->specular;
        return std::any_of(pilots.begin(), pilots.end(), [](const auto& p) {
            return p.first != "path" && p.second.is_beyond_chains();
        });
    }
    /// Whether the method has decided for specular connections.
    bool is_specular(const Contender& c) const {
        const auto pilot = shared_by_pilots_->specular.find(c.name());
        return pilot != shared_by_pilots_->specular.end() && pilot->second.is_worthwhile();
    }

    void drop_hopeless() {
        const double most = kHopeless * contenders_.front().shown.error();
        for (size_t i = contenders_.size(); i-- > 1;) {
            // What a larger film may show at best.
            const double gain = contenders_[i].reuses_light_paths() ? sqr(kMostGainOfReuse) : 1;
            if (contenders_[i].shown.error() <= gain * most) continue;
            dropped_.push_back(contenders_[i].shown);
            contenders_.erase(contenders_.begin() + ptrdiff_t(i));
        }
    }

    /// Whether guides may still help. Their training for the rendering itself must be a small part of it.
    bool may_add_guides() const {
        return !has_tried_guides_ &&
               Budget::is_small(training_seconds(walks_of_training()), budget_.seconds()) &&
               std::any_of(contenders_.begin(), contenders_.end(),
                           [](const Contender& c) { return c.can_have_guide(); });
    }

    /// Trains guides for the contenders that can have one, the best first, as far as there is time for them and for all pilots
    /// on a film of so many pixels. Adds those that `guide=auto` would keep.
    void add_guides(double pixels) {
        if (!may_add_guides()) return;
        const double training = training_seconds(kWalksOfPilot);
        double pilots = cost_of_all(pixels);
        std::vector<Contender> more;
        for (const Contender& c : contenders_) {
            const double guided = guided_factor(true) * cost_of(c, pixels_of(pixels));
            if (!c.can_have_guide() || !budget_.can_spend(training + pilots + guided)) continue;
            has_tried_guides_ = true;
            budget_.spend(training);
            const auto guide = trained_guide(c);
            if (!guide) continue;
            pilots += guided;
            more.push_back(Contender::of(c.method() + ":guide=auto"));
            more.back().in_pilots = c.method() + ":guide=on";
            more.back().guide = guide;
            more.back().unguided = c.method();
            more.back().prepared_seconds = c.prepared_seconds;
        }
        contenders_.insert(contenders_.end(), more.begin(), more.end());
    }

    /// nullptr if it would not be kept.
    std::shared_ptr<const Guide> trained_guide(const Contender& c) {
        IntegratorSpec spec = spec_of(c.method());
        spec.params["guide_walks"] = std::to_string(kWalksOfPilot);
        try {
            const LearnedGuide learned(scene_, spec,
                                       pilot_seed(settings_.seed, PilotUse::Choice, number_++),
                                       settings_.threads);
            if (drop_.load()) throw PassDropped();
            if (learned.is_kept_by_auto()) return std::make_shared<const Guide>(learned.guide());
        } catch (const NothingToLearn&) {
        }
        return nullptr;
    }

    const Scene& scene_;
    const std::atomic<bool>& drop_;
    RenderSettings settings_;
    IntegratorParams asked_;
    Budget budget_;
    std::vector<Contender> contenders_;  ///< The best first, once there are pilots.
    std::vector<MethodChoice::Candidate> dropped_, untried_;
    double cheapest_ = 0;  ///< Simulated seconds of a sample of the cheapest contender so far.
    std::string cheapest_method_;
    double pixels_before_ = 0;  ///< Of the film of the last pilots.
    uint64_t number_ = 0;       ///< Of the next pilot.
    bool has_tried_guides_ = false;
    const std::shared_ptr<SharedByPilots> shared_by_pilots_ = std::make_shared<SharedByPilots>();
};

}  // namespace

RenderSettings with_chosen_method(const Scene& scene, const RenderSettings& settings,
                                  const std::atomic<bool>& drop) {
    if (!is_auto(settings.integrator)) return settings;
    RenderSettings chosen = settings;
    const auto choice =
        std::make_shared<const MethodChoice>(Choosing(scene, settings, drop).choose());
    chosen.integrator = IntegratorSpec::parse(choice->chosen);
    chosen.choice = choice;
    return chosen;
}

RenderSettings with_chosen_method(const RenderSettings& settings, const MethodChoice& earlier) {
    if (!is_auto(settings.integrator)) return settings;
    if (const std::string asked = as_utf8(with_all_params(settings.integrator));
        asked != as_utf8(earlier.asked))
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
