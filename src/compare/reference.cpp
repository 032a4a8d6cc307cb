#include "compare/reference.h"

#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

#include "image/denoiser.h"
#include "image/image_io.h"
#include "math/content_hash.h"
#include "render/warnings.h"
#include "system/failure.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// Version of cached references; increased when older ones can no longer be used.
constexpr uint64_t kFormat = 3;
/// Unlikely as a seed on the command line, so that no method shares the reference's random numbers.
constexpr uint64_t kSeed = 0x7265666572656e63;

double number(const Image& image, const std::string& name) {
    const auto found = image.attributes.find("etendue." + name);
    if (found == image.attributes.end()) return 0;
    const double* value = std::get_if<double>(&found->second);
    return value ? *value : 0;
}

std::string text(const Image& image, const std::string& name) {
    const auto found = image.attributes.find("etendue." + name);
    if (found == image.attributes.end()) return "";
    const std::string* value = std::get_if<std::string>(&found->second);
    return value ? *value : "";
}

std::vector<Rgb> mean_of(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    std::vector<Rgb> mean(a.size());
    for (size_t i = 0; i < a.size(); ++i) mean[i] = (a[i] + b[i]) * 0.5f;
    return mean;
}

bool has(const Image& image, const std::string& name) {
    return image.attributes.contains("etendue." + name);
}

/// Reference::mean_error of an image that was read.
SquaredError error_of_mean(const Image& image) {
    if (has(image, "mean_relative_error_dof"))
        return {sqr(number(image, "mean_relative_error")),
                number(image, "mean_relative_error_dof")};
    const double mean = number(image, "mean_luminance");
    if (!(mean > 0)) return {};
    // Images of earlier versions have an error without the number of its values, and 0 for an unknown one.
    const double count =
        number(image, has(image, "mean_luminance_count") ? "mean_luminance_count" : "spp");
    if (!has(image, "mean_luminance_standard_error") || !(count > 1)) return kUnknownError;
    return {sqr(number(image, "mean_luminance_standard_error") / mean), count - 1};
}

/// Of the mean of two renderings. If they are too short, the difference between them remains.
SquaredError error_of_halves(const Film::MeanEstimate (&halves)[2]) {
    const double mean = (halves[0].mean + halves[1].mean) / 2;
    if (!(mean > 0)) return kUnknownError;
    SquaredError errors[2];
    for (int i = 0; i < 2; ++i) {
        const Film::MeanEstimate& half = halves[i];
        if (!half.standard_error) return {sqr((halves[0].mean - halves[1].mean) / 2 / mean), 1};
        errors[i] = {sqr(*half.standard_error / 2 / mean), double(half.count - 1)};
    }
    return sum(errors);
}

/// (X − R − σ)(X − R + σ) = (X − R)² − σ².
void add_standard_error(Reference& r, const std::vector<Rgb>& variance) {
    r.first = r.second = r.pixels;
    for (size_t i = 0; i < variance.size(); ++i) {
        const Rgb sigma = sqrt(variance[i]);
        r.first[i] = r.pixels[i] - sigma;
        r.second[i] = r.pixels[i] + sigma;
    }
}

std::string cache_file(const FilmGeometry& film, const ReferenceSettings& settings) {
    ContentHash hash;
    hash.add(kFormat).add(settings.scene).add(settings.program);
    for (int v : {film.width, film.height, film.crop_x, film.crop_y, film.crop_width,
                  film.crop_height, int(settings.render.sampler)})
        hash.add(uint64_t(v));
    hash.add(settings.render.integrator.to_string());
    const PathSelection& shown = settings.render.shown;
    hash.add(uint64_t(shown.inner_only)).add(uint64_t(shown.shortest)).add(uint64_t(shown.longest));
    return (fs::path(settings.folder) / fmt::format("reference-{:016x}.exr", hash.value()))
        .string();
}

bool is_long_enough(const Reference& r, const RenderLimits& limits) {
    // A rendering may end up to one pass before its limit.
    return (!limits.spp || r.spp >= *limits.spp) &&
           (!limits.seconds || r.seconds >= 0.95 * *limits.seconds);
}

