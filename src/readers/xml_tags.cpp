#include "readers/xml_tags.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

namespace etendue {
namespace {

constexpr std::string_view kEndOfName = " \t\r\n/>";

std::string_view name_at(std::string_view text, size_t begin) {
    begin = std::min(begin, text.size());
    return text.substr(begin, std::min(text.find_first_of(kEndOfName, begin), text.size()) - begin);
}

/// Where a start tag ends: the values of attributes may contain '>'.
size_t end_of_tag(std::string_view text, size_t at) {
    char quote = 0;
    for (; at < text.size() && (quote || text[at] != '>'); ++at) {
        if (quote)
            quote = text[at] == quote ? 0 : quote;
        else if (text[at] == '"' || text[at] == '\'')
            quote = text[at];
    }
    return at;
}

/// Names of the elements that have begun in `text` and not ended, the innermost last; each is a part of `text`.
std::vector<std::string_view> open_elements(std::string_view text) {
    std::vector<std::string_view> open;
    for (size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
        const auto skip = [&](std::string_view begin, std::string_view end) {
            if (!text.substr(at).starts_with(begin)) return false;
            at = std::min(text.find(end, at + begin.size()), text.size());
            return true;
        };
        if (skip("<!--", "-->") || skip("<![CDATA[", "]]>") || skip("<?", "?>") || skip("<!", ">"))
            continue;
        if (skip("</", ">")) {
            if (!open.empty()) open.pop_back();
            continue;
        }
        const std::string_view name = name_at(text, at + 1);
        at = end_of_tag(text, at);
        if (text[at - 1] != '/') open.push_back(name);
    }
    return open;
}

}  // namespace

std::string describe_wrong_end(std::string_view text, size_t offset,
                               const std::function<int(size_t)>& line) {
    const bool is_end_tag = offset >= 2 && text.substr(offset - 2, 2) == "</";
    const std::vector<std::string_view> open =
        open_elements(is_end_tag ? text.substr(0, offset - 2) : text);
    const std::string_view name = is_end_tag ? name_at(text, offset) : "";
    if (open.empty()) return fmt::format("</{}> closes nothing: no element is open", name);
    const std::string element = fmt::format("<{}>, which begins in line {},", open.back(),
                                            line(size_t(open.back().data() - text.data())));
    if (!is_end_tag) return fmt::format("{} is never closed: the file ends", element);
    if (std::find(open.begin(), open.end(), name) != open.end())
        return fmt::format("{} is never closed: </{}> follows", element, name);
    return fmt::format("{} must be closed before </{}>", element, name);
}

}  // namespace etendue
