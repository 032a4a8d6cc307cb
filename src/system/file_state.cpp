#include "system/file_state.h"

#include <sys/stat.h>

#include <ctime>

namespace etendue {

FileState file_state(const std::string& file) {
    struct stat s;
    if (::stat(file.c_str(), &s) != 0) return {};
    const auto ns = [](const timespec& t) {
        return int64_t(t.tv_sec) * 1'000'000'000 + int64_t(t.tv_nsec);
    };
    timespec now{};
    ::clock_gettime(CLOCK_REALTIME, &now);
    // The coarsest file systems count in steps of two seconds.
    constexpr int64_t kSettles = 3'000'000'000;
    return {.device = s.st_dev,
            .inode = s.st_ino,
            .size = uint64_t(s.st_size),
            .written = ns(s.st_mtim),
            .changed = ns(s.st_ctim),
            .is_settled = ns(now) - ns(s.st_ctim) > kSettles};
}

}  // namespace etendue
