// The choice of a method as text.

#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render/method_choice.h"

namespace etendue {

std::string MethodChoice::message() const {
    const char* const by = asked.starts_with("auto") || asked.empty() ? "auto" : "guide=auto";
    if (candidates.empty() || candidates.front().images == 0)
        return pilots > 0
                   ? fmt::format("{}: {}, since pilots would take too much of the time (those "
                                 "that were stopped: {:.1f} s)",
                                 by, chosen, seconds)
                   : fmt::format("{}: {}, without pilots, which would take too much of the time",
                                 by, chosen);
    std::string text = fmt::format("{}: {}", by, chosen);
    // Errors on other films are not comparable, and a black film has none.
    if (candidates.size() > 1 && candidates[1].pixels == candidates[0].pixels &&
        candidates[1].error() > 0)
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

std::string MethodChoice::to_text() const {
    return to_json().dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
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
