#pragma once

#include <string>

#include "verify/verify.h"

namespace etendue {

/// Reads an image with a layer "variance", as `render --aov variance` writes it. Throws std::runtime_error where it is
/// another, or of another size than the scene's crop.
ReferenceImage read_reference_image(const std::string& path, const Scene& scene);

}  // namespace etendue
