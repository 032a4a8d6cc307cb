#include "system/memory_limit.h"

#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <string>

#include <sys/resource.h>

#include <fmt/format.h>

#include "system/available_memory.h"

namespace etendue {
namespace {

rlimit data_limit() {
    rlimit limit{};
    getrlimit(RLIMIT_DATA, &limit);
    return limit;
}

void set_limit(uint64_t bytes) {
    rlimit limit = data_limit();
    limit.rlim_cur = std::min(rlim_t(bytes), limit.rlim_max);
    setrlimit(RLIMIT_DATA, &limit);
}

}  // namespace

void limit_memory(uint64_t bytes) {
    if (const auto used = memory_for_data("/proc"); used && *used >= bytes)
        throw std::runtime_error(
            fmt::format("the memory cannot be limited to {}, since the program needs {} for itself",
                        format_bytes(bytes), format_bytes(*used)));
    set_limit(std::min(rlim_t(bytes), data_limit().rlim_cur));
}

void limit_memory_to_available() {
    const auto used = memory_for_data("/proc"), free = available_memory();
    // Sanitizers reserve many terabytes.
    constexpr uint64_t kMostForItself = uint64_t(1) << 40;
    if (used && free && *used < kMostForItself)
        set_limit(std::min(rlim_t(*used + *free), data_limit().rlim_cur));
}

UnlimitedMemory::UnlimitedMemory() : limit_(data_limit().rlim_cur) {
    set_limit(RLIM_INFINITY);
}

UnlimitedMemory::~UnlimitedMemory() {
    set_limit(limit_);
}

}  // namespace etendue
