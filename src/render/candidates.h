#pragma once
// The methods among which `auto` chooses.

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
};

/// In the order in which they are tried: the cheapest first.
inline constexpr std::array<CandidateMethod, 7> kCandidateMethods{
    {{.name = "path"},
     {.name = "bdpt"},
     {.name = "pcbpt"},
     {.name = "vcm", .reuses_light_paths = true},
     {.name = "upg+bdpt", .reuses_light_paths = true},
     {.name = "mlt", .has_chains = true},
     {.name = "mmlt", .has_chains = true}}};

/// The entry of a method with any parameters, as `vcm:guide=auto`.
inline const CandidateMethod& candidate_method(std::string_view method) {
    const std::string_view name = method.substr(0, method.find(':'));
    for (const CandidateMethod& m : kCandidateMethods)
        if (name == m.name) return m;
    throw std::logic_error(std::string(name) + " is no candidate");
}

}  // namespace etendue
