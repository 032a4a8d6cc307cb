#pragma once
// Textures of a scene for Mitsuba 3: those that it lacks become images or constants.

#include <map>

#include "scene/model_builder.h"
#include "scene/plain_scene.h"

namespace etendue {

class PlainTextures {
public:
    explicit PlainTextures(PlainScene& s) : s_(s), lookup_(s.original(), true), models_(lookup_) {}

    /// Replaces the textures of an object that Mitsuba 3 lacks; to be called for all objects before unwrap_relief().
    void replace(int index);
    /// A relief without texture, which Mitsuba 3 refuses, is the material that it wraps.
    void unwrap_relief(int index);

private:
    bool is_plain(int index) const;
    void replace_wrapping(SceneObject& o);
    void remove_child(int index, int child);
    int baked(int index, const Texture& texture);

    PlainScene& s_;
    PluginLookup lookup_;
    ModelBuilder models_;
    std::map<int, int> baked_;
};

/// Whether an object is a bump or normal map.
bool is_relief(const SceneObject& o);

}  // namespace etendue
