#include "scene/preload.h"

#include <algorithm>
#include <functional>
#include <set>

#include <tbb/parallel_for.h>

#include "description/resolve_file.h"
#include "texture/bitmap.h"

namespace etendue {

namespace {

/// The state of the file that a shape is read from; empty where it is read from none.
std::optional<FileState> state_of_file(const Params& params) {
    if (!params.has("filename")) return {};
    try {
        return file_state(resolve_file(params));
    } catch (const SceneError&) {
        return FileState{};
    }
}

}  // namespace

Preload::Preload(const SceneDescription& description, TextureCache& images,
                 const BuiltParts* earlier)
    : description_(description), earlier_(earlier), shapes_(description.objects.size()),
      taken_(description.objects.size()) {
    if (earlier) images.use(earlier->images);
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
            if (entry != registry.end() && known_shapes(int(i)) == 0)
                jobs.push_back([this, i, params, entry] { shapes_[i] = make(*entry, params); });
        }
    }
    tbb::parallel_for(size_t(0), jobs.size(), [&](size_t i) { jobs[i](); });
}

size_t Preload::known_shapes(int index) const {
    if (!earlier_ || size_t(index) >= earlier_->shapes.size()) return 0;
    const std::vector<BuiltShape>& known = earlier_->shapes[size_t(index)];
    if (known.empty() || !is_same_shape(earlier_->description, description_, index)) return 0;
    const std::optional<FileState> now = state_of_file({description_, index});
    for (const BuiltShape& s : known)
        if (now.has_value() != s.file.has_value() || (now && !now->has_kept(*s.file))) return 0;
    return known.size();
}

Preload::Made Preload::make(const ShapeEntry& entry, const Params& params) {
    Made made;
    try {
        made.built.file = state_of_file(params);
        std::shared_ptr<const Shape> shape =
            entry.make(params, [&](const std::string& m) { made.built.warnings.push_back(m); });
        const std::lock_guard lock(mutex_);
        if (!watch_.add(shape->memory_bytes()))
            params.fail("the shapes of the scene need more memory than is free");
        made.built.shape = std::move(shape);
    } catch (const std::exception&) {
        made.error = std::current_exception();
    }
    return made;
}

std::shared_ptr<const Shape>
Preload::take_shape(const ShapeEntry& entry, const Params& params,
                    const std::function<void(const std::string&)>& warn) {
    const auto index = size_t(params.index());
    std::vector<BuiltShape>& taken = taken_[index];
    Made made;
    if (taken.size() < known_shapes(params.index()))
        made.built = earlier_->shapes[index][taken.size()];
    else if (shapes_[index])
        made = std::move(*shapes_[index]);
    else
        made = make(entry, params);
    shapes_[index].reset();
    for (const std::string& m : made.built.warnings) warn(m);
    if (made.error) std::rethrow_exception(made.error);
    taken.push_back(std::move(made.built));
    return taken.back().shape;
}

}  // namespace etendue
