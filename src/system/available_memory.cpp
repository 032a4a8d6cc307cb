#include "system/available_memory.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <stdexcept>
#include <string_view>

#include <sys/resource.h>

#include <fmt/format.h>

namespace etendue {
namespace {

std::optional<uint64_t> parse(std::string_view text) {
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end == text.data()) return {};
    return value;
}

/// The number after `name` in a file of lines "name 123" or "name:  123 kB".
std::optional<uint64_t> entry(const std::string& file, std::string_view name) {
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        if (line.rfind(name, 0) != 0) continue;
        const size_t digit = line.find_first_of("0123456789", name.size());
        if (digit == line.npos) return {};
        const auto value = parse(std::string_view(line).substr(digit));
        return value && line.ends_with(" kB") ? *value * 1024 : value;
    }
    return {};
}

/// The only number of a file; empty for "max".
std::optional<uint64_t> number(const std::string& file) {
    std::ifstream in(file);
    std::string text;
    in >> text;
    return parse(text);
}

void lower(std::optional<uint64_t>& least, std::optional<uint64_t> value) {
    if (value) least = std::min(least.value_or(*value), *value);
}

/// What a control group allows beyond what it uses. Cached files count as free, since the system drops them first.
std::optional<uint64_t> left_in(const std::string& folder, const char* limit, const char* usage,
                                const char* cached, const char* shared) {
    const auto most = number(folder + "/" + limit), used = number(folder + "/" + usage);
    if (!most || !used) return {};
    const auto counted = [&](const char* name) {
        return entry(folder + "/memory.stat", std::string(name) + " ").value_or(0);
    };
    // Files in memory (/dev/shm) are counted as cached, but nothing else has them.
    const uint64_t cache = counted(cached), in_memory = std::min(counted(shared), cache);
    const uint64_t kept = *used - std::min(cache - in_memory, *used);
    return *most - std::min(kept, *most);
}

/// The least of a group and those that contain it.
void lower_by_groups(std::optional<uint64_t>& least, const std::string& proc,
                     const std::string& root) {
    std::ifstream in(proc + "/self/cgroup");
    for (std::string line; std::getline(in, line);) {  // hierarchy:controllers:path
        const size_t first = line.find(':'), second = line.find(':', first + 1);
        if (first == line.npos || second == line.npos) continue;
        const std::string controllers = line.substr(first + 1, second - first - 1);
        const bool is_v2 = controllers.empty();
        if (!is_v2 && controllers.find("memory") == controllers.npos) continue;
        const std::string base = is_v2 ? root : root + "/memory";
        std::string path = line.substr(second + 1);
        while (true) {
            if (path == "/") path.clear();
            lower(least, is_v2
                             ? left_in(base + path, "memory.max", "memory.current", "file", "shmem")
                             : left_in(base + path, "memory.limit_in_bytes",
                                       "memory.usage_in_bytes", "total_cache", "total_shmem"));
            if (path.empty()) break;
            path.resize(path.rfind('/') == path.npos ? 0 : path.rfind('/'));
        }
    }
}

/// What a limit of the process leaves of that of which it has `used`.
void lower_by_limit(std::optional<uint64_t>& least, decltype(RLIMIT_AS) kind,
                    std::optional<uint64_t> used) {
    rlimit limit{};
    if (getrlimit(kind, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY || !used) return;
    lower(least, uint64_t(limit.rlim_cur) - std::min(*used, uint64_t(limit.rlim_cur)));
}

}  // namespace

std::optional<uint64_t> memory_for_data(const std::string& proc) {
    return entry(proc + "/self/status", "VmData:");
}

std::optional<uint64_t> address_space(const std::string& proc) {
    return entry(proc + "/self/status", "VmSize:");
}

std::optional<uint64_t> available_memory(const std::string& proc, const std::string& cgroup,
                                         int sharers) {
    std::optional<uint64_t> least = entry(proc + "/meminfo", "MemAvailable:");
    lower_by_groups(least, proc, cgroup);
    if (least) *least /= uint64_t(sharers);
    // Limits of the process leave nothing to others.
    lower_by_limit(least, RLIMIT_AS, address_space(proc));
    lower_by_limit(least, RLIMIT_DATA, memory_for_data(proc));
    return least;
}

std::optional<uint64_t> available_memory(int sharers) {
    return available_memory("/proc", "/sys/fs/cgroup", sharers);
}

std::string format_bytes(uint64_t bytes) {
    constexpr double kMiB = 1 << 20, kGiB = 1 << 30;
    const auto b = double(bytes);
    return b >= 10 * kGiB ? fmt::format("{:.0f} GiB", b / kGiB)
           : b >= kGiB    ? fmt::format("{:.1f} GiB", b / kGiB)
                          : fmt::format("{:.0f} MiB", b / kMiB);
}

void require_memory(uint64_t bytes, const std::string& what, const std::string& advice) {
    const auto available = available_memory();
    if (available && bytes > *available)
        throw std::runtime_error(fmt::format("{} needs {} of memory, but only {} are free{}", what,
                                             format_bytes(bytes), format_bytes(*available),
                                             advice));
}

bool MemoryWatch::add(uint64_t bytes) {
    unchecked_ += bytes;
    if (unchecked_ < kStep) return true;
    // The next step must fit, too, since it is not looked at before it is complete.
    const uint64_t next = unchecked_ + kStep;
    unchecked_ = 0;
    const auto available = available_memory();
    return !available || next <= *available;
}

}  // namespace etendue
