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

/// Removes "NUMBERunit" from the end of the text and returns the number; empty, and the text unchanged, where it does not
/// end so.
std::optional<double> take_number(std::string& text, std::string_view unit) {
    if (!text.ends_with(unit)) return {};
    const std::string_view rest = std::string_view(text).substr(0, text.size() - unit.size());
    const size_t begin = rest.find_last_not_of("0123456789.") + 1;
    double value = 0;
    const auto [end, error] =
        std::from_chars(rest.data() + begin, rest.data() + rest.size(), value);
    if (error != std::errc() || end != rest.data() + rest.size()) return {};
    text.resize(begin);
    // Separates it from what stands before.
    if (text.ends_with('-') || text.ends_with('_')) text.pop_back();
    return value;
}

/// The run that a file name names, with the rest of the name in `file`.
std::string run_of(TimedImages::File& file) {
    std::string stem = std::filesystem::path(file.path).stem().string();
    const std::optional<double> seconds = take_number(stem, "s");
    if (!seconds || !(*seconds > 0))
        throw std::runtime_error(
            fmt::format("{}: expected a name that ends with the rendering time in seconds, such as "
                        "seed1-64spp-2.5s.exr",
                        file.path));
    file.seconds = *seconds;
    if (const auto spp = take_number(stem, "spp"); spp && *spp >= 1) file.spp = uint64_t(*spp);
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
