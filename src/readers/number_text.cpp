#include "readers/number_text.h"

#include <algorithm>
#include <cstdint>

namespace etendue {

bool is_too_small(std::string_view digits) {
    if (digits.starts_with('-')) digits.remove_prefix(1);
    const size_t e = std::min(digits.find_first_of("eE"), digits.size());
    const std::string_view mantissa = digits.substr(0, e);
    const size_t first = mantissa.find_first_of("123456789");
    if (first == mantissa.npos) return true;
    // The number is in [0.1, 1) times ten to the power of these two.
    const auto point = int64_t(std::min(mantissa.find('.'), mantissa.size()));
    const int64_t before_point = point - int64_t(first) + (point < int64_t(first) ? 1 : 0);
    std::string_view power = digits.substr(std::min(e + 1, digits.size()));
    if (power.starts_with('+')) power.remove_prefix(1);
    int64_t exponent = 0;
    const auto result = std::from_chars(power.data(), power.data() + power.size(), exponent);
    if (result.ec == std::errc::result_out_of_range) return power.starts_with('-');
    return before_point < -exponent;
}

}  // namespace etendue
