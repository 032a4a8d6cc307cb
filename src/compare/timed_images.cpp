#include "compare/timed_images.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "image/radiance_file.h"

namespace etendue {
namespace {

/// Whether the number that begins there is a whole one: "-" or "_" stands before it, or nothing. In 2,5 and 1.2e-03 it is
/// only the end of another.
bool is_whole_number(std::string_view text, size_t begin) {
    if (begin == 0) return true;
    const char before = text[begin - 1];
    const bool follows_exponent =
        before == '-' && begin >= 3 && (text[begin - 2] == 'e' || text[begin - 2] == 'E') &&
        std::string_view("0123456789.").find(text[begin - 3]) != std::string_view::npos;
    return (before == '-' || before == '_') && !follows_exponent;
}

/// Removes "NUMBERunit", and "-" or "_" before it, from the end of the text and returns the number; empty, and the text
/// unchanged, where it does not end so.
std::optional<double> take_number(std::string& text, std::string_view unit) {
    if (!text.ends_with(unit)) return {};
    const std::string_view rest = std::string_view(text).substr(0, text.size() - unit.size());
    const size_t begin = rest.find_last_not_of("0123456789.") + 1;
    if (!is_whole_number(rest, begin)) return {};
    double value = 0;
    const auto [end, error] =
        std::from_chars(rest.data() + begin, rest.data() + rest.size(), value);
    if (error != std::errc() || end != rest.data() + rest.size()) return {};
    text.resize(begin == 0 ? 0 : begin - 1);
    return value;
}

/// The run that a file name names, with the rest of the name in `file`.
std::string run_of(TimedImages::File& file) {
    std::string stem = std::filesystem::path(file.path).stem().string();
    const std::optional<double> seconds = take_number(stem, "s");
    if (!seconds || !(*seconds > 0))
        throw std::runtime_error(
            fmt::format("{}: expected a name that ends with the rendering time in seconds, after - "
                        "or _, such as seed1-64spp-2.5s.exr",
                        file.path));
    file.seconds = *seconds;
    if (const auto spp = take_number(stem, "spp"); spp && *spp >= 1) {
        if (!(*spp < 0x1p63))
            throw std::runtime_error(
                fmt::format("{}: too many samples per pixel: {:g}", file.path, *spp));
        file.spp = uint64_t(*spp);
    }
    return stem;
}

}  // namespace

TimedImages find_timed_images(const std::string& name, const std::string& folder,
                              const FilmGeometry& film) {
    std::map<std::string, std::vector<TimedImages::File>> runs;
    for (const std::string& path : radiance_files(folder)) {
        TimedImages::File file{.path = path};
        const std::string run = run_of(file);
        const RgbImage image = read_radiance(path);
        if (image.width != film.crop_width || image.height != film.crop_height)
            throw std::runtime_error(
                fmt::format("{}: has {} x {} pixels, but the scene has {} x {}", path, image.width,
                            image.height, film.crop_width, film.crop_height));
        runs[run].push_back(std::move(file));
    }
    TimedImages found{.name = name, .folder = folder, .runs = {}};
    for (auto& [run, files] : runs) {
        std::ranges::sort(files, {}, &TimedImages::File::seconds);
        const auto same = std::ranges::adjacent_find(files, {}, &TimedImages::File::seconds);
        if (same != files.end())
            throw std::runtime_error(fmt::format("{} and {}: have the same time in the same run",
                                                 same->path, (same + 1)->path));
        found.runs.push_back(std::move(files));
    }
    return found;
}

}  // namespace etendue
