#pragma once
// The text of a pbrt file: words, strings, numbers and brackets between blanks and comments.

#include <array>
#include <charconv>
#include <string>
#include <string_view>
#include <vector>

#include "description/source_location.h"
#include "readers/line_ends.h"
#include "readers/number_text.h"

namespace etendue {

/// A line of a file whose name is stored elsewhere, so that it is cheap to copy.
struct PbrtPlace {
    const FileName* file = nullptr;
    int line = 0;

    operator SourceLocation() const { return {file ? *file : FileName(), line}; }
};

class PbrtTokenizer {
public:
    /// Both must outlive the tokenizer.
    PbrtTokenizer(std::string_view text, const FileName& file)
        : at_(text.data()), end_(text.data() + text.size()), file_(&file) {}
    PbrtTokenizer(std::string_view text, FileName&& file) = delete;

    /// Goes on with another text, and afterwards where it is now. Both arguments must outlive the tokenizer.
    void include(std::string_view text, const FileName& file);
    void include(std::string_view text, FileName&& file) = delete;
    /// Number of included texts that are not at their end, as of the last peek().
    size_t depth() const { return outer_.size(); }

    /// The character that the next token begins with; 0 at the end of the text. Tokens may stand in the text that
    /// includes the one before, so that a directive can begin in one and go on in the other.
    char peek() {
        skip_blanks();
        while (at_ == end_ && !outer_.empty()) {
            leave();
            skip_blanks();
        }
        return at_ == end_ ? '\0' : *at_;
    }
    /// Whether the next token is this bracket, which is then passed over.
    bool skip(char bracket) {
        if (peek() != bracket) return false;
        ++at_;
        return true;
    }
    /// The characters up to the next blank, quote, bracket or comment.
    std::string_view word();
    /// What stands between the next two quotes, escapes as they are.
    std::string_view string();
    /// A finite number.
    template <class T>
    T number(const char* expected) {
        peek();
        const char* begin = at_ != end_ && *at_ == '+' ? at_ + 1 : at_;
        T value{};
        const auto [stop, error] = parse_digits(begin, end_, value);
        if (error == std::errc::result_out_of_range && ends_word(stop))
            fail("the number " + std::string(word()) + " is out of range");
        if (error != std::errc() || !ends_word(stop) || !is_finite(value)) fail_number(expected);
        at_ = stop;
        return value;
    }

    PbrtPlace where() const { return {file_, line_}; }
    [[noreturn]] void fail(const std::string& message) const { throw SceneError(where(), message); }

private:
    void skip_blanks() {
        for (; at_ != end_; ++at_) {
            if (ends_line(at_, end_))
                ++line_;
            else if (*at_ == '#')
                skip_comment();
            else if (*at_ != ' ' && *at_ != '\t' && *at_ != '\r')
                return;
            if (at_ == end_) return;
        }
    }
    void skip_comment();
    static constexpr std::array<bool, 256> kEndsWord = [] {
        std::array<bool, 256> ends{};
        for (const unsigned char c : {' ', '\n', '\t', '\r', ']', '[', '"', '#'}) ends[c] = true;
        return ends;
    }();
    bool ends_word(const char* at) const {
        return at == end_ || kEndsWord[static_cast<unsigned char>(*at)];
    }
    template <class T>
    static bool is_finite(T value) {
        return value - value == 0;
    }
    [[noreturn]] void fail_number(const char* expected);
    /// Goes on behind the Include of the text that ends here.
    void leave();

    struct Text {
        const char *at, *end;
        const FileName* file;
        int line;
    };
    const char *at_, *end_;
    const FileName* file_;
    int line_ = 1;
    std::vector<Text> outer_;  ///< Texts that include this one, the nearest last.
};

/// `text` with its escapes (\n, \t, \", \\ ...) replaced.
std::string unescape(std::string_view text);
/// Whether the last word of a pbrt file is WorldEnd, which only pbrt-v3 has.
bool ends_with_world_end(std::string_view text);

}  // namespace etendue
