#pragma once
// Mutations of inputs that depend on a seed only, so that every run of the tests sees the same ones.

#include <algorithm>
#include <cctype>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "math/hash.h"

namespace etendue::fuzz {

class Mutator {
public:
    explicit Mutator(uint64_t seed) : state_(seed) {}

    /// One to four changes of `input`; `others` are spliced in now and then.
    std::string mutate(std::string input, const std::vector<std::string>& others) {
        for (size_t changes = 1 + below(4); changes-- > 0;) change(input, others);
        return input;
    }

private:
    uint64_t next() { return state_ = hash_combine(state_, ++count_); }
    size_t below(size_t n) { return size_t(next() >> 11) % n; }

    /// A random place and a random length from there.
    std::pair<size_t, size_t> range(const std::string& s) {
        const size_t at = below(s.size());
        return {at, 1 + below(std::min<size_t>(s.size() - at, below(4) == 0 ? 4096 : 16))};
    }

    void change(std::string& s, const std::vector<std::string>& others) {
        constexpr size_t kLargest = 1 << 16;
        if (s.empty() || s.size() > kLargest) {
            s = others[below(others.size())].substr(0, kLargest);
            return;
        }
        switch (below(10)) {
        case 0: s[below(s.size())] ^= char(1 << below(8)); break;
        case 1: s[below(s.size())] = kBytes[below(sizeof kBytes)]; break;
        case 2: {
            const auto [at, length] = range(s);
            s.erase(at, length);
            break;
        }
        case 3: {  // repeat a piece
            const auto [at, length] = range(s);
            const std::string piece = s.substr(at, length);
            for (size_t n = below(8) == 0 ? 1 + below(200) : 1; n-- > 0;) s.insert(at, piece);
            break;
        }
        case 4: {  // move a piece
            const auto [at, length] = range(s);
            const std::string piece = s.substr(at, length);
            s.erase(at, length);
            s.insert(below(s.size() + 1), piece);
            break;
        }
        case 5: s.resize(below(s.size())); break;
        case 6: {  // begin of this one, end of another one
            const std::string& other = others[below(others.size())];
            s = s.substr(0, below(s.size())) + other.substr(below(other.size() + 1));
            break;
        }
        case 7: {
            const uint32_t word = kWords[below(std::size(kWords))];
            const size_t size = std::min<size_t>(s.size(), size_t(1) << below(3));
            std::memcpy(&s[below(s.size() - size + 1)], &word, size);
            break;
        }
        default: replace_number(s);
        }
    }

    /// Replaces a number in a text.
    void replace_number(std::string& s) {
        const auto is_digit = [](char c) {
            return std::isdigit(static_cast<unsigned char>(c)) != 0;
        };
        const size_t start = below(s.size());
        const auto digit = std::find_if(s.begin() + ptrdiff_t(start), s.end(), is_digit);
        if (digit == s.end()) return;
        const auto end = std::find_if_not(digit, s.end(), [&](char c) {
            return is_digit(c) || c == '.' || c == 'e' || c == '-';
        });
        s.replace(digit, end, kNumbers[below(std::size(kNumbers))]);
    }

    static constexpr char kBytes[] = {'\0', '\n', ' ', '"', '<', '>', '{', '}',    '[',
                                      ']',  ',',  ':', '/', '-', '#', '$', '\x7f', '\xff'};
    static constexpr uint32_t kWords[] = {
        0,          1,          0x7f,       0x80,       0xff,       0x7fff,     0xffff,
        0x7fffffff, 0x80000000, 0xffffffff, 0x7f800000, 0x7fc00000, 0x3f800000, 0x00000100};
    static constexpr const char* kNumbers[] = {"0",
                                               "-0",
                                               "1",
                                               "-1",
                                               "2",
                                               "255",
                                               "65536",
                                               "2147483647",
                                               "-2147483648",
                                               "4294967296",
                                               "99999999999999999999",
                                               "1e38",
                                               "-1e38",
                                               "1e308",
                                               "1e-45",
                                               "1e999",
                                               "nan",
                                               "inf",
                                               "0.5",
                                               "1e-3"};

    uint64_t state_, count_ = 0;
};

}  // namespace etendue::fuzz
