#pragma once

#include <nlohmann/json_fwd.hpp>

#include "image/metrics.h"

namespace etendue {

/// All errors by name, as printed by `compare` and `diff`.
nlohmann::ordered_json to_json(const ImageErrors& e);

}  // namespace etendue
