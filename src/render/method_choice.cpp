#include "render/method_choice.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "integrator/auto.h"
#include "render/cost_table.h"
#include "render/learned_guide.h"
#include "render/pilot_score.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

using Clock = std::chrono::steady_clock;

/// The largest part of a rendering that pilots may take, by simulated time.
constexpr double kShare = 0.08;
/// Pixels of the first film of pilots, and of the largest one. From one to the next, there are kGrowth times as many, so
/// that the last pilots take most of the time.
constexpr double kFirstPixels = 768, kMostPixels = 49152, kGrowth = 4;
/// Candidates with a larger error, relative to the best, take no part in the next pilots.
constexpr double kHopeless = 3;
/// The more light paths there are in a pass, the more of them gathers and merges find: with four times as many, their noise
/// is at most so many times smaller.
constexpr double kMostGainOfReuse = 2;
/// Chains of pilots are short, and see less of where chains stay. On veach-ajar, veach-bidir and two-rooms, the errors of `mlt`
/// after 60 s are 0.6 to 3 times those predicted without this factor.
constexpr double kLongChains = 1.5;
/// Independent renderings of a candidate on each film, and the passes of each.
constexpr int kReplicates = 3, kPasses = 4;
/// Simulated seconds that a rendering without limits is taken to have.
constexpr double kUnlimitedSeconds = 60;

const char* const kWithoutPilots = "bdpt";

/// A method and how pilots render it.
struct Contender {
    std::string method;  ///< Without the parameters of `auto`.
    std::string pilot;   ///< The same with parameters for short runs.
    std::shared_ptr<const Guide> guide = nullptr;
    double start_a_pixel = 0;  ///< Simulated seconds of what the last pilot made once.
    double image_noise = 0;    ///< Of one image of the last pilot; 0: there was none.

    /// Whether eye paths meet the light paths of all pixels, of which there are few in pilots.
    bool reuses_light_paths() const { return method.starts_with("upg") || method == "vcm"; }
};

/// In the order in which they are tried: the cheapest first.
std::vector<Contender> contenders(const Scene& scene, const IntegratorParams& asked, int ranks) {
    // Chains have few states in pilots, and need as many for each as in the rendering. Of the groups, two suffice.
    constexpr const char* kChains = ":groups=2,chains=16";
    constexpr int kShortestOfChains = 3;
    const int max_depth = asked.integer("max_depth");
    std::vector<Contender> all;
    // What light of emitters without extent reaches by way of mirrors and glass, eye paths never find.
    if (!scene.has_delta_emitters()) all.push_back({"path", "path"});
    for (const char* name : {"bdpt", "pcbpt", "upg+bdpt"}) all.push_back({name, name});
    if (asked.flag("consistent")) all.push_back({"vcm", "vcm"});
    if (asked.flag("chains") && ranks == 1 && (max_depth < 0 || max_depth >= kShortestOfChains))
        for (const std::string name : {"mlt", "mmlt"}) all.push_back({name, name + kChains});
    return all;
}

/// A spec with the parameters of `auto` that the method has, too.
IntegratorSpec spec_of(const std::string& method, const IntegratorParams& asked) {
    IntegratorSpec spec = IntegratorSpec::parse(method);
    if (asked.integer("max_depth") != -1) spec.params["max_depth"] = asked.string("max_depth");
    if (spec.name == "mlt" && !asked.string("user_paths").empty())
        spec.params["user_paths"] = asked.string("user_paths");
    return spec;
}

/// The film of pilots: of the shape of the whole one, but with so many pixels.
std::pair<int, int> size_of_pilot(const FilmGeometry& film, double pixels) {
    const double scale = std::sqrt(std::min(1.0, pixels / double(film.pixel_count())));
    const auto side = [&](int whole) {
        return std::clamp(int(std::lround(scale * whole)), 1, whole);
    };
    return {side(film.crop_width), side(film.crop_height)};
}

/// What pilots of one candidate on one film have shown.
struct Pilot {
    PilotImages images;
    bool has_chains = false;
    int passes_per_image = 1;
    double pass_seconds = 0;   ///< Simulated.
    double start_seconds = 0;  ///< Simulated, of what was made once.
    double all_seconds = 0;    ///< Simulated, of all of it.
};

/// Grey values of the sums of a film.
std::vector<float> grey(const Film& film) {
    std::vector<float> values;
    values.reserve(film.moments().size());
    for (const Film::Moments& m : film.moments())
        values.push_back(float((m.sum[0] + m.sum[1] + m.sum[2]) / 3));
    return values;
}

