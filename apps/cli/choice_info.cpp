#include "choice_info.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "integrator/auto.h"
#include "number_checks.h"
#include "render/method_choice.h"
#include "usage_error.h"

namespace etendue {

void ChoiceInfo::add_to(CLI::App& command) {
    CLI::Option* choice = command.add_flag(
        "--choice", is_wanted,
        "Run the pilots of auto, or of a method with guide=auto, and print what they say of each "
        "candidate");
    command.add_option("--spp", limits.spp, "Choose for a rendering of so many samples per pixel")
        ->check(must_be_above_0)
        ->needs(choice);
    command.add_option("--time", limits.seconds, "Choose for a rendering of so many seconds")
        ->check(must_be_above_0)
        ->needs(choice);
    command.add_option("--error", limits.error, "Choose for a rendering until this relative error")
        ->check(must_be_above_0)
        ->needs(choice);
}

void ChoiceInfo::check(const std::string& integrator) const {
    if (is_wanted && !integrator.empty() && !is_chosen_by_pilots(IntegratorSpec::parse(integrator)))
        throw UsageError(fmt::format(
            "--choice shows what pilots choose: -i must be auto, or a method with guide=auto, "
            "but is {}",
            integrator));
}

nlohmann::json ChoiceInfo::run(const Scene& scene, const std::string& integrator, uint64_t seed,
                               int threads) const {
    RenderRequest request;
    static_cast<RenderLimits&>(request) = limits;
    set_default_limit(request, scene);
    request.integrator = integrator.empty() ? auto_entry().info.name : integrator;
    request.seed = seed;
    request.threads = threads;
    const RenderSettings settings = settings_of(request, scene);
    return nlohmann::json::parse(with_chosen_method(scene, settings).choice->to_text());
}

std::string choice_text(const nlohmann::json& j) {
    const MethodChoice choice = MethodChoice::from_json(j.dump());
    std::string text = fmt::format(
        "  choice      {}\n"
        "    for {:.4g} s of one thread, by pilots of {:.3g} s ({:.1f} %), in {:.1f} s\n"
        "    method                   pixels  \u00b5s/sample   start, s      noise    missing"
        "      error\n",
        choice.chosen, choice.budget, choice.pilots, 100 * choice.pilots / choice.budget,
        choice.seconds);
    for (const MethodChoice::Candidate& c : choice.candidates) {
        text += fmt::format("    {:<22}", c.method);
        text += c.images > 0 ? fmt::format("{:9}  {:9.3g}  {:9.3g}  {:9.3g}  {:9.3g}  {:9.3g}\n",
                                           c.pixels, 1e6 * c.sample_seconds, c.start_seconds,
                                           c.noise, c.missing, c.error())
                             : "   no pilot\n";
    }
    return text;
}

}  // namespace etendue
