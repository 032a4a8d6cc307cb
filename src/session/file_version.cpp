#include "session/file_version.h"

#include <sys/stat.h>

#include <fmt/format.h>

namespace etendue {

std::string file_version(const std::string& file) {
    struct stat about {};
    if (::stat(file.c_str(), &about) != 0) return {};
    return fmt::format("{}.{} {} {}", about.st_mtim.tv_sec, about.st_mtim.tv_nsec, about.st_size,
                       about.st_ino);
}

}  // namespace etendue
