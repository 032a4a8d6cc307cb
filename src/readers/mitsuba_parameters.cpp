#include "readers/mitsuba_parameters.h"

#include <cctype>

#include <fmt/format.h>

#include "readers/mitsuba_values.h"

namespace etendue {
namespace {

/// Limit on the total length of all substituted values: each default may contain others, so it could grow
/// exponentially.
constexpr size_t kMostSubstituted = size_t(16) << 20;

bool is_name_character(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
}

}  // namespace

SceneParameters::SceneParameters(const std::map<std::string, std::string>& overrides) {
    for (const auto& [name, value] : overrides) parameters_[name] = {value, true, false};
}

void SceneParameters::declare(const std::string& name, const std::string& value) {
    const auto [it, inserted] = parameters_.try_emplace(name, Parameter{value});
    it->second.known = true;
}

std::string SceneParameters::substitute(std::string_view text, const SourceLocation& where) {
    std::string result;
    for (size_t i = 0; i < text.size();) {
        if (text.substr(i, 2) == "\\$") {
            result += '$';
            i += 2;
        } else if (text[i] != '$') {
            result += text[i++];
        } else {
            size_t end = i + 1;
            while (end < text.size() && is_name_character(text[end])) ++end;
            const std::string_view name = text.substr(i + 1, end - i - 1);
            const auto it = parameters_.find(name);
            if (it == parameters_.end())
                throw SceneError(where, fmt::format("undefined parameter ${}{}", name,
                                                    hint(name, known_names())));
            it->second.known = true;
            substituted_ += it->second.value.size();
            if (substituted_ > kMostSubstituted)
                throw SceneError(where, fmt::format("parameters expand to more than {} characters",
                                                    kMostSubstituted));
            result += it->second.value;
            i = end;
        }
    }
    return result;
}

void SceneParameters::check_overrides(const std::string& scene_file) const {
    for (const auto& [name, parameter] : parameters_)
        if (parameter.overridden && !parameter.known)
            throw SceneError({scene_file, 0},
                             fmt::format("the scene has no parameter {} to set to {}{}",
                                         quote(name), quote(parameter.value),
                                         hint(name, known_names())));
}

std::vector<std::string> SceneParameters::known_names() const {
    std::vector<std::string> names;
    for (const auto& [name, parameter] : parameters_)
        if (parameter.known) names.push_back(name);
    return names;
}

}  // namespace etendue
