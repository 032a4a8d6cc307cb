#include "readers/mitsuba_values.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include <fmt/format.h>

#include "color/srgb.h"
#include "readers/file_bytes.h"
#include "readers/line_ends.h"
#include "readers/number_text.h"

namespace etendue {
namespace {

constexpr std::string_view kBlank = " \t\r\n";

std::string_view trim(std::string_view text) {
    const size_t begin = text.find_first_not_of(kBlank);
    if (begin == text.npos) return {};
    return text.substr(begin, text.find_last_not_of(kBlank) + 1 - begin);
}

std::vector<std::string_view> split(std::string_view text, std::string_view separators) {
    std::vector<std::string_view> tokens;
    for (size_t begin = text.find_first_not_of(separators); begin != text.npos;) {
        const size_t end = std::min(text.find_first_of(separators, begin), text.size());
        tokens.push_back(text.substr(begin, end - begin));
        begin = text.find_first_not_of(separators, end);
    }
    return tokens;
}

/// parse_digits() on all of `text`, which may also begin with '+'.
template <class T>
T parse_number(std::string_view text, const char* expected, const SourceLocation& where) {
    std::string_view digits = trim(text);
    if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
    T value{};
    const char* end = digits.data() + digits.size();
    const auto [stop, error] = parse_digits(digits.data(), end, value);
    if (error == std::errc::result_out_of_range)
        throw SceneError(where, fmt::format("{} is out of range for {}", quote(text), expected));
    if (error != std::errc() || stop != end)
        throw SceneError(where, fmt::format("expected {}, found {}", expected, quote(text)));
    return value;
}

bool equals_ignoring_case(std::string_view text, std::string_view lower) {
    return text.size() == lower.size() &&
           std::equal(text.begin(), text.end(), lower.begin(), [](char a, char b) {
               return (a >= 'A' && a <= 'Z' ? char(a - 'A' + 'a') : a) == b;
           });
}

}  // namespace

std::string quote(std::string_view text) {
    constexpr size_t kLongest = 60;
    if (text.size() <= kLongest) return fmt::format("\"{}\"", text);
    return fmt::format("\"{}...\"", text.substr(0, kLongest));
}

std::string hint(std::string_view name, const std::vector<std::string>& candidates) {
    constexpr size_t kLongest = 64, kMostListed = 20;
    if (candidates.empty()) return " (there are none)";
    // Only candidates of about the same length can be near; the distance is quadratic.
    std::vector<std::string> similar;
    if (name.size() <= kLongest)
        for (const std::string& c : candidates)
            if (c.size() <= name.size() + kLongest / 2) similar.push_back(c);
    if (const std::string near = nearest_name(name, similar); !near.empty())
        return fmt::format(" (did you mean \"{}\"?)", near);
    const size_t listed = std::min(candidates.size(), kMostListed);
    return fmt::format(" (known: {}{})",
                       fmt::join(candidates.begin(), candidates.begin() + listed, ", "),
                       listed < candidates.size() ? ", ..." : "");
}

double parse_float(std::string_view text, const SourceLocation& where) {
    const double value = parse_number<double>(text, "a number", where);
    if (!std::isfinite(value))
        throw SceneError(where, fmt::format("expected a finite number, found {}", quote(text)));
    return value;
}

int64_t parse_integer(std::string_view text, const SourceLocation& where) {
    return parse_number<int64_t>(text, "an integer", where);
}

bool parse_boolean(std::string_view text, const SourceLocation& where) {
    const std::string_view word = trim(text);
    if (equals_ignoring_case(word, "true")) return true;
    if (equals_ignoring_case(word, "false")) return false;
    throw SceneError(where, fmt::format("expected \"true\" or \"false\", found {}", quote(text)));
}

std::vector<double> parse_floats(std::string_view text, const SourceLocation& where) {
    std::vector<double> values;
    for (std::string_view token : split(text, " \t\r\n,"))
        values.push_back(parse_float(token, where));
    return values;
}

std::vector<double> parse_triple(std::string_view text, const SourceLocation& where) {
    std::vector<double> values = parse_floats(text, where);
    if (values.size() == 1) values.resize(3, values[0]);
    if (values.size() != 3)
        throw SceneError(where, fmt::format("expected one or three numbers, found {} in {}",
                                            values.size(), quote(text)));
    return values;
}

Vec3 to_vec3(const std::vector<double>& xyz, const SourceLocation& where) {
    const Vec3 v{float(xyz[0]), float(xyz[1]), float(xyz[2])};
    if (!is_finite(v))
        throw SceneError(
            where, fmt::format("{} is out of range for single precision", fmt::join(xyz, ", ")));
    return v;
}

Rgb to_rgb(const std::vector<double>& rgb, const SourceLocation& where) {
    const Vec3 v = to_vec3(rgb, where);
    return {v.x, v.y, v.z};
}

std::vector<double> parse_hex_colour(std::string_view text, const SourceLocation& where) {
    const std::string_view code = trim(text);
    if (code.empty() || code[0] != '#') return {};
    uint32_t bits = 0;
    const char* end = code.data() + code.size();
    const auto [stop, error] = std::from_chars(code.data() + 1, end, bits, 16);
    if (code.size() != 7 || error != std::errc() || stop != end)
        throw SceneError(
            where, fmt::format("expected a colour of the form \"#rrggbb\", found {}", quote(text)));
    return {(bits >> 16 & 255) / 255.0, (bits >> 8 & 255) / 255.0, (bits & 255) / 255.0};
}

Rgb parse_srgb(std::string_view text, const SourceLocation& where) {
    std::vector<double> encoded = parse_hex_colour(text, where);
    if (encoded.empty()) encoded = parse_triple(text, where);
    for (double v : encoded)
        if (!(v >= 0 && v <= 1))
            throw SceneError(
                where, fmt::format("sRGB components must lie in [0, 1], found {}", quote(text)));
    return {srgb_to_linear(float(encoded[0])), srgb_to_linear(float(encoded[1])),
            srgb_to_linear(float(encoded[2]))};
}

SpectrumSamples parse_spectrum_list(std::string_view text, const SourceLocation& where) {
    SpectrumSamples samples;
    for (std::string_view token : split(text, " \t\r\n,")) {
        const size_t colon = token.find(':');
        if (colon == token.npos || token.find(':', colon + 1) != token.npos)
            throw SceneError(
                where, fmt::format("expected a list of wavelength:value, found {}", quote(token)));
        samples.wavelengths.push_back(parse_float(token.substr(0, colon), where));
        samples.values.push_back(parse_float(token.substr(colon + 1), where));
    }
    check_samples(samples, where);
    return samples;
}

SpectrumSamples parse_spectrum_file(std::string_view text, const std::string& file) {
    SpectrumSamples samples;
    SourceLocation where{file, 0};
    text = plain_text(text, file);
    while (!text.empty()) {
        ++where.line;
        const std::string_view line = take_line(text);
        const std::vector<double> numbers = parse_floats(line.substr(0, line.find('#')), where);
        if (numbers.empty()) continue;
        if (numbers.size() != 2)
            throw SceneError(
                where,
                fmt::format("expected a wavelength and a value, found {} numbers", numbers.size()));
        if (!samples.wavelengths.empty() && numbers[0] <= samples.wavelengths.back())
            throw SceneError(where, fmt::format("wavelengths must increase, but {} follows {}",
                                                numbers[0], samples.wavelengths.back()));
        samples.wavelengths.push_back(numbers[0]);
        samples.values.push_back(numbers[1]);
    }
    check_samples(samples, {file, 0});
    return samples;
}

void check_samples(const SpectrumSamples& samples, const SourceLocation& where) {
    if (samples.wavelengths.size() < 2)
        throw SceneError(where, fmt::format("a spectrum needs at least two wavelengths, found {}",
                                            samples.wavelengths.size()));
    for (size_t i = 1; i < samples.wavelengths.size(); ++i)
        if (!(samples.wavelengths[i - 1] < samples.wavelengths[i]))
            throw SceneError(where,
                             fmt::format("wavelengths must increase, but {} follows {}",
                                         samples.wavelengths[i], samples.wavelengths[i - 1]));
    constexpr double kShortest = 50;  // in nm; a spectrum of light does not end before
    if (samples.wavelengths.back() < kShortest)
        throw SceneError(where,
                         fmt::format("wavelengths must be in nanometres, but the longest is {}{}",
                                     samples.wavelengths.back(),
                                     samples.wavelengths.back() < 10 ? " (micrometres?)" : ""));
}

}  // namespace etendue