/// Of chains, for each pixel and pass.
double mutations_of(const Renderer& renderer) {
    for (const auto& [name, value] : renderer.integrator().figures())
        if (name == "mutations_per_pixel") return value;
    return 1;
}

/// One rendering of a pilot. `number`: of those of this choice.
void add_replicate(const Scene& small, RenderSettings settings, uint64_t number, Pilot& pilot) {
    settings.seed = pilot_seed(settings.seed, PilotUse::Choice, number);
    Renderer renderer(small, settings);
    const std::string& name = settings.integrator.name;
    const int groups = renderer.integrator().error_groups();
    const bool has_chains = groups > 0, is_learning = renderer.integrator().is_learning();
    // What methods learn, they learn before the first pass and after it. Chains begin in the first pass of their group.
    const uint64_t first = is_learning ? 1 : 0, costs_from = has_chains ? uint64_t(groups) : first;
    pilot.passes_per_image = has_chains ? kPasses / groups : 1;
    std::vector<std::vector<float>> images(has_chains ? size_t(groups) : 0);
    std::vector<float> before;
    double seconds = 0, first_seconds = 0;
    settings.spp = kPasses;
    const std::atomic<bool> never{false};
    renderer.run(
        settings,
        [&](const Progress& p) {
            std::vector<float> sum = grey(renderer.film()), image = sum;
            if (!before.empty())
                for (size_t i = 0; i < image.size(); ++i) image[i] -= before[i];
            before = std::move(sum);
            const uint64_t pass = p.passes - 1;
            seconds = simulated_seconds(name, renderer.stats());
            if (p.passes == costs_from) first_seconds = seconds;
            if (!has_chains) {
                if (pass >= first) images.push_back(std::move(image));
                return;
            }
            std::vector<float>& of_group = images[pass % uint64_t(groups)];
            of_group.resize(image.size());
            for (size_t i = 0; i < image.size(); ++i)
                of_group[i] += image[i] / float(pilot.passes_per_image);
        },
        never);
    for (auto& image : images) pilot.images.images.push_back(std::move(image));
    pilot.has_chains = has_chains;
    if (has_chains)
        pilot.images.least_variance = 1 / (mutations_of(renderer) * pilot.passes_per_image);
    const double pass = (seconds - first_seconds) / double(kPasses - costs_from);
    pilot.pass_seconds += pass / kReplicates;
    if (has_chains)
        pilot.start_seconds +=
            std::max(0.0, first_seconds - double(costs_from) * pass) / kReplicates;
    pilot.all_seconds += seconds;
}

class Choosing {
public:
    Choosing(const Scene& scene, const RenderSettings& settings)
        : scene_(scene), settings_(settings), asked_(settings.integrator, auto_entry().info),
          contenders_(contenders(scene, asked_, settings.ranks->count())) {
        settings_.choice = nullptr;
        settings_.first_pass = 0;
        settings_.technique_depth = 0;
        settings_.observer = nullptr;
        settings_.meanwhile = {};
        settings_.ranks = &kAlone;
        static_cast<RenderLimits&>(settings_) = {};
        limits_ = settings;
    }

    MethodChoice choose() {
        const auto begin = Clock::now();
        MethodChoice choice;
        choice.asked = with_all_params(settings_.integrator);
        budget_ = budget(typical_sample_seconds("path"));
        std::vector<MethodChoice::Candidate> out;
        for (double pixels = kFirstPixels; pixels <= kMostPixels; pixels *= kGrowth) {
            const bool is_first = pixels == kFirstPixels;
            if (!is_first && pixels > double(scene_.film().pixel_count())) break;
            if (contenders_.size() < 2 || !try_all(pixels, is_first)) break;
            drop_hopeless(out);
        }
        choice.candidates = candidates_;
        choice.candidates.insert(choice.candidates.end(), out.rbegin(), out.rend());
        // Those of which there was no pilot.
        for (const Contender& c : contenders_)
            if (std::none_of(choice.candidates.begin(), choice.candidates.end(),
                             [&](const auto& k) { return k.method == c.method; }))
                choice.candidates.push_back({.method = c.method});
        const std::string best = candidates_.empty() ? kWithoutPilots : candidates_.front().method;
        std::stable_partition(choice.candidates.begin(), choice.candidates.end(),
                              [&](const auto& k) { return k.method == best; });
        choice.chosen = spec_of(best, asked_).to_string();
        choice.budget = budget_;
        choice.pilots = spent_;
        choice.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
        return choice;
    }

