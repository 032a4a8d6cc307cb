#include "verify/reference_image.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "image/denoiser.h"
#include "image/image_io.h"

namespace etendue {
namespace {

/// Largest (Σ|h|)² / Σ h² over sub-pixel offsets, h being the filter's values at the pixels around a splat: the number
/// of pixels over which a splat spreads its error, at most.
double filter_correlation(const ReconstructionFilter& filter) {
    const auto of = [&](float x, float y) {
        double sum = 0, squares = 0;
        const int r = int(std::ceil(filter.radius())) + 1;
        for (int v = -r; v <= r; ++v)
            for (int u = -r; u <= r; ++u) {
                const double h = std::fabs(double(filter.eval({x - float(u), y - float(v)})));
                sum += h, squares += h * h;
            }
        return squares > 0 ? sum * sum / squares : 1.0;
    };
    double largest = 1;
    for (const float x : {0.0f, 0.25f, 0.499f})
        for (const float y : {0.0f, 0.25f, 0.499f}) largest = std::max(largest, of(x, y));
    return largest;
}

/// Ratio of the variance of the image's mean to that of independent pixels. Pixels are correlated by splats, which the
/// filter spreads, and by light paths, which many pixels share. The spread of the passes' means includes both
/// (attribute "etendue.mean_luminance_standard_error"). Without that attribute only the filter is accounted for.
double pixel_correlation(const Image& image, const std::vector<Rgb>& variance, const Scene& scene) {
    double correlation = filter_correlation(scene.filter());
    const auto error = image.attributes.find("etendue.mean_luminance_standard_error");
    const auto* standard_error =
        error == image.attributes.end() ? nullptr : std::get_if<double>(&error->second);
    // Images of earlier versions have 0 where it is unknown.
    if (!standard_error || *standard_error == 0) return correlation;
    // Channels are positively correlated, so this underestimates the error of luminance, and the factor is never too
    // small.
    const float r = luminance({1, 0, 0}), g = luminance({0, 1, 0}), b = luminance({0, 0, 1});
    double independent = 0;
    for (const Rgb& v : variance) independent += double(luminance({v.r * r, v.g * g, v.b * b}));
    independent /= sqr(double(variance.size()));
    return independent > 0 ? std::max(1.0, sqr(*standard_error) / independent) : correlation;
}

}  // namespace

ReferenceImage read_reference_image(const std::string& path, const Scene& scene) {
    const Image image = read_image(path);
    refuse_denoised_reference(path, image);
    const auto layers = image.layers();
    if (std::find(layers.begin(), layers.end(), "variance") == layers.end())
        throw std::runtime_error(fmt::format(
            "{}: expected a layer \"variance\" beside the image, as render --aov variance writes",
            path));
    const auto spp = image.attributes.find("etendue.spp");
    const auto* samples =
        spp == image.attributes.end() ? nullptr : std::get_if<double>(&spp->second);
    if (!samples || *samples < 2)
        throw std::runtime_error(fmt::format(
            "{}: expected the attribute \"etendue.spp\", samples per pixel, at least 2", path));
    const FilmGeometry& film = scene.film();
    if (image.width != film.crop_width || image.height != film.crop_height)
        throw std::runtime_error(fmt::format("{}: has {} x {} pixels, but the scene has {} x {}",
                                             path, image.width, image.height, film.crop_width,
                                             film.crop_height));
    ReferenceImage reference{path, rgb_pixels(image), rgb_pixels(image, "variance"),
                             int64_t(*samples)};
    reference.correlation = pixel_correlation(image, reference.variance, scene);
    return reference;
}

}  // namespace etendue
