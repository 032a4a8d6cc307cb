#include "verify/image_series.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "image/radiance_file.h"
#include "math/content_hash.h"

namespace etendue {
namespace {

uint64_t hash_of(const RgbImage& image) {
    const std::string_view bytes(reinterpret_cast<const char*>(image.pixels.data()),
                                 image.pixels.size() * sizeof(Rgb));
    return ContentHash().add(bytes).value();
}

bool is_black(const RgbImage& image) {
    return std::ranges::all_of(image.pixels, [](const Rgb& c) { return c.is_zero(); });
}

bool is_half(float v) {
    return float(Half(v)) == v;
}
bool is_half(const RgbImage& image) {
    return std::ranges::all_of(
        image.pixels, [](const Rgb& c) { return is_half(c.r) && is_half(c.g) && is_half(c.b); });
}

/// Independent contributions that explain the spread of a mean. A mean without any spread may be known exactly, such as the
/// radiance of a lamp; one of 0 has none.
double contributions(const Moments& m) {
    if (m.mean() == 0) return 0;
    return m.squared_error() > 0 ? m.mean() * m.mean() / m.squared_error()
                                 : std::numeric_limits<double>::infinity();
}

void check(const ImageSeries& series) {
    if (series.count() < 2)
        throw std::runtime_error(fmt::format(
            "{}: expected at least two independent images, from which their spread is known",
            series.count() == 0 ? "no images" : series.describe()));
}

}  // namespace

void ImageSeries::add(const std::string& name, const RgbImage& image) {
    if (first_.empty()) {
        first_ = name;
        grid_.film.width = grid_.film.crop_width = image.width;
        grid_.film.height = grid_.film.crop_height = image.height;
        grid_.count = std::min({tiles_, image.width, image.height});
        moments_.resize(grid_.tiles() + 1);
    } else if (image.width != width() || image.height != height()) {
        throw std::runtime_error(fmt::format("{}: has {} x {} pixels, but {} has {} x {}", name,
                                             image.width, image.height, first_, width(), height()));
    }
    // Of rare light, independent images may be black.
    if (!is_black(image)) {
        const auto [same, is_new] = names_.emplace(hash_of(image), name);
        if (!is_new)
            throw std::runtime_error(
                fmt::format("{}: has the same pixels as {}; the images must be independent, each "
                            "with its own seed",
                            name, same->second));
    }
    is_half_ = is_half_ && is_half(image);
    add_run(tile_means(image.pixels, grid_), moments_);
}

void ImageSeries::add_files(const std::vector<std::string>& files) {
    for (const std::string& file : files) {
        if (!std::filesystem::exists(file))
            throw std::runtime_error(fmt::format("{}: there is no such file or folder", file));
        if (!std::filesystem::is_directory(file))
            add(file, read_radiance(file));
        else
            for (const std::string& f : radiance_files(file)) add(f, read_radiance(f));
    }
}

std::string ImageSeries::describe() const {
    if (count() == 1) return first_;
    return fmt::format("{} and {} more", first_, count() - 1);
}

VerifyReport verify_images(const ImageSeries& images, const ImageSeries& against, double alpha) {
    for (const ImageSeries* s : {&images, &against}) check(*s);
    if (images.width() != against.width() || images.height() != against.height())
        throw std::runtime_error(fmt::format("{}: has {} x {} pixels, but {} has {} x {}",
                                             images.first_, images.width(), images.height(),
                                             against.first_, against.width(), against.height()));
    for (const ImageSeries* s : {&images, &against})
        if (std::ranges::all_of(s->moments_.back(), [](const Moments& m) {
                return m.mean() == 0 && m.squared_error() == 0;
            }))
            throw std::runtime_error(fmt::format("{}: all images are black", s->describe()));
    for (const auto& [hash, name] : images.names_)
        if (const auto same = against.names_.find(hash); same != against.names_.end())
            throw std::runtime_error(
                fmt::format("{}: has the same pixels as {}; the images must be independent, each "
                            "with its own seed",
                            name, same->second));

    VerifyReport report;
    report.reference = against.describe();
    MethodReport& m = report.methods.emplace_back();
    m.method = images.describe();
    std::vector<double> counts(images.moments_.size(), std::numeric_limits<double>::infinity());
    for (size_t i = 0; i < counts.size(); ++i)
        for (size_t k = 0; k < 3; ++k) {
            const Moments &a = images.moments_[i][k], &b = against.moments_[i][k];
            // A channel without light, such as blue under a red lamp, is not tested.
            if (a.mean() != 0 || b.mean() != 0)
                counts[i] = std::min({counts[i], contributions(a), contributions(b)});
        }
    const int halves = int(images.is_half_) + int(against.is_half_);
    compare_tiles(images.moments_, against.moments_, counts, images.grid_, m,
                  WelchTest::kRounding + halves * WelchTest::kHalfRounding);
    m.for_each_tested([&](const WelchTest&) { ++report.tests; });
    report.level = sidak(alpha, std::max(1, report.tests));
    return report;
}

}  // namespace etendue
