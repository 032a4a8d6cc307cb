#pragma once

#include <string>

#include "render/technique_images.h"

namespace etendue {

/// Throws std::runtime_error unless images can be written into this folder now. Creates it if it is missing.
void check_technique_folder(const std::string& folder);

/// Writes the images of all techniques, weighted and unweighted, into a folder.
void write_techniques(const TechniqueImages& images, const FilmGeometry& film,
                      const std::string& folder);

}  // namespace etendue
