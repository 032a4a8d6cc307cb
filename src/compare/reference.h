#pragma once
// References: images that methods are compared with, read from files or rendered, and their uncertainty.

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "description/fingerprint.h"
#include "math/statistics.h"
#include "render/renderer.h"

namespace etendue {

struct Reference {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;
    /// Two images with mean `pixels` for which E[(X − first)(X − second)] does not contain the reference's variance:
    /// independent halves, or `pixels` ± standard error. Empty where the variance is unknown.
    std::vector<Rgb> first, second;
    /// Square of the relative standard error of the mean luminance; 0 for images of other programs, which are compared as
    /// if they were exact, and infinite where a rendering of this program is too short to tell.
    SquaredError mean_error;
    std::string file;    ///< The file that it was read from or is cached in.
    std::string method;  ///< The integrator that rendered it; empty where it is unknown.
    double seconds = 0;
    uint64_t spp = 0;
    bool reused = false;                ///< Whether it was cached by an earlier comparison.
    std::vector<std::string> warnings;  ///< See render/warnings.h.

    bool has_variance() const { return !first.empty(); }
    /// i = 0: second argument of image_errors(); i = 1: its ErrorOptions::reference2.
    const std::vector<Rgb>& half(int i) const {
        return !has_variance() ? pixels : i == 0 ? first : second;
    }
};

/// Reads an image of the size of the scene's crop. Its uncertainty comes from the layers "first" and "second" (of
/// cached references) or "variance" (written by `render --aov variance`). Throws std::runtime_error.
Reference read_reference(const std::string& file, const FilmGeometry& geometry);

/// A reference is the mean of two independent renderings, each with half the time or half the samples.
struct ReferenceSettings {
    RenderSettings render;  ///< The seed is not used.
    std::string folder;     ///< The cache; file names are hashes of scene, program and settings.
    uint64_t scene;         ///< See scene_fingerprint().
    uint64_t program;       ///< See program_fingerprint().
};
/// The cached reference, if the same program rendered it from the same scene with the same settings and at least the
/// same time or samples; otherwise a new one, which is cached. Empty where `interrupted` was set.
std::optional<Reference> make_reference(const Scene& scene, const ReferenceSettings& settings,
                                        const std::function<void(const Progress&)>& progress,
                                        const std::atomic<bool>& interrupted);

}  // namespace etendue
