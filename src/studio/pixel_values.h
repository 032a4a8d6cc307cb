#pragma once
// Values derived from the pixels of a snapshot: relative errors, and those of a rectangle.

#include <array>
#include <cstddef>
#include <vector>

#include "session/snapshot.h"
#include "studio/image_reply.h"

namespace etendue {

/// Relative standard error of each pixel's luminance.
std::vector<float> relative_errors(const Snapshot& s);

/// Calls use(index) for the pixels of a rectangle.
template <class Use>
void for_each_pixel(const ImageRect& r, int width, const Use& use) {
    for (int y = r.y; y < r.y + r.height; ++y)
        for (int x = r.x; x < r.x + r.width; ++x) use(size_t(y) * size_t(width) + size_t(x));
}

/// The pixels of a rectangle. Pixels that are not finite are counted, and otherwise left out.
struct RectangleValues {
    using Channels = std::array<double, 3>;
    size_t finite = 0, nan = 0, infinite = 0;
    Channels mean{}, least{}, largest{};
    Channels variance{};       ///< Of the pixels.
    Channels squared_error{};  ///< Of the mean, if the errors of pixels are independent.
};
RectangleValues values_in(const Snapshot& s, const ImageRect& rect);

}  // namespace etendue
