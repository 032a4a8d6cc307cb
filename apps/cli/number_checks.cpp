#include "number_checks.h"

#include <charconv>
#include <cmath>
#include <optional>

#include <fmt/format.h>

namespace etendue {
namespace {

/// The value of `text` where all of it is one finite number, independent of the locale.
std::optional<double> number(const std::string& text) {
    double value = 0;
    const char* end = text.data() + text.size();
    const auto [last, error] = std::from_chars(text.data(), end, value);
    if (error != std::errc() || last != end || !std::isfinite(value)) return {};
    return value;
}

}  // namespace

std::string must_be_above_0(const std::string& text) {
    const auto value = number(text);
    return value && *value > 0 ? "" : fmt::format("must be a number above 0, but is \"{}\"", text);
}

std::string must_be_at_least_0(const std::string& text) {
    const auto value = number(text);
    return value && *value >= 0
               ? ""
               : fmt::format("must be a number of at least 0, but is \"{}\"", text);
}

CLI::Validator must_be_within(double low, double high) {
    // Its text in the help.
    CLI::Validator validator = CLI::Range(low, high);
    validator.operation([low, high](std::string& text) {
        const auto value = number(text);
        return value && *value >= low && *value <= high
                   ? std::string()
                   : fmt::format("must be a number from {} to {}, but is \"{}\"", low, high, text);
    });
    return validator;
}

std::string must_be_unsigned(const std::string& text) {
    uint64_t value = 0;
    const char* const end = text.data() + text.size();
    const auto [last, error] = std::from_chars(text.data(), end, value);
    return error == std::errc() && last == end
               ? ""
               : fmt::format("must be an integer of at least 0, but is \"{}\"", text);
}

}  // namespace etendue
