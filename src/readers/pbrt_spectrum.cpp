#include "readers/pbrt_spectrum.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "color/metals.h"
#include "color/spectrum.h"
#include "readers/mitsuba_values.h"
#include "readers/pbrt_scene.h"

namespace etendue {
namespace {

[[noreturn]] void fail(const PbrtValue& value, const std::string& message) {
    throw SceneError(value.where, fmt::format("parameter \"{}\": {}", value.name, message));
}

struct Glass {
    const char* name;
    float ior;  ///< n_d, from the makers' catalogues
};
constexpr Glass kGlasses[] = {
    {"glass-BK7", 1.5168f},   {"glass-BAF10", 1.6700f}, {"glass-FK51A", 1.4866f},
    {"glass-LASF9", 1.8503f}, {"glass-F5", 1.6034f},    {"glass-SF5", 1.6727f},
    {"glass-SF10", 1.7283f},  {"glass-SF11", 1.7847f},
};

/// Illuminants by their chromaticity (x, y) [CIE 15:2018]; the luminance is 1.
struct Illuminator {
    const char* name;
    double x, y;
};
constexpr Illuminator kIlluminants[] = {
    {"stdillum-A", 0.44758, 0.40745},   {"stdillum-D50", 0.34567, 0.35851},
    {"stdillum-D65", 0.31272, 0.32903}, {"illum-acesD60", 0.32168, 0.33767},
    {"stdillum-F1", 0.31310, 0.33727},  {"stdillum-F2", 0.37208, 0.37529},
    {"stdillum-F3", 0.40910, 0.39430},  {"stdillum-F4", 0.44018, 0.40329},
    {"stdillum-F5", 0.31379, 0.34531},  {"stdillum-F6", 0.37790, 0.38835},
    {"stdillum-F7", 0.31292, 0.32933},  {"stdillum-F8", 0.34588, 0.35875},
    {"stdillum-F9", 0.37417, 0.37281},  {"stdillum-F10", 0.34609, 0.35986},
    {"stdillum-F11", 0.38052, 0.37713}, {"stdillum-F12", 0.43695, 0.40441},
};

/// Luminance 1, as pbrt-v4 gives every light before its scale.
Rgb normalized(Rgb c, const PbrtValue& value) {
    if (!(luminance(c) > 0)) fail(value, "the spectrum of a light must not be black");
    return c / luminance(c);
}

Rgb blackbody(const PbrtValue& value, PbrtSpectrum kind, bool v3) {
    const size_t expected = v3 ? 2 : 1;
    if (value.numbers.size() != expected && !(v3 && value.numbers.size() == 1))
        fail(value, fmt::format("expected {}, found {} numbers",
                                v3 ? "a temperature and a scale" : "one temperature",
                                value.numbers.size()));
    const double kelvin = value.numbers[0];
    if (!(kelvin >= 100)) fail(value, fmt::format("{} K is not a temperature of light", kelvin));
    const Rgb c = blackbody_rgb(kelvin);
    if (!v3 && kind == PbrtSpectrum::Illuminant) return normalized(c, value);
    // Relative to the peak of Planck's curve, 4.0957e-6 T⁵ W m⁻³ sr⁻¹ (pbrt: BlackbodyNormalized).
    const double peak = 4.0957e-15 * std::pow(kelvin, 5);
    return c / float(peak) * (value.numbers.size() > 1 ? value.numbers[1] : 1.0f);
}

std::optional<Rgb> named(std::string_view name) {
    constexpr std::string_view kMetal = "metal-";
    if (name.starts_with(kMetal)) {
        const std::string_view rest = name.substr(kMetal.size());
        const size_t dash = rest.rfind('-');
        const std::string_view part = dash == rest.npos ? rest : rest.substr(dash + 1);
        // Brass is not among the measured metals: these are its values at 630, 540 and 450 nm [Querry 1985].
        const std::optional<ConductorIor> metal =
            rest.substr(0, dash) == "CuZn"
                ? ConductorIor{{0.444f, 0.527f, 1.094f}, {3.695f, 2.765f, 1.829f}}
                : named_metal(rest.substr(0, dash));
        if (metal && part == "eta") return metal->eta;
        if (metal && part == "k") return metal->k;
    }
    for (const Illuminator& i : kIlluminants)
        if (name == i.name) return xyz_to_rgb(i.x / i.y, 1, (1 - i.x - i.y) / i.y);
    if (const auto ior = pbrt_glass(name)) return Rgb(*ior);
    return {};
}

std::vector<std::string> known_names() {
    std::vector<std::string> names;
    for (const char* metal : {"Ag", "Al", "Au", "Cu", "CuZn", "MgO", "TiO2"})
        for (const char* part : {"eta", "k"})
            names.push_back(fmt::format("metal-{}-{}", metal, part));
    for (const Glass& g : kGlasses) names.emplace_back(g.name);
    for (const Illuminator& i : kIlluminants) names.emplace_back(i.name);
    return names;
}

SpectrumSamples samples_of(const PbrtValue& value, const PbrtScene& scene) {
    if (!value.strings.empty()) {
        std::string path;
        const std::string text = scene.load(value.strings[0], value.where, path);
        return parse_spectrum_file(text, path);
    }
    if (value.numbers.size() % 2 != 0)
        fail(value, fmt::format("expected pairs of a wavelength and a value, found {} numbers",
                                value.numbers.size()));
    SpectrumSamples samples;
    for (size_t i = 0; i < value.numbers.size(); i += 2) {
        samples.wavelengths.push_back(value.numbers[i]);
        samples.values.push_back(value.numbers[i + 1]);
    }
    check_samples(samples, value.where);
    return samples;
}

bool is_file(const std::string& name) {
    return name.find('.') != name.npos || name.find('/') != name.npos;
}

Rgb spectrum(const PbrtValue& value, PbrtSpectrum kind, const PbrtScene& scene) {
    // One number is a flat spectrum (pbrt-v4).
    if (value.numbers.size() == 1)
        return kind == PbrtSpectrum::Illuminant
                   ? normalized(spectrum_to_rgb(std::vector{300.0, 900.0}, std::vector{1.0, 1.0}),
                                value)
                   : Rgb(value.numbers[0]);
    if (value.strings.size() > 1)
        fail(value, fmt::format("expected one name or file of a spectrum, found {}",
                                value.strings.size()));
    if (!value.strings.empty() && !is_file(value.strings[0])) {
        const std::string& name = value.strings[0];
        const auto c = named(name);
        if (!c)
            fail(value,
                 fmt::format("unknown spectrum {}{}", quote(name), hint(name, known_names())));
        return kind == PbrtSpectrum::Illuminant ? normalized(*c, value) : *c;
    }
    const SpectrumSamples samples = samples_of(value, scene);
    const bool daylight = !scene.is_v3() && kind != PbrtSpectrum::Illuminant;
    const Rgb c = spectrum_to_rgb(samples.wavelengths, samples.values,
                                  daylight ? Illuminant::D65 : Illuminant::EqualEnergy);
    return !scene.is_v3() && kind == PbrtSpectrum::Illuminant ? normalized(c, value) : c;
}

}  // namespace

Rgb pbrt_colour(const PbrtValue& value, PbrtSpectrum kind, const PbrtScene& scene) {
    const std::vector<float>& n = value.numbers;
    Rgb c;
    switch (value.type) {
    case PbrtType::Rgb:
    case PbrtType::Xyz:
        if (n.size() != 3) fail(value, fmt::format("expected three numbers, found {}", n.size()));
        c = value.type == PbrtType::Rgb ? Rgb(n[0], n[1], n[2]) : xyz_to_rgb(n[0], n[1], n[2]);
        break;
    case PbrtType::Blackbody: c = blackbody(value, kind, scene.is_v3()); break;
    default: c = spectrum(value, kind, scene);
    }
    if (!is_finite(c) || std::min({c.r, c.g, c.b}) < 0)
        fail(value, fmt::format("a colour must be finite and not negative, but is {} {} {}", c.r,
                                c.g, c.b));
    return c;
}

std::optional<float> pbrt_glass(std::string_view name) {
    for (const Glass& g : kGlasses)
        if (name == g.name) return g.ior;
    return {};
}

float pbrt_number(const PbrtValue& value, const PbrtScene& scene) {
    if (value.type == PbrtType::Float || value.numbers.size() == 1) return value.numbers.at(0);
    if (value.type == PbrtType::Spectrum && (value.strings.empty() || is_file(value.strings[0]))) {
        const SpectrumSamples s = samples_of(value, scene);
        constexpr double kSodium = 587.56;
        const auto above = std::lower_bound(s.wavelengths.begin(), s.wavelengths.end(), kSodium);
        if (above == s.wavelengths.begin()) return float(s.values.front());
        if (above == s.wavelengths.end()) return float(s.values.back());
        const size_t i = size_t(above - s.wavelengths.begin());
        const double t =
            (kSodium - s.wavelengths[i - 1]) / (s.wavelengths[i] - s.wavelengths[i - 1]);
        return float(s.values[i - 1] + t * (s.values[i] - s.values[i - 1]));
    }
    return pbrt_colour(value, PbrtSpectrum::Unbounded, scene).g;
}

}  // namespace etendue
