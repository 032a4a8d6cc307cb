#pragma once
// What methods are judged by: an image, read or rendered, and how uncertain it is.

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "description/scene_description.h"
#include "render/renderer.h"

namespace etendue {

struct Reference {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;
    /// Two images whose mean is `pixels` and whose product of differences to any X is, on average, free of the
    /// reference's variance: independent halves, or pixels ± standard error. Empty where the variance is not known.
    std::vector<Rgb> first, second;
    /// Relative standard error of the mean luminance; 0 where it is not known.
    double mean_relative_error = 0;
    std::string file;    ///< Where it was read from, or is kept.
    std::string method;  ///< Empty where it was given.
    double seconds = 0;
    uint64_t spp = 0;
    bool reused = false;  ///< From an earlier comparison.

    bool has_variance() const { return !first.empty(); }
    /// The second argument of image_errors(), and ErrorOptions::reference2 beside it.
    const std::vector<Rgb>& half(int i) const {
        return !has_variance() ? pixels : i == 0 ? first : second;
    }
};

/// Reads an image of the size of the scene's crop. Layers "first" and "second" (as references that are kept here have
/// them), or a layer "variance" (as `render --aov variance` writes it), tell its uncertainty. Throws std::runtime_error.
Reference read_reference(const std::string& file, const FilmGeometry& geometry);

/// Two independent renderings of half the time, or half the samples, each.
struct ReferenceSettings {
    RenderSettings render;  ///< Seeds are chosen here.
    std::string folder;     ///< Where references are kept, named by what they show.
    uint64_t scene;         ///< See scene_fingerprint().
    uint64_t program;       ///< See program_fingerprint().
};
/// The one that is kept, if the same program rendered it from the same scene with the same settings for at least as long,
/// else a new one; none where `interrupted` was set.
std::optional<Reference> make_reference(const Scene& scene, const ReferenceSettings& settings,
                                        const std::function<void(const Progress&)>& progress,
                                        const std::atomic<bool>& interrupted);

/// Hash of all that the scene's files say: the description, to the last bit, whatever files it was read from; and the
/// bytes of every mesh, texture and other file that it names.
uint64_t scene_fingerprint(const SceneDescription& description);
/// Hash of the running program: another build of it renders another image.
uint64_t program_fingerprint();

}  // namespace etendue
