#include "readers/pbrt_tokenizer.h"

#include <algorithm>

#include <fmt/format.h>

#include "readers/mitsuba_values.h"

namespace etendue {

void PbrtTokenizer::include(std::string_view text, const FileName& file) {
    outer_.push_back({at_, end_, file_, line_});
    at_ = text.data();
    end_ = at_ + text.size();
    file_ = &file;
    line_ = 1;
}

void PbrtTokenizer::leave() {
    const Text& outer = outer_.back();
    at_ = outer.at;
    end_ = outer.end;
    file_ = outer.file;
    line_ = outer.line;
    outer_.pop_back();
}

std::string_view PbrtTokenizer::word() {
    peek();
    const char* begin = at_;
    while (!ends_word(at_)) ++at_;
    return {begin, size_t(at_ - begin)};
}

std::string_view PbrtTokenizer::string() {
    if (!skip('"')) fail(fmt::format("expected a string in quotes, found {}", quote(word())));
    const char* begin = at_;
    const int first_line = line_;
    for (; at_ != end_ && *at_ != '"'; ++at_) {
        if (*at_ == '\\' && at_ + 1 != end_) ++at_;
        if (ends_line(at_, end_)) ++line_;
    }
    if (at_ == end_) {
        line_ = first_line;
        fail("a string begins here that has no closing quote");
    }
    return {begin, size_t(at_++ - begin)};
}

void PbrtTokenizer::skip_comment() {
    while (at_ != end_ && !ends_line(at_, end_)) ++at_;
    if (at_ != end_) ++line_;
}

void PbrtTokenizer::fail_number(const char* expected) {
    if (at_ == end_) fail(fmt::format("expected {}, but the file ends", expected));
    if (*at_ == '"')
        fail(fmt::format("expected {}, found the string {}", expected, quote(string())));
    if (*at_ == '[' || *at_ == ']') fail(fmt::format("expected {}, found \"{}\"", expected, *at_));
    fail(fmt::format("expected {}, found {}", expected, quote(word())));
}

std::string unescape(std::string_view text) {
    if (text.find('\\') == text.npos) return std::string(text);
    std::string plain;
    for (size_t i = 0; i < text.size(); ++i) {
        if (text[i] != '\\' || i + 1 == text.size()) {
            plain += text[i];
            continue;
        }
        const char c = text[++i];
        plain += c == 'n' ? '\n' : c == 't' ? '\t' : c == 'r' ? '\r' : c == 'b' ? '\b' : c;
    }
    return plain;
}

bool ends_with_world_end(std::string_view text) {
    constexpr std::string_view kWord = "WorldEnd";
    while (!text.empty()) {
        const size_t last_end = text.find_last_of("\r\n"),
                     begin = last_end == text.npos ? 0 : last_end + 1;
        std::string_view line = text.substr(begin);
        line = line.substr(0, line.find('#'));
        const size_t last = line.find_last_not_of(" \t\r");
        if (last != line.npos) return line.substr(0, last + 1).ends_with(kWord);
        text = text.substr(0, begin > 0 ? begin - 1 : 0);
    }
    return false;
}

}  // namespace etendue
