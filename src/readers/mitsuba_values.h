#pragma once
// Parsers for the attributes of scene files: numbers, colours and spectra. On invalid text all of them throw SceneError
// with location `where` and the text in quotes.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"
#include "color/spectrum.h"
#include "description/scene_description.h"

namespace etendue {

/// `text` in quotes for a message; shortened where it is long.
std::string quote(std::string_view text);
/// Hint for an error message about an unknown name: " (did you mean "x"?)", or a list of the known names, or " (there
/// are none)".
std::string hint(std::string_view name, const std::vector<std::string>& candidates);

/// A finite number, with optional blanks around it.
double parse_float(std::string_view text, const SourceLocation& where);
int64_t parse_integer(std::string_view text, const SourceLocation& where);
bool parse_boolean(std::string_view text, const SourceLocation& where);
/// Numbers separated by blanks or commas.
std::vector<double> parse_floats(std::string_view text, const SourceLocation& where);
/// Three numbers, or one that stands for all three.
std::vector<double> parse_triple(std::string_view text, const SourceLocation& where);
Vec3 to_vec3(const std::vector<double>& xyz, const SourceLocation& where);
Rgb to_rgb(const std::vector<double>& rgb, const SourceLocation& where);

/// "#rrggbb" as three numbers in [0, 1], not linearised; empty where `text` does not begin with '#'.
std::vector<double> parse_hex_colour(std::string_view text, const SourceLocation& where);
/// sRGB in [0, 1], one or three numbers or "#rrggbb", as a linear colour.
Rgb parse_srgb(std::string_view text, const SourceLocation& where);

/// A spectrum's samples; wavelengths in nm, strictly increasing.
struct SpectrumSamples {
    std::vector<double> wavelengths, values;
};
/// "400:0.1, 500:0.2, ...".
SpectrumSamples parse_spectrum_list(std::string_view text, const SourceLocation& where);
/// A spectrum file: a wavelength and a value on each line, '#' begins a comment. Errors name the
/// line of `file`.
SpectrumSamples parse_spectrum_file(std::string_view text, const std::string& file);
/// Throws unless there are at least two samples at strictly increasing wavelengths.
void check_samples(const SpectrumSamples& samples, const SourceLocation& where);

}  // namespace etendue
