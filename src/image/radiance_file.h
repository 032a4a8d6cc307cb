#pragma once
// Images whose means are compared: of any program, in files that store radiance as it is.

#include <string>
#include <vector>

#include "image/image_io.h"

namespace etendue {

/// Reads the colours of an .exr or .pfm file; other formats round or clamp, which changes the mean. Throws
/// std::runtime_error where the image is denoised, has no channels R, G, B, or a pixel is not finite.
RgbImage read_radiance(const std::string& path);

/// Throws std::runtime_error, with the name of the image, where a pixel is not finite.
void check_finite(const std::string& name, const RgbImage& image);

/// Whether read_radiance() reads files of this name.
bool is_radiance_file(const std::string& path);

/// These files in a folder, sorted by name. Throws std::runtime_error where there is none.
std::vector<std::string> radiance_files(const std::string& folder);

}  // namespace etendue
