#include "display_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "image/image_io.h"
#include "number_checks.h"
#include "system/threads.h"
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

ToneCurve DisplayOptions::curve(std::vector<float> luminances) const {
    const float largest =
        luminances.empty() ? 0 : *std::max_element(luminances.begin(), luminances.end());
    const std::optional<float> given = stops();
    return {{*tone_operator(op), given ? *given : auto_exposure(std::move(luminances)), white},
            largest};
}

void DisplayOptions::write(const std::string& path, const ImageRows& image, int threads) const {
    if (image_extension(path) != ".png")
        return write_image(path, image, {.threads = thread_count(threads)});
    std::vector<float> luminances;
    luminances.reserve(size_t(image.width) * size_t(image.height));
    for_each_rgb_row(image, [&](int, std::span<const Rgb> row) {
        for (const float y : finite_luminances(row)) luminances.push_back(y);
    });
    const ToneCurve map = curve(std::move(luminances));
    const RgbChannels rgb = rgb_channels(image.channels);
    ImageRows mapped{image.width, image.height, {"R", "G", "B"}, {}, {}};
    std::vector<float> row(size_t(image.width) * image.channels.size());
    mapped.make = [&](int y, std::span<float> to) {
        image.make(y, row);
        for (size_t x = 0; x < size_t(image.width); ++x) {
            const Rgb c = map(rgb.of(&row[x * image.channels.size()]));
            for (int i = 0; i < 3; ++i) to[3 * x + size_t(i)] = c[i];
        }
    };
    write_image(path, mapped);
}

}  // namespace etendue
