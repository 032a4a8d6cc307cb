#include "description/resolve_file.h"

#include <filesystem>

#include <fmt/format.h>

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// The name in the folder of `path` that is nearest to its file name, or "".
std::string nearest_file(const fs::path& path) {
    std::vector<std::string> names;
    std::error_code error;  // ignored: a folder that cannot be listed has no names
    for (const auto& entry : fs::directory_iterator(path.parent_path(), error))
        names.push_back(entry.path().filename().string());
    return nearest_name(path.filename().string(), names);
}

}  // namespace

std::string resolve_file(const Params& params, std::string_view name) {
    const std::string file = params.text(name, "");
    if (file.empty())
        params.fail(name, fmt::format("{} \"{}\" needs the parameter \"{}\"",
                                      params.object().category, params.object().type, name));
    std::vector<fs::path> places;
    if (fs::path(file).is_absolute())
        places.emplace_back(file);
    else
        for (const std::string& folder : params.scene().search_paths)
            places.push_back(fs::path(folder) / file);
    if (places.empty()) places.emplace_back(file);

    std::vector<std::string> folders;
    std::string near;
    for (const fs::path& place : places) {
        std::error_code error;
        if (fs::is_regular_file(place, error)) return place.string();
        const fs::path folder = place.parent_path();
        folders.push_back(folder.empty() ? "." : folder.string());
        if (near.empty()) near = nearest_file(place);
    }
    params.fail(name, fmt::format("there is no file \"{}\" (looked in {}{})", file,
                                  fmt::join(folders, ", "),
                                  near.empty() ? "" : fmt::format("; did you mean \"{}\"?", near)));
}

}  // namespace etendue
