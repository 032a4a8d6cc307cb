#pragma once
// What the page shows of a scene whatever is rendered: computed once, when it is first asked for, by any thread.

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "render/aov.h"
#include "session/first_picture.h"

namespace etendue {

class SceneData {
public:
    explicit SceneData(std::shared_ptr<const Scene> scene) : scene_(std::move(scene)) {}
    const std::shared_ptr<const Scene>& scene() const { return scene_; }

    const FirstPicture& first_picture();
    /// The pixels of a layer of aov_registry(), except those that the passes of a rendering make.
    const std::vector<Rgb>& layer(const std::string& name);
    /// The shapes as encode() writes them.
    std::shared_ptr<const std::string> geometry();

private:
    std::shared_ptr<const Scene> scene_;
    std::once_flag first_, layers_, geometry_;
    FirstPicture first_picture_;
    std::vector<AovImage> aovs_;
    std::shared_ptr<const std::string> geometry_bytes_;
};

}  // namespace etendue
