#pragma once

#include <map>
#include <string>

#include "readers/read_options.h"

namespace etendue {

/// Options of readers that find these files and no others.
inline ReadOptions with_files(const std::map<std::string, std::string>& files) {
    ReadOptions options;
    options.read_file = [files](const std::string& path) -> std::optional<std::string> {
        const auto it = files.find(path);
        if (it == files.end()) return {};
        return it->second;
    };
    return options;
}

}  // namespace etendue
