#pragma once

#include <vector>

#include "scene/scene.h"

namespace etendue {

/// Albedo times cosine of the first surface at every kFirstPictureStep-th pixel each way, to be shown until a pass ends.
inline constexpr int kFirstPictureStep = 4;
struct FirstPicture {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;
};
FirstPicture first_picture(const Scene& scene);

}  // namespace etendue
