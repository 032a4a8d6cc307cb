#pragma once
// Scenes used by several tests, in $ETENDUE_SCENES or beside the project.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace etendue::testing {

/// The folder of the shared scenes; empty where there is none.
inline std::filesystem::path shared_scenes() {
    const char* given = std::getenv("ETENDUE_SCENES");
    const std::filesystem::path path =
        given ? given : std::filesystem::path(ETENDUE_SOURCE_DIR) / ".." / "shared" / "scenes";
    return std::filesystem::is_directory(path) ? path : std::filesystem::path();
}

/// All files below the shared scenes with this extension, sorted.
inline std::vector<std::string> shared_files(std::string_view extension) {
    std::vector<std::string> files;
    if (const auto root = shared_scenes(); !root.empty())
        for (const auto& entry : std::filesystem::recursive_directory_iterator(root))
            if (entry.is_regular_file() && entry.path().extension() == extension)
                files.push_back(entry.path().string());
    std::sort(files.begin(), files.end());
    return files;
}

}  // namespace etendue::testing
