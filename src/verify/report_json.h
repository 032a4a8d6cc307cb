#pragma once

#include <nlohmann/json_fwd.hpp>

#include "verify/image_series.h"
#include "verify/verify.h"

namespace etendue {

/// All results of a verification, as `etendue verify --json` writes them.
nlohmann::ordered_json to_json(const VerifyReport& report, const Scene& scene,
                               const VerifyOptions& options);
/// Those of verify_images().
nlohmann::ordered_json to_json(const VerifyReport& report, const ImageSeries& images,
                               const ImageSeries& against, double alpha);

}  // namespace etendue
