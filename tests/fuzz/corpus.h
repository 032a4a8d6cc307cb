#pragma once
// The inputs from which fuzzing starts.

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "fuzz_target.h"

namespace etendue::fuzz {

inline std::string from_hex(const std::string& text) {
    std::string bytes;
    int digits = 0, value = 0;
    for (const char c : text) {
        if (!std::isxdigit(static_cast<unsigned char>(c))) continue;
        value = value * 16 + (c <= '9' ? c - '0' : (c | 32) - 'a' + 10);
        if (++digits % 2 == 0) bytes += char(std::exchange(value, 0));
    }
    return bytes;
}

/// Those that the target makes, those of its corpus, and files of the project.
inline std::vector<std::string> corpus(const Target& target) {
    namespace fs = std::filesystem;
    std::vector<fs::path> files;
    const fs::path project = ETENDUE_SOURCE_DIR;
    if (const fs::path own = project / "tests/fuzz/corpus" / target.name; fs::exists(own))
        for (const auto& entry : fs::directory_iterator(own)) files.push_back(entry.path());
    for (const char* folder : target.folders)
        for (const auto& entry : fs::recursive_directory_iterator(project / folder))
            if (entry.path().extension() == target.extension) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    std::vector<std::string> inputs;
    if (target.seeds) inputs = target.seeds();
    for (const fs::path& file : files) {
        std::ifstream in(file, std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(in), {}};
        inputs.push_back(file.extension() == ".hex" ? from_hex(bytes) : bytes);
    }
    return inputs;
}

}  // namespace etendue::fuzz
