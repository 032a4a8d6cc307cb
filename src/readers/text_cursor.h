#pragma once
// Reads numbers and words from the text of a mesh file and counts its lines.

#include <cctype>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "description/scene_description.h"
#include "readers/line_ends.h"
#include "readers/number_text.h"

namespace etendue {

class TextCursor {
public:
    TextCursor(std::string_view text, const std::string& file)
        : at_(text.data()), end_(text.data() + text.size()), file_(&file) {}

    bool at_end() const { return at_ == end_; }
    bool at_char(char c) const { return at_ != end_ && *at_ == c; }
    size_t remaining() const { return size_t(end_ - at_); }
    const char* position() const { return at_; }
    int line() const { return line_; }
    SourceLocation where() const { return {*file_, line_}; }

    /// Moves to the next word of this line; false where there is none. A backslash at the end of a line continues it.
    bool skip_blanks() {
        for (; at_ != end_; ++at_) {
            if (*at_ == '\\' && joins_next_line()) {
                ++line_;
            } else if (at_line_end()) {
                return false;
            } else if (!is_blank(*at_)) {
                return true;
            }
        }
        return false;
    }
    /// Moves to the next word of this or a later line; false at the end of the text.
    bool skip_blank_lines() {
        while (!skip_blanks()) {
            if (at_end()) return false;
            next_line();
        }
        return true;
    }
    /// Moves to the beginning of the next line.
    void next_line() {
        while (at_ != end_ && !at_line_end()) ++at_;
        if (at_ != end_) {
            ++at_;
            ++line_;
        }
    }
    /// The same where lines end with `end`, whatever follows it.
    void next_line(char end) {
        while (at_ != end_ && *at_ != end) ++at_;
        if (skip_char(end)) ++line_;
    }
    /// The characters up to the next blank.
    std::string_view word() {
        const char* begin = at_;
        while (at_ != end_ && *at_ != '\n' && !is_blank(*at_)) ++at_;
        return {begin, size_t(at_ - begin)};
    }
    /// The rest of the line without blanks around it.
    std::string_view rest_of_line() {
        skip_blanks();
        const char* begin = at_;
        while (at_ != end_ && !at_line_end()) ++at_;
        const char* last = at_;
        while (last != begin && is_blank(last[-1])) --last;
        return {begin, size_t(last - begin)};
    }
    /// Skips the next character and returns true where it is `c`.
    bool skip_char(char c) {
        if (!at_char(c)) return false;
        ++at_;
        return true;
    }

    /// A number that is finite as a float; `what` names it in the error.
    float number(const char* what) {
        const float value = number_or_nan(what);
        if (!std::isfinite(value)) fail(std::string(what) + " is not finite");
        return value;
    }
    float number_or_nan(const char* what) {
        double value = 0;
        parse(value, what);
        return float(value);
    }
    int64_t integer(const char* what) {
        int64_t value = 0;
        parse(value, what);
        return value;
    }

    [[noreturn]] void fail(const std::string& message) const { throw SceneError(where(), message); }

private:
    bool at_line_end() const { return ends_line(at_, end_); }
    static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
    bool joins_next_line() {
        const char* next = at_ + 1;
        if (end_ - next >= 2 && next[0] == '\r' && next[1] == '\n') ++next;
        if (next == end_ || !ends_line(next, end_)) return false;
        at_ = next;
        return true;
    }
    template <class T>
    void parse(T& value, const char* what) {
        const char* begin = at_char('+') ? at_ + 1 : at_;
        const auto [stop, error] = parse_digits(begin, end_, value);
        if (error == std::errc::result_out_of_range) fail(std::string(what) + " is out of range");
        if (error != std::errc{}) {
            const std::string_view found = word().substr(0, 40);
            fail(std::string(what) + " expected" +
                 (found.empty() ? "" : ", found \"" + std::string(found) + "\""));
        }
        at_ = stop;
        if (at_ != end_ && (std::isalnum(static_cast<unsigned char>(*at_)) || *at_ == '.'))
            fail(fmt::format(
                "{} expected, found \"{}\"", what,
                std::string_view(begin, size_t(stop - begin) + word().size()).substr(0, 40)));
    }

    const char *at_, *end_;
    const std::string* file_;
    int line_ = 1;
};

}  // namespace etendue
