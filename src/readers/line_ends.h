#pragma once
// Lines of text files end with \n, with \r\n, or, in old files, with \r alone.

#include <algorithm>
#include <string_view>

namespace etendue {

/// Whether a line ends with the character at `at`, which is not `end`; of \r\n it is the second.
inline bool ends_line(const char* at, const char* end) {
    return *at == '\n' || (*at == '\r' && (at + 1 == end || at[1] != '\n'));
}

/// The first line of `text`, which is cut off it.
inline std::string_view take_line(std::string_view& text) {
    const char *begin = text.data(), *end = begin + text.size(), *at = begin;
    while (at != end && !ends_line(at, end)) ++at;
    const std::string_view line(begin, size_t(at - begin));
    text.remove_prefix(line.size() + (at != end ? 1 : 0));
    return line;
}

/// Number of the line in which the character `offset` of `text` stands, from 1.
inline int line_of(std::string_view text, size_t offset) {
    int line = 1;
    const char* const end = text.data() + text.size();
    for (const char* at = text.data(); at != text.data() + std::min(offset, text.size()); ++at)
        line += ends_line(at, end);
    return line;
}

}  // namespace etendue
