#include "output_checks.h"

#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// A path without links, also of a file that is still to be made, and through links to it.
fs::path real_path(const std::string& file) {
    constexpr int kMostLinks = 40;  // as the kernel
    std::error_code error;
    fs::path path = fs::absolute(file, error);
    for (int i = 0; i < kMostLinks && fs::is_symlink(fs::symlink_status(path, error)); ++i)
        path = path.parent_path() / fs::read_symlink(path, error);
    const fs::path real = fs::weakly_canonical(path, error);
    return error ? fs::path(file) : real;
}

}  // namespace

void refuse_same_file(const char* one, const std::string& file, const char* other,
                      const std::string& other_file) {
    if (file.empty() || other_file.empty()) return;
    const fs::path path = real_path(file);
    std::error_code error;
    if (path != real_path(other_file) ||
        (fs::exists(path, error) && !fs::is_regular_file(path, error)))
        return;
    throw std::runtime_error(
        fmt::format("the {} and the {} cannot be the same file: {}", one, other, other_file));
}

}  // namespace etendue
