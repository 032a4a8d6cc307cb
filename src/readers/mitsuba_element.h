#pragma once
// One XML element with its attributes after substitution of parameters.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "description/scene_description.h"

namespace etendue {

struct Element {
    std::string name;
    SourceLocation where;
    std::vector<std::pair<std::string, std::string>> attributes;

    const std::string* find(std::string_view attribute) const {
        for (const auto& [key, value] : attributes)
            if (key == attribute) return &value;
        return nullptr;
    }
    /// An attribute whose presence the reader has checked.
    const std::string& operator[](std::string_view attribute) const { return *find(attribute); }
};

}  // namespace etendue
