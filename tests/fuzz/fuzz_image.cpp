// Any bytes as an image: pixels or a std::runtime_error.

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "fuzz_target.h"
#include "image/image_io.h"
#include "jpeg_of_noise.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view bytes) {
    for (const bool raw : {false, true}) {
        try {
            const PixelBuffer p = decode_pixels(std::string(bytes), "fuzz", raw);
            const size_t values = size_t(p.width) * size_t(p.height) * size_t(p.channels);
            require(p.width > 0 && p.height > 0 && p.channels > 0);
            std::visit([&](const auto& data) { require(data.size() == values); }, p.data);
        } catch (const std::runtime_error&) {
        }
    }
}

/// An image in each format that can be written.
std::vector<std::string> seeds() {
    Image image;
    image.width = 16, image.height = 5;
    image.channels = {"R", "G", "B"};
    for (int i = 0; i < 16 * 5 * 3; ++i) image.data.push_back(float(i) * 0.01f);
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("fuzz-image-" + std::to_string(getpid()));
    std::vector<std::string> files = {test::jpeg_of_noise(16, 3, false)};
    for (const char* extension : {".exr", ".pfm", ".hdr", ".png"}) {
        const std::string name = (folder / ("image" + std::string(extension))).string();
        write_image(name, image);
        std::ifstream in(name, std::ios::binary);
        files.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    }
    std::filesystem::remove_all(folder);
    const std::string zeros(16 * 5 * 3, '\0');
    files.push_back(std::string("\0\0\2\0\0\0\0\0\0\0\0\0\20\0\5\0\30\0", 18) + zeros);  // TGA
    files.push_back(std::string("\0\0\12\0\0\0\0\0\0\0\0\0\20\0\5\0\40\10", 18) +
                    zeros);  // with runs
    files.push_back(
        std::string("BM\46\1\0\0\0\0\0\0\66\0\0\0\50\0\0\0\20\0\0\0\5\0\0\0\1\0\30\0", 30) +
        std::string(24, '\0') + zeros);  // BMP
    files.push_back("P6\n16 5\n255\n" + zeros);
    files.push_back("P5\n16 5\n65535\n" + zeros);
    return files;
}

const Register kRegister({.name = "image", .run = run, .seeds = seeds, .mutations = 500});

}  // namespace
}  // namespace etendue::fuzz
