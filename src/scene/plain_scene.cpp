#include "scene/plain_scene.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "image/image_io.h"

namespace etendue {
namespace {

SceneDescription without_meshes(const SceneDescription& scene) {
    SceneDescription out;
    out.objects = scene.objects;
    out.roots = scene.roots;
    out.images = scene.images;
    out.file = scene.file;
    out.search_paths = scene.search_paths;
    return out;
}

}  // namespace

PlainScene::PlainScene(SceneDescription& scene) : scene_(scene), original_(without_meshes(scene)) {}

bool PlainScene::depends_on(int index, const std::function<bool(const SceneObject&)>& what) const {
    const SceneObject& o = original_.objects[size_t(index)];
    return what(o) || std::any_of(o.children.begin(), o.children.end(),
                                  [&](const auto& c) { return depends_on(c.object, what); });
}

int PlainScene::add(SceneObject&& o) {
    scene_.objects.push_back(std::move(o));
    return int(scene_.objects.size()) - 1;
}

void PlainScene::set_image(SceneObject& o, std::string bytes) {
    const size_t index = scene_.images.size();
    set(o, "image", int64_t(index));
    scene_.images.push_back(EncodedImage{fmt::format("texture {}", index), std::move(bytes)});
}

void PlainScene::warn(const SceneObject& o, const std::string& message) {
    const std::string line = SceneError(o.where, message).what();
    if (std::find(warnings_.begin(), warnings_.end(), line) == warnings_.end())
        warnings_.push_back(line);
}

void PlainScene::stand_in(SceneObject& o, const std::string& type, const std::string& difference) {
    warn(o, fmt::format("Mitsuba 3 has no {0} \"{1}\": {0} \"{2}\" stands in for it{3}{4}",
                        o.category, o.type, type, difference.empty() ? "" : "; ", difference));
    o.type = type;
    stand_ins_.insert(index_of(o));
}

const ManualEntry* entry_of_mitsuba_3(const SceneObject& o) {
    const ManualEntry* entry = find_manual_entry(o.category, o.type);
    return entry && (entry->manuals & kMitsuba3) ? entry : nullptr;
}

std::string pfm(int width, int height, const std::vector<Rgb>& pixels) {
    std::string out = fmt::format("PF\n{} {}\n-1\n", width, height);
    for (int y = height; y-- > 0;)
        for (int x = 0; x < width; ++x) {
            const Rgb& c = pixels[size_t(y) * size_t(width) + size_t(x)];
            const float channels[] = {c.r, c.g, c.b};
            out.append(reinterpret_cast<const char*>(channels), sizeof channels);
        }
    return out;
}

bool reads_image(const std::string& file) {
    static const std::set<std::string> known = {".exr", ".hdr",  ".rgbe", ".pfm", ".png",
                                                ".jpg", ".jpeg", ".bmp",  ".tga"};
    return known.count(image_extension(file)) > 0;
}

bool has(const SceneObject& o, std::string_view name) {
    return o.find(name) || std::any_of(o.children.begin(), o.children.end(),
                                       [&](const SceneObject::Child& c) { return c.name == name; });
}

void remove(SceneObject& o, std::string_view name) {
    std::erase_if(o.params, [&](const Param& p) { return p.name == name; });
    std::erase_if(o.children, [&](const SceneObject::Child& c) { return c.name == name; });
}

void set(SceneObject& o, const std::string& name, ParamValue value) {
    remove(o, name);
    o.params.push_back({name, std::move(value), o.where});
}

void rename(SceneObject& o, std::string_view from, const std::string& to) {
    for (Param& p : o.params)
        if (p.name == from) p.name = to;
    for (SceneObject::Child& c : o.children)
        if (c.name == from) c.name = to;
}

double number(const SceneObject& o, std::string_view name, double fallback) {
    const Param* p = o.find(name);
    if (!p) return fallback;
    if (const auto* i = p->as<int64_t>()) return double(*i);
    if (const auto* d = p->as<double>()) return *d;
    if (const auto* c = p->as<Rgb>()) return double(luminance(*c));
    return fallback;
}

std::string text(const SceneObject& o, std::string_view name, std::string_view fallback) {
    const Param* p = o.find(name);
    const auto* s = p ? p->as<std::string>() : nullptr;
    return s ? *s : std::string(fallback);
}

Rgb rgb(const SceneObject& o, std::string_view name, Rgb fallback) {
    const Param* p = o.find(name);
    if (!p) return fallback;
    if (const auto* c = p->as<Rgb>()) return *c;
    return Rgb(float(number(o, name, 0)));
}

bool has_texture(const SceneObject& o, std::string_view name) {
    return has(o, name) && !o.find(name);
}

}  // namespace etendue
