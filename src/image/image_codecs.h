#pragma once
// The file formats of image_io.h that need a library.

#include "image/image_io.h"
#include "system/output_file.h"

namespace etendue {

// read_image(), decode_image(), read_pixels(), decode_pixels() and encode_png() of image_io.h, and:

/// Stores all channels and attributes; `image` has any channels. Errors of the file are left to its commit().
void write_exr(OutputFile& file, const ImageRows& image, const WriteOptions& options);
/// Stores the colours as write_image() does.
void write_png(OutputFile& file, const ImageRows& image, const WriteOptions& options);

}  // namespace etendue
