#include "description/json_text.h"

#include <algorithm>

#include <fmt/format.h>

#include "description/source_location.h"

namespace etendue {
namespace {

using nlohmann::json;

int line_at(std::string_view text, size_t at) {
    return 1 +
           int(std::count(text.begin(), text.begin() + ptrdiff_t(std::min(at, text.size())), '\n'));
}

/// Looks at brackets only; what is wrong otherwise is found by the parser.
void check_depth(std::string_view text, const std::string& file) {
    int depth = 0;
    bool in_string = false;
    for (size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (in_string) {
            if (c == '\\')
                ++i;
            else if (c == '"')
                in_string = false;
        } else if (c == '"') {
            in_string = true;
        } else if (c == '[' || c == '{') {
            if (++depth > kDeepestJson)
                throw SceneError({file, line_at(text, i)},
                                 fmt::format("values are nested more than {} deep", kDeepestJson));
        } else if (c == ']' || c == '}') {
            --depth;
        }
    }
}

bool is_utf16(std::string_view text) {
    const std::string_view mark = text.substr(0, 2);
    return mark == "\xff\xfe" || mark == "\xfe\xff" ||
           (text.size() > 1 && (text[0] == '\0') != (text[1] == '\0'));
}

}  // namespace

json parse_json(std::string_view text, const std::string& file) {
    if (is_utf16(text)) throw SceneError({file, 0}, "the text is in UTF-16; JSON must be in UTF-8");
    check_depth(text, file);
    try {
        return json::parse(text);
    } catch (const json::parse_error& e) {
        const bool ends = e.byte > text.size();
        throw SceneError({file, line_at(text, e.byte == 0 ? 0 : e.byte - 1)},
                         ends ? "malformed JSON: the text ends early" : "malformed JSON");
    } catch (const json::exception& e) {
        // Only numbers beyond the range of double; the message quotes them.
        const std::string_view what = e.what();
        const size_t begin = what.find('\''), end = what.rfind('\'');
        const std::string_view number =
            begin < end ? what.substr(begin + 1, end - begin - 1) : std::string_view();
        const size_t at = number.empty() ? text.npos : text.find(number);
        throw SceneError(
            {file, at == text.npos ? 0 : line_at(text, at)},
            fmt::format("malformed JSON: the number {} is too large", number.substr(0, 40)));
    }
}

std::string as_utf8(const std::string& text) {
    return json::parse(json(text).dump(-1, ' ', false, json::error_handler_t::replace))
        .get<std::string>();
}

std::string excerpt(const json& value) {
    constexpr size_t kMost = 60;
    std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
    if (text.size() > kMost) text = text.substr(0, kMost) + "...";
    return text;
}

}  // namespace etendue
