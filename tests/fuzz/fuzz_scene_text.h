#pragma once
// Texts of scenes: the result must be a description or a SceneError, and no file is accessed.

#include "description/scene_description.h"
#include "fuzz_target.h"
#include "readers/read_options.h"

namespace etendue::fuzz {

/// Included files are the text itself and a spectrum, so that these elements are reached as well.
template <class Parse>
void run_scene_text(std::string_view text, const std::string& extension, const Parse& parse) {
    ReadOptions options;
    options.lenient = text.size() % 2 == 1;
    options.read_file = [&](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with(".spd")) return "400 1\n700 2\n";
        if (path.ends_with(extension)) return std::string(text);
        return {};
    };
    try {
        dump(parse(text, "fuzz" + extension, options));
    } catch (const SceneError&) {
    }
}

}  // namespace etendue::fuzz
