// Veined marble in space, like `marble` of pbrt-v4: sine waves along y, perturbed by noise, through a spline of colours.
//   octaves (8), roughness (0.5)   of the noise, as for fbm
//   scale (1)                      factor of the coordinates
//   variation (0.2)                factor of the noise in the phase
//   to_texture (identity)          from the world to the space of the pattern

#include <algorithm>
#include <array>
#include <cmath>

#include "texture/noise.h"
#include "texture/solid.h"

namespace etendue {
namespace {

/// Colour of marble at t in [0, 1]: six cubic Bézier segments, each with four adjacent control points.
Rgb marble_colour(float t) {
    const Rgb stone(0.58f, 0.58f, 0.6f), grey(0.5f), warm(0.6f, 0.59f, 0.58f),
        vein(0.2f, 0.2f, 0.33f);
    const std::array<Rgb, 9> control = {stone, stone, stone, grey, warm, stone, stone, vein, stone};
    constexpr int kSegments = int(control.size()) - 3;
    const int first = std::clamp(int(t * kSegments), 0, kSegments - 1);
    const float x = t * kSegments - float(first);
    const Rgb* c = &control[size_t(first)];
    const Rgb b = c[0] * ((1 - x) * (1 - x) * (1 - x)) + c[1] * (3 * x * (1 - x) * (1 - x)) +
                  c[2] * (3 * x * x * (1 - x)) + c[3] * (x * x * x);
    return b * 1.5f;
}

class Marble final : public SolidTexture {
public:
    explicit Marble(const Params& params)
        : SolidTexture(params), octaves_(int(params.integer("octaves", 8, 1, 64))),
          omega_(params.number("roughness", 0.5f, 0, 1)), scale_(params.number("scale", 1)),
          variation_(params.number("variation", 0.2f)) {}

    Rgb eval(const TexturePoint& at) const override {
        const Vec3 p = point(at) * scale_;
        const float phase = p.y + variation_ * fbm(p, omega_, octaves_);
        return marble_colour(0.5f + 0.5f * std::sin(phase));
    }
    Rgb mean() const override { return Rgb(0.78f); }  // roughly

    static TextureEntry entry() {
        return {{"texture",
                 "marble",
                 "Veined marble in space.",
                 {{"octaves", ParamKind::Int, "8", "Number of octaves of noise, 1 to 64."},
                  {"roughness", ParamKind::Float, "0.5",
                   "Amplitude of an octave divided by that of the previous one, in [0, 1]."},
                  {"scale", ParamKind::Float, "1", "Factor on the coordinates."},
                  {"variation", ParamKind::Float, "0.2", "Factor on the noise in the phase."},
                  to_texture_info()}},
                [](const Params& params, TextureContext&) -> std::unique_ptr<Texture> {
                    return std::make_unique<Marble>(params);
                },
                true};
    }

private:
    int octaves_;
    float omega_, scale_, variation_;
};

}  // namespace

TextureEntry marble_entry() {
    return Marble::entry();
}

}  // namespace etendue