    static std::string with_all_params(IntegratorSpec spec) {
        for (const ParamInfo& p : auto_entry().info.params)
            if (*p.fallback) spec.params.emplace(p.name, p.fallback);
        return spec.to_string();
    }

private:
    double whole_pixels() const { return double(scene_.film().pixel_count()); }

    /// Simulated seconds of the rendering, if a sample of the cheapest method takes so many.
    double budget(double sample_seconds) const {
        double seconds = std::numeric_limits<double>::infinity();
        if (limits_.spp) seconds = double(*limits_.spp) * whole_pixels() * sample_seconds;
        if (limits_.seconds) seconds = std::min(seconds, *limits_.seconds);
        if (limits_.error) seconds = std::min(seconds, error_seconds_);
        return std::isfinite(seconds) ? seconds : kUnlimitedSeconds;
    }
    bool can_spend(double seconds) const { return spent_ + seconds <= kShare * budget_; }

    /// Pilots of all contenders on a film of so many pixels. Returns false, and leaves the candidates as they were, if there
    /// is no time for all of them; at first there need only be time for two.
    bool try_all(double pixels, bool is_first) {
        const std::pair<int, int> size = size_of_pilot(scene_.film(), pixels);
        const int width = size.first, height = size.second;
        const double passes = double(kReplicates * kPasses) * width * height;
        const auto cost_of = [&](const Contender& c) {
            for (const auto& k : candidates_)
                if (k.method == c.method)
                    return passes * k.sample_seconds +
                           kReplicates * c.start_a_pixel * width * height;
            // Of the cheapest method it is known what a sample takes in this scene.
            const double slower =
                cheapest_ > 0 ? cheapest_ / typical_sample_seconds(cheapest_method_) : 1.0;
            return passes * slower * typical_sample_seconds(IntegratorSpec::parse(c.method).name);
        };
        if (is_first) {
            if (!can_spend(cost_of(contenders_[0]) + cost_of(contenders_[1]))) return false;
        } else {
            double all = 0;
            for (const Contender& c : contenders_) all += cost_of(c);
            if (!can_spend(all)) return false;
            add_guides();
        }
        const Scene small = scene_.seen_by_film(width, height);
        std::vector<Contender> tried;
        std::vector<Pilot> pilots;
        for (const Contender& c : contenders_) {
            if (tried.size() >= 2 && is_first && !can_spend(cost_of(c))) continue;
            pilots.push_back(pilot_of(small, c));
            tried.push_back(c);
            if (cheapest_ == 0) {
                cheapest_ = pilots.back().pass_seconds / (double(width) * double(height));
                cheapest_method_ = c.method;
                budget_ = budget(cheapest_);
            }
        }
        contenders_ = std::move(tried);
        judge(pilots, width, height);
        return true;
    }

    Pilot pilot_of(const Scene& small, const Contender& c) {
        Pilot pilot;
        RenderSettings settings = settings_;
        settings.integrator = spec_of(c.pilot, asked_);
        settings.integrator.guide = c.guide;
        for (int r = 0; r < kReplicates; ++r) add_replicate(small, settings, number_++, pilot);
        spent_ += pilot.all_seconds;
        return pilot;
    }

