#pragma once
// Noise as bytes and as a JPEG file.

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <string>

#include <jpeglib.h>

#include "math/hash.h"

namespace etendue::test {

inline std::string noise(size_t bytes) {
    std::string all(bytes, '\0');
    for (size_t i = 0; i < bytes; ++i) all[i] = char(mix64(i));
    return all;
}

/// A square image with 1 channel or 3.
inline std::string jpeg_of_noise(unsigned size, int channels, bool is_progressive) {
    jpeg_compress_struct info{};
    jpeg_error_mgr errors;
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    unsigned char* at = nullptr;
    unsigned long bytes = 0;
    jpeg_mem_dest(&info, &at, &bytes);
    info.image_width = info.image_height = size;
    info.input_components = channels;
    info.in_color_space = channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&info);
    if (is_progressive) jpeg_simple_progression(&info);
    jpeg_start_compress(&info, TRUE);
    std::string row = noise(size_t(size) * size_t(channels));
    for (unsigned y = 0; y < size; ++y) {
        auto* values = reinterpret_cast<unsigned char*>(row.data());
        jpeg_write_scanlines(&info, &values, 1);
    }
    jpeg_finish_compress(&info);
    const std::string all(reinterpret_cast<const char*>(at), bytes);
    jpeg_destroy_compress(&info);
    std::free(at);
    return all;
}

}  // namespace etendue::test
