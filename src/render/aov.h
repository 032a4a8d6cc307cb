#pragma once
// Auxiliary images of the first visible surface at each pixel.

#include <functional>
#include <string>
#include <vector>

#include "pathspace/vertex.h"

namespace etendue {

struct AovInfo {
    const char* name;
    const char* doc;
};
/// All auxiliary images. `variance` is computed from the passes, the others from first hits.
const std::vector<AovInfo>& aov_registry();

/// Throws std::runtime_error where a name is not in the registry.
void check_aovs(const std::vector<std::string>& names);

struct AovImage {
    std::string name;
    std::vector<Rgb> pixels;
};
/// Eye rays per pixel for the layers of an image.
inline constexpr int kAovSamples = 16;
/// Averages over `samples` eye rays per pixel, each of which contributes to all pixels that the film's filter reaches, for
/// `layers` images: `value(z, layer)` of a ray whose first surface is z_1, 0 of others.
using FirstHitValue = std::function<Rgb(const SubPath& z, size_t layer)>;
std::vector<std::vector<Rgb>> average_first_hits(const Scene& scene, size_t layers, int samples,
                                                 uint64_t seed, int threads,
                                                 const FirstHitValue& value);
/// Averages over `samples` eye rays per pixel for each name except `variance`.
std::vector<AovImage> render_aovs(const Scene& scene, const std::vector<std::string>& names,
                                  int samples, uint64_t seed, int threads);

}  // namespace etendue
