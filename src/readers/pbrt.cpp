#include "readers/pbrt.h"

#include <deque>

#include <fmt/format.h>

#include "readers/file_bytes.h"
#include "readers/pbrt_reader.h"

namespace etendue {

SceneDescription read_pbrt(const std::string& file, const ReadOptions& options) {
    const ReadOptions all = with_disk(options);
    return parse_pbrt(read_scene_bytes(file, all), file, all);
}

SceneDescription parse_pbrt(std::string_view text, const std::string& file,
                            const ReadOptions& options) {
    return PbrtReader(file, options).read(text);
}

const std::vector<PluginInfo>& pbrt_plugins() {
    static std::deque<std::string> texts;  // of descriptions that begin with a version
    static const std::vector<PluginInfo> infos = [] {
        std::vector<PluginInfo> all;
        const auto with_version = [&](int versions, const char* doc) {
            if (versions == kV3And4) return doc;
            return texts.emplace_back(fmt::format("v{}: {}", versions == kV3 ? 3 : 4, doc)).c_str();
        };
        const auto add = [&](const char* category, const std::vector<PbrtEntry>& entries) {
            for (const PbrtEntry& e : entries) {
                if (e.name.empty()) continue;
                PluginInfo info{category, e.name.data(), with_version(e.versions, e.doc), {}};
                for (const PbrtParamInfo& p : e.params)
                    info.params.push_back(
                        {p.name.data(), p.kind, p.fallback,
                         p.versions == e.versions ? p.doc : with_version(p.versions, p.doc)});
                all.push_back(std::move(info));
            }
        };
        add("pbrt-shape", pbrt_shapes());
        add("pbrt-material", pbrt_materials());
        add("pbrt-texture", pbrt_textures());
        add("pbrt-light", pbrt_lights());
        add("pbrt-area-light", pbrt_area_lights());
        add("pbrt-medium", pbrt_media());
        add("pbrt-camera", pbrt_cameras());
        add("pbrt-film", pbrt_films());
        add("pbrt-filter", pbrt_filters());
        add("pbrt-sampler", pbrt_samplers());
        add("pbrt-integrator", pbrt_integrators());
        return all;
    }();
    return infos;
}

}  // namespace etendue
