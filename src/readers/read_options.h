#pragma once
// Options of all scene readers.

#include <functional>
#include <map>
#include <optional>
#include <string>

namespace etendue {

struct ReadOptions {
    /// Values of the scene's parameters (`$name`); they override the file's defaults.
    std::map<std::string, std::string> defines;
    /// Unknown elements and attributes become warnings that name what was dropped.
    bool lenient = false;
    /// Returns the contents of an included or spectrum file, or empty where it cannot be read. If this is not set,
    /// functions that take a file name read from disk, and functions that take text find no files.
    std::function<std::optional<std::string>(const std::string& path)> read_file = nullptr;
    /// Whether `read_file` reads from disk, so that messages may name files that are there.
    bool is_disk = false;
};

}  // namespace etendue
