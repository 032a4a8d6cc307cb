#pragma once

#include <utility>

#include "render/checkpoint.h"
#include "scene/scene.h"

namespace etendue {

/// A scene and what it was built from, by which the files of its runs are known again.
struct LoadedScene {
    LoadedScene(Scene loaded, SceneSource from = {}) : scene(std::move(loaded)), source(from) {}

    Scene scene;
    SceneSource source;
};

}  // namespace etendue
