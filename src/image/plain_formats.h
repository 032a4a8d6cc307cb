#pragma once
// The readers of file formats that need no library.

#include "image/image_contents.h"

namespace etendue {

/// Radiance's format, .hdr [Ward 1991].
ImageContents read_rgbe(const ImageSource& source);
/// Portable float maps.
ImageContents read_pfm(const ImageSource& source);
/// Portable grey maps and pixmaps, .pgm and .ppm; binary numbers of 16 bits begin with the higher byte.
ImageContents read_pnm(const ImageSource& source);
/// The same as text.
ImageContents read_pnm_text(const ImageSource& source);

}  // namespace etendue
