#pragma once
// Writer of scene descriptions as XML of Mitsuba 3, with meshes and images that the description holds in files beside
// it. Plug-ins and parameters keep their names, also those that Mitsuba does not have.

#include <functional>
#include <string>
#include <vector>

#include "description/scene_description.h"

namespace etendue {

/// A file to be written; `name` is relative to the folder of the XML file.
struct SceneFile {
    std::string name;
    std::string bytes;
};

/// Writes `scene` for an XML file at `path`; `files_folder` is the name of the folder for meshes and images, relative to
/// that of the XML file. Calls `add_file` for each of these files, and returns the XML. Throws SceneError where a mesh
/// file cannot be read.
std::string write_mitsuba_xml(const SceneDescription& scene, const std::string& path,
                              const std::string& files_folder,
                              const std::function<void(const SceneFile&)>& add_file);

/// A mesh as a binary PLY file.
std::string write_ply(const MeshData& mesh);

}  // namespace etendue
