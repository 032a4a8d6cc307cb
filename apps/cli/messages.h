#pragma once
// What the program prints to standard error.

#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "system/failure.h"

namespace etendue {

/// Prints to standard error. A closed terminal or a full disk there changes nothing: a rendering is worth more than
/// messages about it.
template <class... T>
void message(fmt::format_string<T...> format, T&&... arguments) noexcept {
    try {
        const std::string text = fmt::format(format, std::forward<T>(arguments)...);
        std::fwrite(text.data(), 1, text.size(), stderr);
        std::fflush(stderr);
    } catch (const std::exception&) {
    }
}

/// Prints what the exception says that is being handled, as the reason why the program ends.
inline void print_failure() noexcept {
    message("etendue: {}\n", caught());
}

inline void print_warnings(const std::vector<std::string>& warnings) noexcept {
    for (const std::string& w : warnings) message("warning: {}\n", w);
}

}  // namespace etendue
