#pragma once
// Numbers in the text of scene and mesh files.

#include <charconv>
#include <concepts>
#include <limits>
#include <string_view>

namespace etendue {

/// Whether a number that is out of the range of its type is too small, not too large. `digits`: as std::from_chars() reads it.
bool is_too_small(std::string_view digits);

/// std::from_chars(), but a number that is too small for its type becomes zero, and one that is too large for a float is
/// out of range, however large it may be.
template <class T>
std::from_chars_result parse_digits(const char* begin, const char* end, T& value) {
    if constexpr (std::floating_point<T>) {
        double exact = 0;
        std::from_chars_result result = std::from_chars(begin, end, exact);
        if (result.ec == std::errc::result_out_of_range &&
            is_too_small({begin, size_t(result.ptr - begin)}))
            result.ec = {};
        const T narrow = T(exact);
        if (result.ec == std::errc() && narrow - narrow != 0 && exact - exact == 0)
            result.ec = std::errc::result_out_of_range;
        value = narrow;
        return result;
    } else {
        return std::from_chars(begin, end, value);
    }
}

}  // namespace etendue
