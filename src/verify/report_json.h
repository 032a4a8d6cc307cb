#pragma once

#include <nlohmann/json_fwd.hpp>

#include "verify/verify.h"

namespace etendue {

/// All results of a verification, as `etendue verify --json` writes them. `sampler` is the name of the sampler.
nlohmann::ordered_json to_json(const VerifyReport& report, const Scene& scene,
                               const std::string& sampler, const VerifyOptions& options);

}  // namespace etendue
