#include "texture/texture.h"

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

Vec2 Texture::gradient(const TexturePoint& at) const {
    const Vec2 uv = at.uv;
    int width, height;
    resolution(width, height);
    const Vec2 h = {0.1f / float(width), 0.1f / float(height)};
    return {(eval_scalar({uv.x + h.x, uv.y}) - eval_scalar({uv.x - h.x, uv.y})) / (2 * h.x),
            (eval_scalar({uv.x, uv.y + h.y}) - eval_scalar({uv.x, uv.y - h.y})) / (2 * h.y)};
}

const std::vector<TextureEntry>& texture_registry() {
    static const std::vector<TextureEntry> entries = {
        bitmap_entry(),   checkerboard_entry(), gridtexture_entry(),    scale_entry(),
        mix_entry(),      bilerp_entry(),       mesh_attribute_entry(), roughness_to_alpha_entry(),
        threshold_entry()};
    return entries;
}

}  // namespace etendue