    /// Scores pilots of the contenders, and puts the candidates in order.
    void judge(std::vector<Pilot>& pilots, int width, int height) {
        const double ratio = whole_pixels() / (double(width) * double(height));
        std::vector<MethodChoice::Candidate> found;
        const auto set_horizons = [&] {
            found.clear();
            for (size_t i = 0; i < pilots.size(); ++i) {
                Pilot& p = pilots[i];
                MethodChoice::Candidate c{.method = contenders_[i].method,
                                          .pixels = width * height,
                                          .images = int(p.images.images.size())};
                c.sample_seconds = p.pass_seconds / (double(width) * double(height));
                c.start_seconds = start_seconds(contenders_[i], p, width * height);
                contenders_[i].start_a_pixel = p.start_seconds / (double(width) * double(height));
                const double image = double(p.passes_per_image) * p.pass_seconds * ratio;
                // If there is no time left after the start, the method is hopeless.
                p.images.horizon =
                    std::max(0.01, (budget_ - c.start_seconds) / std::max(image, 1e-12));
                p.images.pixels_in_one = p.has_chains ? ratio : 1;
                found.push_back(c);
            }
        };
        const auto score = [&] {
            set_horizons();
            std::vector<PilotImages> images;
            for (const Pilot& p : pilots) images.push_back(p.images);
            const std::vector<PilotScore> scores = score_pilots(images, width, height);
            for (size_t i = 0; i < found.size(); ++i)
                found[i].noise = scores[i].noise, found[i].missing = scores[i].missing;
        };
        score();
        // How much less noise there is than on the last film. What methods without reuse gain, too, is the variation within
        // pixels; the further gain goes on to the film of the rendering.
        std::vector<double> gains(found.size(), 1.0);
        double of_others = 0;
        for (size_t i = 0; i < found.size(); ++i) {
            Contender& c = contenders_[i];
            const double now = found[i].noise * pilots[i].images.horizon;
            if (c.image_noise > 0 && now > 0) gains[i] = c.image_noise / now;
            c.image_noise = now;
            if (!c.reuses_light_paths() && !pilots[i].has_chains)
                of_others = std::max(of_others, gains[i]);
        }
        for (size_t i = 0; i < found.size(); ++i) {
            const bool counts = contenders_[i].reuses_light_paths() && of_others > 0;
            const double gain = counts ? gains[i] / of_others : 1;
            gains[i] = pilots[i].has_chains ? kLongChains
                                            : std::pow(std::clamp(gain, 1.0, kMostGainOfReuse),
                                                       -std::log(ratio) / std::log(kGrowth));
        }
        const auto apply_gains = [&] {
            for (size_t i = 0; i < found.size(); ++i) found[i].noise *= gains[i];
        };
        apply_gains();
        if (limits_.error) {
            // The time in which the best one reaches the error; no more than that can be saved.
            error_seconds_ = std::numeric_limits<double>::infinity();
            for (const auto& c : found) {
                const double renderings = c.error() / (*limits_.error * *limits_.error);
                error_seconds_ = std::min(error_seconds_, c.start_seconds + renderings * budget_);
            }
            budget_ = budget(cheapest_);
            score();
            apply_gains();
        }
        std::vector<size_t> order(found.size());
        for (size_t i = 0; i < order.size(); ++i) order[i] = i;
        // Of equal ones, the cheaper one.
        std::stable_sort(order.begin(), order.end(),
                         [&](size_t a, size_t b) { return found[a].error() < found[b].error(); });
        std::vector<Contender> sorted;
        candidates_.clear();
        for (const size_t i : order) {
            sorted.push_back(contenders_[i]);
            candidates_.push_back(found[i]);
        }
        contenders_ = std::move(sorted);
    }

    /// Of what is made once before the passes of the whole rendering.
    double start_seconds(const Contender& c, const Pilot& p, int pixels) const {
        // Chains begin with samples, one or two for each pixel; see run_pilot().
        constexpr double kMostSamples = 1 << 17;
        const double chains =
            p.start_seconds * std::max(1.0, std::min(whole_pixels(), kMostSamples) / pixels);
        return chains + (c.guide ? training_seconds(kWalksOfTraining) : 0);
    }

    void drop_hopeless(std::vector<MethodChoice::Candidate>& out) {
        const double most = kHopeless * candidates_.front().error();
        for (size_t i = candidates_.size(); i-- > 1;) {
            // What a larger film may show at best.
            const double gain = contenders_[i].reuses_light_paths() ? sqr(kMostGainOfReuse) : 1;
            if (candidates_[i].error() <= gain * most) continue;
            out.push_back(candidates_[i]);
            candidates_.erase(candidates_.begin() + ptrdiff_t(i));
            contenders_.erase(contenders_.begin() + ptrdiff_t(i));
        }
    }

    /// Trains guides for the contenders that can have one, and adds those that `guide=auto` would keep.
    void add_guides() {
        constexpr uint64_t kWalks = 16384;
        if (has_guides_ || !can_spend(2 * training_seconds(kWalks))) return;
        // The training of the rendering itself must be a small part of it.
        if (training_seconds(kWalksOfTraining) > kShare * budget_) return;
        has_guides_ = true;
        std::vector<Contender> more;
        for (const Contender& c : contenders_) {
            const std::vector<ParamInfo>& params =
                integrator_entry(IntegratorSpec::parse(c.method).name).info.params;
            const bool has_guide =
                std::any_of(params.begin(), params.end(),
                            [](const ParamInfo& p) { return std::string_view(p.name) == "guide"; });
            if (!has_guide || !can_spend(training_seconds(kWalks))) continue;
            IntegratorSpec spec = spec_of(c.method, asked_);
            spec.params["guide_walks"] = std::to_string(kWalks);
            spent_ += training_seconds(kWalks);
            try {
                const LearnedGuide learned(scene_, spec,
                                           pilot_seed(settings_.seed, PilotUse::Choice, number_++),
                                           settings_.threads);
                if (!learned.is_kept_by_auto()) continue;
                more.push_back({c.method + ":guide=auto", c.method + ":guide=on",
                                std::make_shared<const Guide>(learned.guide())});
            } catch (const std::runtime_error&) {
                // There is nothing to learn.
            }
        }
        contenders_.insert(contenders_.end(), more.begin(), more.end());
    }

