#pragma once
// The file formats of image_io.h that need a library. There are two implementations: over OpenImageIO, and a small one.

#include <span>

#include "image/atomic_file.h"
#include "image/image_io.h"

namespace etendue {

// read_image(), read_pixels() and encode_png() of image_io.h, and:

/// Stores all channels and attributes; `image` has any channels.
void write_exr(const PendingFile& file, const Image& image, ExrPrecision precision);
/// Radiance's format, ".hdr".
void write_rgbe(const PendingFile& file, int width, int height, std::span<const Rgb> pixels);
/// Three sRGB codes a pixel.
void write_png(const PendingFile& file, int width, int height, std::span<const uint8_t> codes);

}  // namespace etendue
