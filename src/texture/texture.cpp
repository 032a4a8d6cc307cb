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

Vec2 Texture::gradient(const TexturePoint& at) const {
    int width, height;
    resolution(width, height);
    const Vec2 h = {0.1f / float(width), 0.1f / float(height)};
    return {(eval_scalar(at.moved({h.x, 0})) - eval_scalar(at.moved({-h.x, 0}))) / (2 * h.x),
            (eval_scalar(at.moved({0, h.y})) - eval_scalar(at.moved({0, -h.y}))) / (2 * h.y)};
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
