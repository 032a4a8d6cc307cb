#pragma once
// Checks of numbers on the command line. Numbers must be finite; messages state the lower limit only.

#include <string>

#include <CLI/CLI.hpp>

namespace etendue {

/// For CLI::Option::check(): empty where `text` is a finite number above 0 (or of at least 0), otherwise the error
/// message.
std::string must_be_above_0(const std::string& text);
std::string must_be_at_least_0(const std::string& text);

/// For options of type double. CLI::Range lets NaN pass.
CLI::Validator must_be_within(double low, double high);
/// For unsigned options, whose negative values CLI11 turns into large ones.
std::string must_be_unsigned(const std::string& text);

}  // namespace etendue
