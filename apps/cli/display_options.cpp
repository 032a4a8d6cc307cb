#include "display_options.h"

#include <charconv>
#include <cmath>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "image/image_io.h"
#include "number_checks.h"
#include "usage_error.h"

namespace etendue {
namespace {

const char* const kOperators = "aces, reinhard, or srgb, which only clamps";
const char* const kAuto = "auto";

}  // namespace

void DisplayOptions::add_to(CLI::App& command) {
    command
        .add_option("--exposure", exposure,
                    "Exposure of a .png, in stops, or auto: by the brightness of the image")
        ->capture_default_str();
    command.add_option("--tone", op, fmt::format("Tone mapping of a .png: {}", kOperators))
        ->capture_default_str()
        ->check(CLI::IsMember({"aces", "reinhard", "srgb"}));
}

void DisplayOptions::add_to_tonemap(CLI::App& command) {
    exposure = "0";
    command.add_option("--operator,--tone", op, kOperators)
        ->capture_default_str()
        ->check(CLI::IsMember({"aces", "reinhard", "srgb"}));
    command
        .add_option("--exposure", exposure,
                    "Exposure in stops, or auto: by the brightness of the image")
        ->capture_default_str();
    command
        .add_option("--white", white,
                    "Luminance mapped to white by reinhard; 0: the largest in the image")
        ->capture_default_str()
        ->check(must_be_at_least_0);
}

std::optional<float> DisplayOptions::stops() const {
    if (exposure == kAuto) return {};
    float value = 0;
    const char* const end = exposure.data() + exposure.size();
    // from_chars() takes no plus sign.
    const char* const begin = exposure.data() + (exposure.starts_with('+') ? 1 : 0);
    const auto [at, error] = std::from_chars(begin, end, value);
    if (error != std::errc() || at != end || !std::isfinite(value))
        throw UsageError(
            fmt::format("--exposure must be a number of stops or auto, but is \"{}\"", exposure));
    return value;
}

ToneMapping DisplayOptions::mapping(std::span<const Rgb> pixels) const {
    const std::optional<float> given = stops();
    return {*tone_operator(op), given ? *given : auto_exposure(pixels), white};
}

void DisplayOptions::write(const std::string& path, const Image& image) const {
    if (image_extension(path) != ".png") return write_image(path, image);
    const std::vector<Rgb> pixels = rgb_pixels(image);
    write_image(path, rgb_image(image.width, image.height, tone_map(pixels, mapping(pixels))));
}

}  // namespace etendue
