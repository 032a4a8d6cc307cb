#include "readers/mitsuba_spectrum.h"

#include <algorithm>

#include <fmt/format.h>

namespace etendue {
namespace {

/// Gets the parameters of one spectrum plug-in. finish() throws for those that were not asked for, which are unknown.
class ParameterReader {
public:
    explicit ParameterReader(const SceneObject& spectrum) : spectrum_(spectrum) {}

    double number(const char* name, std::optional<double> fallback = {}) {
        const Param* p = find(name, !fallback);
        if (!p) return *fallback;
        if (const auto* i = std::get_if<int64_t>(&p->value)) return double(*i);
        if (const auto* d = std::get_if<double>(&p->value)) return *d;
        throw SceneError(p->where, fmt::format("parameter \"{}\" must be a number, not {}", name,
                                               to_string(p->value)));
    }
    std::vector<double> numbers(const char* name) {
        const Param* p = find(name, true);
        if (const auto* s = std::get_if<std::string>(&p->value)) return parse_floats(*s, p->where);
        throw SceneError(p->where,
                         fmt::format("parameter \"{}\" must be a string of numbers, not {}", name,
                                     to_string(p->value)));
    }
    Rgb colour(const char* name, std::optional<Rgb> fallback = {}) {
        const Param* p = find(name, !fallback);
        if (!p) return *fallback;
        if (const auto* c = std::get_if<Rgb>(&p->value)) return *c;
        throw SceneError(p->where, fmt::format("parameter \"{}\" must be a colour, not {}", name,
                                               to_string(p->value)));
    }
    void finish() const {
        for (const Param& p : spectrum_.params)
            if (std::find(requested_.begin(), requested_.end(), p.name) == requested_.end())
                throw SceneError(p.where,
                                 fmt::format("spectrum \"{}\" has no parameter \"{}\"{}",
                                             spectrum_.type, p.name, hint(p.name, requested_)));
    }

private:
    const Param* find(const char* name, bool required) {
        requested_.push_back(name);
        const Param* p = spectrum_.find(name);
        if (!p && required)
            throw SceneError(
                spectrum_.where,
                fmt::format("spectrum \"{}\" needs the parameter \"{}\"", spectrum_.type, name));
        return p;
    }

    const SceneObject& spectrum_;
    std::vector<std::string> requested_;
};

Rgb blackbody(ParameterReader& params, const SourceLocation& where) {
    const double kelvin = params.number("temperature"), scale = params.number("scale", 1);
    if (!(kelvin > 0))
        throw SceneError(where,
                         fmt::format("the temperature must be above 0 K, but is {} K", kelvin));
    return blackbody_rgb(kelvin) * float(scale);
}

Rgb irregular(ParameterReader& params, SpectrumRole role, const SourceLocation& where) {
    const SpectrumSamples samples{params.numbers("wavelengths"), params.numbers("values")};
    if (samples.wavelengths.size() != samples.values.size())
        throw SceneError(where, fmt::format("a spectrum has {} wavelengths but {} values",
                                            samples.wavelengths.size(), samples.values.size()));
    check_samples(samples, where);
    return spectrum_colour(samples, role);
}

Rgb regular(ParameterReader& params, SpectrumRole role, const SourceLocation& where) {
    const double lo = params.number("wavelength_min"), hi = params.number("wavelength_max");
    SpectrumSamples samples{{}, params.numbers("values")};
    const size_t n = samples.values.size();
    for (size_t i = 0; i < n; ++i)
        samples.wavelengths.push_back(lo + (hi - lo) * double(i) / double(n - 1));
    check_samples(samples, where);
    return spectrum_colour(samples, role);
}

}  // namespace

SpectrumRole spectrum_role(std::string_view category, std::string_view parameter, bool in_emitter) {
    const bool is_factor = category == "texture" && parameter == "scale";
    if (in_emitter && !is_factor) return SpectrumRole::Emission;
    constexpr std::string_view kRatios[] = {"eta", "k", "int_ior", "ext_ior", "scale", "sigma_a"};
    const bool ratio =
        std::find(std::begin(kRatios), std::end(kRatios), parameter) != std::end(kRatios);
    return (category == "bsdf" || category == "texture") && !ratio ? SpectrumRole::Reflectance
                                                                   : SpectrumRole::Ratio;
}

Rgb spectrum_colour(const SpectrumSamples& samples, SpectrumRole role) {
    const Illuminant seen_by =
        role == SpectrumRole::Emission ? Illuminant::EqualEnergy : Illuminant::D65;
    Rgb c = spectrum_to_rgb(samples.wavelengths, samples.values, seen_by);
    if (role == SpectrumRole::Reflectance)
        c = {std::min(c.r, 1.0f), std::min(c.g, 1.0f), std::min(c.b, 1.0f)};
    return c;
}

Rgb spectrum_plugin_colour(const SceneObject& spectrum, SpectrumRole role) {
    ParameterReader params(spectrum);
    const std::string& type = spectrum.type;
    Rgb c;
    if (type == "blackbody")
        c = blackbody(params, spectrum.where);
    else if (type == "uniform")
        c = Rgb(float(params.number("value", 1)));
    else if (type == "d65")
        c = params.colour("color", Rgb(1)) * float(params.number("scale", 1));
    else if (type == "irregular")
        c = irregular(params, role, spectrum.where);
    else if (type == "regular")
        c = regular(params, role, spectrum.where);
    else if (type == "srgb")
        c = params.colour("color");
    else
        throw SceneError(spectrum.where, fmt::format("unknown spectrum type \"{}\"{}", type,
                                                     hint(type, {"blackbody", "d65", "irregular",
                                                                 "regular", "srgb", "uniform"})));
    params.finish();
    if (!is_finite(c))
        throw SceneError(
            spectrum.where,
            fmt::format("the spectrum's colour is not finite: ({}, {}, {})", c.r, c.g, c.b));
    return c;
}

}  // namespace etendue
