#pragma once

#include <nlohmann/json_fwd.hpp>

#include "image/metrics.h"

namespace etendue {

/// All figures by name, as `compare` and `diff` write them.
nlohmann::ordered_json to_json(const ImageErrors& e);

}  // namespace etendue
