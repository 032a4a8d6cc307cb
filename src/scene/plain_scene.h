#pragma once
// The scene that make_plain_mitsuba() rewrites, and what all parts of the rewriting share.

#include <cstddef>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"
#include "description/scene_description.h"
#include "scene/mitsuba_manual.h"

namespace etendue {

class PlainScene {
public:
    explicit PlainScene(SceneDescription& scene);

    SceneDescription& scene() { return scene_; }
    /// What the scene was at the beginning, without its meshes. Indices of objects are the same.
    const SceneDescription& original() const { return original_; }
    SceneObject& object(int index) { return scene_.objects[size_t(index)]; }
    int index_of(const SceneObject& o) const { return int(&o - scene_.objects.data()); }
    /// Whether an original object, or one that it holds, fulfils a condition.
    bool depends_on(int index, const std::function<bool(const SceneObject&)>& what) const;

    /// Adds an object, which moves all others in memory.
    int add(SceneObject&& o);
    /// Gives a bitmap or an environment the contents of an image file.
    void set_image(SceneObject& o, std::string bytes);
    /// An approximation, at the place of `o` in the scene file; each is reported once.
    void warn(const SceneObject& o, const std::string& message);
    /// `o` becomes `type`, which is not the same; `difference` tells what differs.
    void stand_in(SceneObject& o, const std::string& type, const std::string& difference = {});
    /// Whether it has been reported that the object is replaced.
    bool is_stand_in(int index) const { return stand_ins_.count(index) > 0; }
    std::vector<std::string> take_warnings() { return std::move(warnings_); }

private:
    SceneDescription& scene_;
    const SceneDescription original_;
    std::set<int> stand_ins_;
    std::vector<std::string> warnings_;
};

/// The entry of a plug-in that Mitsuba 3 has; nullptr for others.
const ManualEntry* entry_of_mitsuba_3(const SceneObject& o);
/// The bytes of an image file with these pixels, from the top row to the bottom one.
std::string pfm(int width, int height, const std::vector<Rgb>& pixels);
/// Whether Mitsuba 3 reads image files of this kind.
bool reads_image(const std::string& file);
/// Least number of pixels along each side of images that are made.
inline constexpr int kBakedSize = 512;

// ---- Parameters, which may be textures, of one object

bool has(const SceneObject& o, std::string_view name);
bool has_texture(const SceneObject& o, std::string_view name);
void remove(SceneObject& o, std::string_view name);
void set(SceneObject& o, const std::string& name, ParamValue value);
void rename(SceneObject& o, std::string_view from, const std::string& to);
/// The luminance of colours.
double number(const SceneObject& o, std::string_view name, double fallback);
std::string text(const SceneObject& o, std::string_view name, std::string_view fallback);
Rgb rgb(const SceneObject& o, std::string_view name, Rgb fallback);

}  // namespace etendue
