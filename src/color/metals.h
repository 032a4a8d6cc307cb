#pragma once
// Complex indices of refraction of conductors by name.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"

namespace etendue {

/// η + i k relative to vacuum.
struct ConductorIor {
    Rgb eta, k;
};

/// Index of the material with this name ("Au", "Cu", "TiN", ...; case-sensitive), or empty for an unknown one. The
/// suffix "_palik", which some scene files use, is accepted for every name.
std::optional<ConductorIor> named_metal(std::string_view name);

/// All names, in alphabetical order.
std::vector<std::string> metal_names();

}  // namespace etendue
