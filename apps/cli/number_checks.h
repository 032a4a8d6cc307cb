#pragma once
// Checks of numbers on the command line, with messages that name the limit alone; a number must be finite.

#include <string>

namespace etendue {

/// For CLI::Option::check(): empty where `text` is a finite number above 0, or at least 0; else what it must be.
std::string must_be_above_0(const std::string& text);
std::string must_be_at_least_0(const std::string& text);

}  // namespace etendue
