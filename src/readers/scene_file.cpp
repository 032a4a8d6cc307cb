#include "readers/scene_file.h"

#include <filesystem>

#include <fmt/format.h>

#include "readers/file_bytes.h"
#include "readers/gltf.h"
#include "readers/mitsuba_xml.h"
#include "readers/pbrt.h"
#include "readers/usd.h"

namespace etendue {
namespace {

/// Files with one ending.
struct Kind {
    const char* extension;
    const char* name;
    SceneDescription (*read)(const std::string&, const ReadOptions&);
    bool has_no_parameters = false;
};
constexpr Kind kKinds[] = {{".xml", "Mitsuba", read_mitsuba_xml},
                           {".pbrt", "pbrt", read_pbrt, true},
                           {".gltf", "glTF", read_gltf, true},
                           {".glb", "glTF", read_gltf, true},
                           {".usd", "USD", read_usd},
                           {".usda", "USD", read_usd},
                           {".usdc", "USD", read_usd},
                           {".usdz", "USD", read_usd}};

/// The one before ".gz".
std::string extension_of(std::filesystem::path path) {
    if (path.extension() == ".gz") path = path.stem();
    return path.extension().string();
}

const Kind* find_kind(const std::string& extension) {
    for (const Kind& kind : kKinds)
        if (kind.extension == extension) return &kind;
    return nullptr;
}

}  // namespace

bool is_scene_file_name(const std::string& file) {
    return find_kind(extension_of(file)) != nullptr;
}

void check_scene_file(const std::string& file) {
    if (!std::filesystem::exists(file))
        throw std::runtime_error(fmt::format("{}: there is no such file", file));
    if (std::filesystem::is_directory(file))
        throw std::runtime_error(fmt::format("{}: this is a folder, not a scene file", file));
}

SceneDescription read_scene_file(const std::string& file, const ReadOptions& options) {
    check_scene_file(file);
    const std::string extension = extension_of(file);
    const Kind* kind = find_kind(extension);
    if (!kind)
        throw std::runtime_error(
            fmt::format("{}: unknown kind of scene file \"{}\" (known: .xml, of Mitsuba 0.6 and 3; "
                        ".pbrt, of pbrt-v3 and v4; .gltf and .glb; .usd, .usda, .usdc and .usdz)",
                        file, extension));
    if (kind->read == read_usd && std::filesystem::path(file).extension() == ".gz")
        throw std::runtime_error(fmt::format(
            "{}: stages of USD are not read from packed files; unpack it by gunzip", file));
    if (kind->has_no_parameters && !options.defines.empty())
        throw UnusedDefines(fmt::format("scenes of {} have no parameters", kind->name));
    return read_in_memory(file, [&] { return kind->read(file, options); });
}

}  // namespace etendue
