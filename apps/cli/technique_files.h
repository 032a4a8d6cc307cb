#pragma once

#include <string>

#include "render/technique_images.h"

namespace etendue {

/// Writes the images of all techniques, weighted and unweighted, into a folder.
void write_techniques(const TechniqueImages& images, const FilmGeometry& film,
                      const std::string& folder);

}  // namespace etendue
