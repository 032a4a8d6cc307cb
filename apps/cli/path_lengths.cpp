#include "path_lengths.h"
#include "usage_error.h"

#include <charconv>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

namespace etendue {
namespace {

/// Whether all of `text` is one integer, which is then stored in `number`.
bool read_number(std::string_view text, int& number) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

PathSelection parse_lengths(const std::string& text, int most) {
    const bool may_be_open = most == PathSelection::kNoLimit;
    const std::string_view all(text);
    const size_t dots = all.find("..");
    PathSelection lengths;
    if (dots != all.npos && read_number(all.substr(0, dots), lengths.shortest)) {
        const std::string_view last = all.substr(dots + 2);
        const bool is_read = (last.empty() && may_be_open) || read_number(last, lengths.longest);
        if (is_read && lengths.shortest >= 1 && lengths.longest >= lengths.shortest &&
            lengths.longest <= most)
            return lengths;
    }
    throw UsageError(
        fmt::format("--lengths must have the form {}, but is \"{}\"",
                    may_be_open ? "2..8, or 2.." : fmt::format("2..8, within 1..{}", most), text));
}

}  // namespace etendue
