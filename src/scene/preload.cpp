#include "scene/preload.h"

#include <algorithm>
#include <functional>
#include <set>

#include <tbb/parallel_for.h>

#include "texture/bitmap.h"

namespace etendue {

Preload::Preload(const SceneDescription& description, TextureCache& images)
    : shapes_(description.objects.size()) {
    std::vector<std::function<void()>> jobs;
    std::set<std::pair<std::string, bool>> image_names;
    for (size_t i = 0; i < shapes_.size(); ++i) {
        const Params params(description, int(i));
        const SceneObject& object = params.object();
        if (object.category == "texture" && object.type == "bitmap") {
            const std::optional<BitmapFile> file = bitmap_file(params);
            if (file && image_names.emplace(file->name, file->raw).second)
                jobs.push_back([&images, file = *file] {
                    try {
                        images.load(file.name, file.raw);
                    } catch (const std::exception&) {
                        // The bitmap reports it.
                    }
                });
        } else if (object.category == "shape") {
            const auto& registry = shape_registry();
            const auto entry =
                std::find_if(registry.begin(), registry.end(),
                             [&](const ShapeEntry& e) { return object.type == e.info.name; });
            if (entry != registry.end())
                jobs.push_back([this, i, params, entry] { shapes_[i] = make(*entry, params); });
        }
    }
    tbb::parallel_for(size_t(0), jobs.size(), [&](size_t i) { jobs[i](); });
}

Preload::Made Preload::make(const ShapeEntry& entry, const Params& params) {
    Made made;
    try {
        made.shape = entry.make(params, [&](const std::string& m) { made.warnings.push_back(m); });
        const std::lock_guard lock(mutex_);
        if (!watch_.add(made.shape->memory_bytes())) {
            made.shape.reset();
            params.fail("the shapes of the scene need more memory than is free");
        }
    } catch (const std::exception&) {
        made.error = std::current_exception();
    }
    return made;
}

std::unique_ptr<Shape> Preload::take_shape(const ShapeEntry& entry, const Params& params,
                                           const std::function<void(const std::string&)>& warn) {
    auto& kept = shapes_[size_t(params.index())];
    Made made = kept ? std::move(*kept) : make(entry, params);
    kept.reset();
    for (const std::string& m : made.warnings) warn(m);
    if (made.error) std::rethrow_exception(made.error);
    return std::move(made.shape);
}

}  // namespace etendue
