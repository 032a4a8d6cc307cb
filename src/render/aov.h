#pragma once
// Auxiliary images: what the eye sees first at each pixel.

#include <string>
#include <vector>

#include "scene/scene.h"

namespace etendue {

struct AovInfo {
    const char* name;
    const char* doc;
};
/// Those that can be asked for; `variance` comes from the passes, the others from first hits.
const std::vector<AovInfo>& aov_registry();

/// Throws std::runtime_error where a name is not in the registry.
void check_aovs(const std::vector<std::string>& names);

struct AovImage {
    std::string name;
    std::vector<Rgb> pixels;
};
/// Eye rays a pixel for the layers of an image.
inline constexpr int kAovSamples = 16;
/// Averages of `samples` eye rays a pixel for each name (but `variance`).
std::vector<AovImage> render_aovs(const Scene& scene, const std::vector<std::string>& names,
                                  int samples, uint64_t seed, int threads);

}  // namespace etendue
