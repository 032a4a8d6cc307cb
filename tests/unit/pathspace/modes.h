#pragma once

#include "bsdf/lobe.h"

namespace etendue {

/// The modes of the two walks, for tables by mode.
inline constexpr auto kEye = TransportMode::Radiance, kLight = TransportMode::Importance;

}  // namespace etendue
