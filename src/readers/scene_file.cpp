#include "readers/scene_file.h"

#include <filesystem>

#include <fmt/format.h>

#include "readers/file_bytes.h"
#include "readers/gltf.h"
#include "readers/mitsuba_xml.h"
#include "readers/pbrt.h"

namespace etendue {

void check_scene_file(const std::string& file) {
    if (!std::filesystem::exists(file))
        throw std::runtime_error(fmt::format("{}: there is no such file", file));
    if (std::filesystem::is_directory(file))
        throw std::runtime_error(fmt::format("{}: this is a folder, not a scene file", file));
}

SceneDescription read_scene_file(const std::string& file, const ReadOptions& options) {
    check_scene_file(file);
    std::filesystem::path path = file;
    if (path.extension() == ".gz") path = path.stem();
    const std::string extension = path.extension().string();
    const auto read = [&](SceneDescription (*reader)(const std::string&, const ReadOptions&)) {
        return read_in_memory(file, [&] { return reader(file, options); });
    };
    if (extension == ".xml") return read(read_mitsuba_xml);
    if (extension == ".pbrt") {
        if (!options.defines.empty()) throw UnusedDefines("scenes of pbrt have no parameters");
        return read(read_pbrt);
    }
    if (extension == ".gltf" || extension == ".glb") {
        if (!options.defines.empty()) throw UnusedDefines("scenes of glTF have no parameters");
        return read(read_gltf);
    }
    if (extension.starts_with(".usd"))
        throw std::runtime_error(fmt::format("{}: stages of USD are read by the Python package: "
                                             "python -m etendue.usd {} scene.xml",
                                             file, file));
    throw std::runtime_error(
        fmt::format("{}: unknown kind of scene file \"{}\" (known: .xml, of Mitsuba 0.6 and 3; "
                    ".pbrt, of pbrt-v3 and v4; .gltf and .glb)",
                    file, extension));
}

}  // namespace etendue
