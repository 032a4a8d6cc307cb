#pragma once
// What every scene reader takes besides the file's name.

#include <functional>
#include <map>
#include <optional>
#include <string>

namespace etendue {

struct ReadOptions {
    /// Values of the scene's parameters (`$name`), stronger than the file's own defaults.
    std::map<std::string, std::string> defines;
    /// Unknown elements and attributes become warnings that name what was dropped.
    bool lenient = false;
    /// Contents of an included or spectrum file, nothing where there is none. Readers that are given a file's name
    /// take the disk where this is empty; those that are given text then find no file at all.
    std::function<std::optional<std::string>(const std::string& path)> read_file = nullptr;
};

}  // namespace etendue
