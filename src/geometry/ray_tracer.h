#pragma once

#include <string>

namespace etendue {

/// The library that traces rays, its version and its settings, on which the last bits of hits depend.
std::string ray_tracer();

}  // namespace etendue