    static constexpr uint64_t kWalksOfTraining = 100000;

    const Scene& scene_;
    RenderSettings settings_;
    IntegratorParams asked_;
    RenderLimits limits_;
    std::vector<Contender> contenders_;  ///< In the order of the candidates, once there are any.
    std::vector<MethodChoice::Candidate> candidates_;
    double budget_ = 0, spent_ = 0;
    double error_seconds_ = std::numeric_limits<double>::infinity();
    double cheapest_ = 0;  ///< Simulated seconds of a sample of the first contender.
    std::string cheapest_method_;
    uint64_t number_ = 0;  ///< Of the next pilot.
    bool has_guides_ = false;
};

}  // namespace

RenderSettings with_chosen_method(const Scene& scene, const RenderSettings& settings) {
    if (!is_auto(settings.integrator)) return settings;
    RenderSettings chosen = settings;
    const auto choice = std::make_shared<const MethodChoice>(Choosing(scene, settings).choose());
    chosen.integrator = IntegratorSpec::parse(choice->chosen);
    chosen.choice = choice;
    return chosen;
}

RenderSettings with_chosen_method(const RenderSettings& settings, const MethodChoice& earlier) {
    if (!is_auto(settings.integrator)) return settings;
    if (const std::string asked = Choosing::with_all_params(settings.integrator);
        asked != earlier.asked)
        throw std::runtime_error(fmt::format(
            "the method was chosen by \"{}\" there, but it is to be chosen by \"{}\" here",
            earlier.asked, asked));
    RenderSettings chosen = settings;
    chosen.integrator = IntegratorSpec::parse(earlier.chosen);
    chosen.choice = std::make_shared<const MethodChoice>(earlier);
    return chosen;
}

std::string MethodChoice::message() const {
    if (candidates.empty() || candidates.front().images == 0)
        return fmt::format("auto: {}, without pilots, which would take too much of the time",
                           chosen);
    std::string text = fmt::format("auto: {}", chosen);
    if (candidates.size() > 1 && candidates[1].images > 0)
        text += fmt::format(", predicted to need {:.2g} of the time of {}",
                            candidates[0].error() / candidates[1].error(), candidates[1].method);
    return text + fmt::format(" (pilots: {:.1f} s)", seconds);
}

nlohmann::ordered_json MethodChoice::to_json() const {
    auto list = nlohmann::ordered_json::array();
    for (const Candidate& c : candidates)
        list.push_back({{"method", c.method},
                        {"pixels", c.pixels},
                        {"images", c.images},
                        {"sample_seconds", c.sample_seconds},
                        {"start_seconds", c.start_seconds},
                        {"noise", c.noise},
                        {"missing", c.missing}});
    return {{"asked", asked},   {"chosen", chosen},   {"budget", budget},
            {"pilots", pilots}, {"seconds", seconds}, {"candidates", list}};
}

MethodChoice MethodChoice::from_json(const std::string& text) try {
    const auto j = nlohmann::json::parse(text);
    MethodChoice c;
    c.asked = j.at("asked").get<std::string>();
    c.chosen = j.at("chosen").get<std::string>();
    c.budget = j.at("budget").get<double>();
    c.pilots = j.at("pilots").get<double>();
    c.seconds = j.at("seconds").get<double>();
    for (const auto& k : j.at("candidates"))
        c.candidates.push_back({.method = k.at("method").get<std::string>(),
                                .pixels = k.at("pixels").get<int>(),
                                .images = k.at("images").get<int>(),
                                .sample_seconds = k.at("sample_seconds").get<double>(),
                                .start_seconds = k.at("start_seconds").get<double>(),
                                .noise = k.at("noise").get<double>(),
                                .missing = k.at("missing").get<double>()});
    return c;
} catch (const nlohmann::json::exception&) {
    throw std::runtime_error("the description of the choice of the method is damaged");
}

}  // namespace etendue
