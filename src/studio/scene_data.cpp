#include "studio/scene_data.h"

#include "session/scene_geometry.h"
#include "studio/geometry_reply.h"
#include "studio/request_values.h"

namespace etendue {

const FirstPicture& SceneData::first_picture() {
    std::call_once(first_, [&] { first_picture_ = etendue::first_picture(*scene_); });
    return first_picture_;
}

const std::vector<Rgb>& SceneData::layer(const std::string& name) {
    std::call_once(layers_, [&] {
        std::vector<std::string> names;
        for (const AovInfo& info : aov_registry()) names.push_back(info.name);
        constexpr int kSamples = 4;
        aovs_ = render_aovs(*scene_, names, kSamples, 0, 1);
    });
    for (const AovImage& image : aovs_)
        if (image.name == name) return image.pixels;
    throw ApiError(404, "there is no such layer");
}

std::shared_ptr<const std::string> SceneData::geometry() {
    std::call_once(geometry_, [&] {
        constexpr size_t kMostTriangles = 1'000'000;
        geometry_bytes_ =
            std::make_shared<const std::string>(encode(drawn_shapes(*scene_, kMostTriangles)));
    });
    return geometry_bytes_;
}

}  // namespace etendue
