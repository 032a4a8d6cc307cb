#include "scene/plain_textures.h"

#include <algorithm>

#include <fmt/format.h>

namespace etendue {
namespace {

constexpr int kLargestBaked = 4096;

bool is_of_second_uvs(const SceneObject& o) {
    return o.type == "bitmap" && number(o, "uv_set", 0) != 0;
}

/// Whether a texture is a function of more than (u, v).
bool is_of_space(const SceneObject& o) {
    if (o.type == "mesh_attribute" || is_of_second_uvs(o)) return true;
    const auto& all = texture_registry();
    return std::any_of(all.begin(), all.end(),
                       [&](const TextureEntry& e) { return o.type == e.info.name && e.is_solid; });
}

}  // namespace

bool is_relief(const SceneObject& o) {
    return o.category == "bsdf" && (o.type == "bumpmap" || o.type == "normalmap");
}

/// Whether Mitsuba 3 has the texture and all that it is made of.
bool PlainTextures::is_plain(int index) const {
    const SceneObject& o = s_.original().objects[size_t(index)];
    if (!entry_of_mitsuba_3(o)) return false;
    const Param* file = o.find("filename");
    const std::string* name = file ? file->as<std::string>() : nullptr;
    if (o.type == "bitmap" && (o.find("channel") || (name && !reads_image(*name)))) return false;
    if (is_of_second_uvs(o)) return false;
    if (o.type == "mesh_attribute" && text(o, "name", "vertex_color") != "vertex_color")
        return false;
    return std::all_of(o.children.begin(), o.children.end(),
                       [&](const auto& c) { return is_plain(c.object); });
}

/// Mitsuba 3 wraps in the same way along u and v, and its images have no end.
void PlainTextures::replace_wrapping(SceneObject& o) {
    const std::string u = text(o, "wrap_mode", "repeat"), v = text(o, "wrap_mode_v", u);
    const auto known = [](const std::string& mode) {
        return mode == "zero" || mode == "one" ? "clamp" : mode;
    };
    if (v != u)
        s_.warn(o, fmt::format("Mitsuba 3 wraps images in the same way along u and v: \"{}\" "
                               "stands in for \"{}\" along v",
                               known(u), v));
    if (known(u) != u)
        s_.warn(o, fmt::format("Mitsuba 3 has no wrap mode \"{}\": \"clamp\" stands in for it", u));
    remove(o, "wrap_mode_v");
    if (o.find("wrap_mode")) set(o, "wrap_mode", known(u));
}

void PlainTextures::replace(int index) {
    if (s_.object(index).category == "texture") {
        SceneObject& texture = s_.object(index);
        if (texture.type == "bitmap") replace_wrapping(texture), remove(texture, "uv_set");
        return;
    }
    const SceneObject parent = s_.object(index);
    for (const SceneObject::Child& c : parent.children) {
        if (s_.scene().objects[size_t(c.object)].category != "texture") continue;
        const bool needs_number = c.name.starts_with("alpha") && parent.type == "roughplastic";
        // Mitsuba 3 knows the gradient of images alone.
        const bool needs_image =
            parent.type == "bumpmap" && s_.original().objects[size_t(c.object)].type != "bitmap";
        if (is_plain(c.object) && !needs_number && !needs_image) continue;
        const Texture* texture = models_.make_texture(c.object);
        const bool is_uniform = !s_.depends_on(c.object, [](const SceneObject& o) {
            return o.type != "constant" && o.type != "scale" && o.type != "mix" &&
                   o.type != "roughness_to_alpha";
        });
        const bool is_baked =
            texture && !is_uniform && !needs_number && !s_.depends_on(c.object, is_of_space);
        if (is_baked) {
            const auto child = std::find_if(
                s_.object(index).children.begin(), s_.object(index).children.end(),
                [&](const auto& k) { return k.object == c.object && k.name == c.name; });
            child->object = baked(c.object, *texture);
            continue;
        }
        if (is_relief(parent)) {  // unwrap_relief() leaves it out
            if (!is_uniform)
                s_.warn(s_.original().objects[size_t(c.object)],
                        fmt::format("Mitsuba 3 has no such texture for bsdf \"{}\": the relief "
                                    "is left out",
                                    parent.type));
            remove_child(index, c.object);
            continue;
        }
        if (!is_uniform)
            s_.warn(s_.original().objects[size_t(c.object)],
                    fmt::format("Mitsuba 3 has no such texture for \"{}\" of {} \"{}\": its mean "
                                "stands in for it",
                                c.name, parent.category, parent.type));
        const Rgb mean = texture ? texture->mean() : Rgb(0.5f);
        if (c.name.empty())
            remove_child(index, c.object);
        else if (needs_number)
            set(s_.object(index), c.name, double(luminance(mean)));
        else
            set(s_.object(index), c.name, mean);
    }
}

void PlainTextures::unwrap_relief(int index) {
    const SceneObject& o = s_.object(index);
    if (!is_relief(o)) return;
    int inner = -1;
    for (const auto& c : o.children) {
        if (s_.object(c.object).category == "texture") return;
        if (s_.object(c.object).category == "bsdf") inner = c.object;
    }
    if (inner < 0) return;
    for (SceneObject& parent : s_.scene().objects)
        for (auto& c : parent.children)
            if (c.object == index) c.object = inner;
    const bool is_root = std::find(s_.scene().roots.begin(), s_.scene().roots.end(), inner) !=
                         s_.scene().roots.end();
    if (is_root)
        std::erase(s_.scene().roots, index);
    else
        std::replace(s_.scene().roots.begin(), s_.scene().roots.end(), index, inner);
}

void PlainTextures::remove_child(int index, int child) {
    std::erase_if(s_.object(index).children, [&](const auto& k) { return k.object == child; });
}

/// An image of the texture over the unit square.
int PlainTextures::baked(int index, const Texture& texture) {
    if (const auto it = baked_.find(index); it != baked_.end()) return it->second;
    const SceneObject& original = s_.original().objects[size_t(index)];
    int width, height;
    texture.resolution(width, height);
    // Edges between the cells of the grid stay sharp only in an image that is much finer.
    if (original.type != "bitmap")
        width *= 1 + kBakedSize / width, height *= 1 + kBakedSize / height;
    if (std::max(width, height) > kLargestBaked)
        s_.warn(original, fmt::format("the image of {}×{} pixels is reduced", width, height));
    width = std::min(width, kLargestBaked), height = std::min(height, kLargestBaked);
    std::vector<Rgb> pixels;
    pixels.reserve(size_t(width) * size_t(height));
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            pixels.push_back(texture.eval(
                TexturePoint((float(x) + 0.5f) / float(width), (float(y) + 0.5f) / float(height))));
    if (original.type != "bitmap" || original.find("to_uv"))
        s_.warn(original, fmt::format("texture \"{}\" becomes an image of {}×{} pixels over the "
                                      "unit square",
                                      original.type, width, height));
    SceneObject bitmap{"texture", "bitmap", "", original.where, {}, {}};
    set(bitmap, "raw", true);
    for (const char* name : {"filter_type", "wrap_mode", "wrap_mode_v"})
        if (const Param* p = original.find(name)) bitmap.params.push_back(*p);
    replace_wrapping(bitmap);
    s_.set_image(bitmap, pfm(width, height, pixels));
    return baked_[index] = s_.add(std::move(bitmap));
}

}  // namespace etendue
