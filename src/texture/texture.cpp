#include "texture/texture.h"

#include <algorithm>

namespace etendue {

TextureEntry bitmap_entry();
TextureEntry checkerboard_entry();
TextureEntry scale_entry();
TextureEntry mix_entry();
TextureEntry bilerp_entry();
TextureEntry gridtexture_entry();
TextureEntry mesh_attribute_entry();
TextureEntry roughness_to_alpha_entry();
TextureEntry threshold_entry();
TextureEntry specular_to_metallic_entry();
TextureEntry sheen_to_fuzz_entry();
TextureEntry dots_entry();
TextureEntry checkerboard3d_entry();
TextureEntry fbm_entry();
TextureEntry wrinkled_entry();
TextureEntry windy_entry();
TextureEntry marble_entry();

namespace {

/// The gradient of `value(point)`.
template <class Gradient, class Point, class Value>
Gradient differences(const Texture& texture, const Point& at, const Value& value) {
    int width, height;
    texture.resolution(width, height);
    const Vec2 h = {0.1f / float(width), 0.1f / float(height)};
    return {(value(at.moved({h.x, 0})) - value(at.moved({-h.x, 0}))) / (2 * h.x),
            (value(at.moved({0, h.y})) - value(at.moved({0, -h.y}))) / (2 * h.y)};
}

}  // namespace

Vec2 Texture::gradient(const TexturePoint& at) const {
    return differences<Vec2>(*this, at, [&](const TexturePoint& p) { return eval_scalar(p); });
}

Vec2Dual Texture::gradient_jet(const TextureJetPoint& at) const {
    return differences<Vec2Dual>(*this, at,
                                 [&](const TextureJetPoint& p) { return scalar_jet(p); });
}

void refine(int& width, int& height, std::initializer_list<const TextureRef*> textures) {
    for (const TextureRef* texture : textures) {
        int w, h;
        texture->resolution(w, h);
        width = std::max(width, w);
        height = std::max(height, h);
    }
}

const std::vector<TextureEntry>& texture_registry() {
    static const std::vector<TextureEntry> entries = {bitmap_entry(),
                                                      checkerboard_entry(),
                                                      gridtexture_entry(),
                                                      scale_entry(),
                                                      mix_entry(),
                                                      bilerp_entry(),
                                                      mesh_attribute_entry(),
                                                      roughness_to_alpha_entry(),
                                                      threshold_entry(),
                                                      specular_to_metallic_entry(),
                                                      sheen_to_fuzz_entry(),
                                                      dots_entry(),
                                                      checkerboard3d_entry(),
                                                      fbm_entry(),
                                                      wrinkled_entry(),
                                                      windy_entry(),
                                                      marble_entry()};
    return entries;
}

}  // namespace etendue