void write_reference(const Reference& r, const RenderStats& stats) {
    Image image = rgb_image(r.width, r.height, r.pixels);
    add_rgb_layer(image, r.width, r.height, "first", r.first);
    add_rgb_layer(image, r.width, r.height, "second", r.second);
    image.attributes["etendue.integrator"] = r.method;
    image.attributes["etendue.seconds"] = r.seconds;
    image.attributes["etendue.spp"] = double(r.spp);
    image.attributes["etendue.mean_relative_error"] = std::sqrt(r.mean_error.value);
    image.attributes["etendue.mean_relative_error_dof"] = r.mean_error.dof;
    // Named as in images that `render` writes.
    image.attributes["etendue.rejected_contributions"] = double(stats.rejected);
    image.attributes["etendue.runaways"] = double(stats.runaways);
    image.attributes["etendue.bounds_exceeded"] = double(stats.bounds_exceeded);
    write_image(r.file, image);
}

}  // namespace

Reference read_reference(const std::string& file, const FilmGeometry& geometry) {
    const Image image = read_image(file);
    refuse_denoised_reference(file, image);
    if (image.width != geometry.crop_width || image.height != geometry.crop_height)
        throw std::runtime_error(fmt::format(
            "reference {} has {} x {} pixels, but the scene is rendered with {} x {}", file,
            image.width, image.height, geometry.crop_width, geometry.crop_height));
    Reference r;
    r.file = file;
    r.width = image.width;
    r.height = image.height;
    r.pixels = rgb_pixels(image);
    r.method = text(image, "integrator");
    r.seconds = number(image, "seconds");
    r.spp = uint64_t(number(image, "spp"));
    r.mean_error = error_of_mean(image);
    RenderStats stats;
    stats.rejected = uint64_t(number(image, "rejected_contributions"));
    stats.runaways = uint64_t(number(image, "runaways"));
    stats.bounds_exceeded = uint64_t(number(image, "bounds_exceeded"));
    r.warnings = warnings(stats);
    if (image.channel("first.R") >= 0 && image.channel("second.R") >= 0) {
        r.first = rgb_pixels(image, "first");
        r.second = rgb_pixels(image, "second");
    } else if (image.channel("variance.R") >= 0) {
        add_standard_error(r, rgb_pixels(image, "variance"));
    }
    return r;
}

std::optional<Reference> make_reference(const Scene& scene, const ReferenceSettings& settings,
                                        const std::function<void(const Progress&)>& progress,
                                        const std::atomic<bool>& interrupted) {
    const std::string file = cache_file(scene.film(), settings);
    std::string damage;
    if (fs::exists(file)) {
        try {
            Reference kept = read_reference(file, scene.film());
            kept.reused = true;
            if (kept.has_variance() && is_long_enough(kept, settings.render)) return kept;
        } catch (const std::runtime_error& e) {
            damage = fmt::format(
                "the reference that was kept is damaged and was rendered again ({})", e.what());
        }
    }
    Reference r;
    r.file = file;
    r.width = scene.film().crop_width;
    r.height = scene.film().crop_height;
    r.method = settings.render.integrator.to_string();
    Film::MeanEstimate means[2];
    RenderStats stats;
    for (int i = 0; i < 2; ++i) {
        RenderSettings half = settings.render;
        half.seed = kSeed + uint64_t(i);
        if (half.spp) half.spp = (*half.spp + 1) / 2;
        if (half.seconds) half.seconds = *half.seconds / 2;
        Renderer renderer(scene, half);
        if (renderer.run(progress, interrupted) == StopReason::Interrupted) return {};
        (i == 0 ? r.first : r.second) = renderer.film().image();
        r.seconds += renderer.seconds();
        r.spp += renderer.film().passes();
        stats += renderer.stats();
        means[i] = renderer.film().mean_luminance();
    }
    r.pixels = mean_of(r.first, r.second);
    r.mean_error = error_of_halves(means);
    r.warnings = warnings(stats);
    // Otherwise, it serves this comparison all the same.
    const std::string failure = failure_of([&] { write_reference(r, stats); });
    if (!failure.empty())
        r.warnings.push_back(fmt::format("the reference cannot be kept: {}", failure));
    if (!damage.empty()) r.warnings.push_back(damage);
    return r;
}

}  // namespace etendue
