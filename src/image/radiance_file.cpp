#include "image/radiance_file.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "image/denoiser.h"

namespace etendue {

namespace fs = std::filesystem;

bool is_radiance_file(const std::string& path) {
    const std::string extension = image_extension(path);
    return extension == ".exr" || extension == ".pfm";
}

void check_finite(const std::string& name, const RgbImage& image) {
    const auto found =
        std::ranges::find_if(image.pixels, [](const Rgb& c) { return !is_finite(c); });
    if (found == image.pixels.end()) return;
    const auto at = found - image.pixels.begin();
    throw std::runtime_error(fmt::format("{}: pixel ({}, {}) is ({}, {}, {})", name,
                                         at % image.width, at / image.width, found->r, found->g,
                                         found->b));
}

RgbImage read_radiance(const std::string& path) {
    if (!is_radiance_file(path))
        throw std::runtime_error(fmt::format(
            "{}: expected an .exr or .pfm file; other formats round or clamp radiance", path));
    const Image image = read_image(path);
    if (is_denoised(image))
        throw std::runtime_error(
            fmt::format("{}: the image is denoised, which changes its mean", path));
    for (const char* name : {"R", "G", "B"})
        if (image.channel(name) < 0)
            throw std::runtime_error(fmt::format("{}: there are no channels R, G, B (but: {})",
                                                 path, fmt::join(image.channels, ", ")));
    RgbImage radiance{image.width, image.height, rgb_pixels(image)};
    check_finite(path, radiance);
    return radiance;
}

std::vector<std::string> radiance_files(const std::string& folder) {
    std::vector<std::string> files;
    std::error_code error;
    for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
        if (is_radiance_file(at->path().string()) && !at->is_directory())
            files.push_back(at->path().string());
    if (error) throw std::runtime_error(fmt::format("{}: {}", folder, error.message()));
    if (files.empty())
        throw std::runtime_error(fmt::format("{}: there is no .exr or .pfm file", folder));
    std::ranges::sort(files);
    return files;
}

}  // namespace etendue
