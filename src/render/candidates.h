#pragma once
// The methods that pilots judge.

#include <array>
#include <stdexcept>
#include <string>
#include <string_view>

namespace etendue {

struct CandidateMethod {
    const char* name;
    bool has_chains = false;
    /// Whether eye paths meet the light paths of all pixels, of which there are few in pilots.
    bool reuses_light_paths = false;
    /// Whether these are pairs of gathers, whose radius is chosen so that enough are found.
    bool gathers = false;
    /// Whether `auto` may choose it. The guide of others can be judged.
    bool is_of_auto = true;
};

/// In the order in which they are tried: the cheapest first.
inline constexpr std::array<CandidateMethod, 10> kCandidateMethods{
    {{.name = "path"},
     {.name = "bdpt"},
     {.name = "pcbpt"},
     {.name = "vcm", .reuses_light_paths = true},
     {.name = "upg+bdpt", .reuses_light_paths = true, .gathers = true},
     {.name = "mlt", .has_chains = true},
     {.name = "mmlt", .has_chains = true},
     {.name = "light", .is_of_auto = false},
     {.name = "upg", .reuses_light_paths = true, .gathers = true, .is_of_auto = false},
     {.name = "pssmlt", .has_chains = true, .is_of_auto = false}}};

/// The entry of a method with any parameters, as `vcm:guide=on`.
inline const CandidateMethod& candidate_method(std::string_view method) {
    const std::string_view name = method.substr(0, method.find(':'));
    for (const CandidateMethod& m : kCandidateMethods)
        if (name == m.name) return m;
    throw std::logic_error(std::string(name) + " is no candidate");
}

}  // namespace etendue
